"""The likelihood of a range error that switches between two laws in continuous time.

A hidden sight ``r_n`` (0 = LOS, 1 = NLOS) is a continuous-time two-state Markov chain, seen at the irregular
times ``t_n`` through the error ``e_n`` of a range:

    Pr(r_n = j | r_{n-1} = i) = [expm(G (t_n - t_{n-1}))]_{ij},      G = [[-a, a], [b, -b]]
    e_n | r_n = r  ~  (1 - eps) N(mu_r, s_r^2) + eps N(mu_w, s_w^2)

The last component is the *outlier*, common to both sights.  A missing range has likelihood one and the chain goes on.

Everything here takes and returns arrays for one sequence (one link along one track); callers ``vmap``.
The unconstrained parameter vector ``theta`` has the order of `NAMES`.

References
----------
Rabiner, "A tutorial on hidden Markov models", Proc. IEEE 77(2), 1989 (the forward recursion, eq. 19-21).
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax.scipy.special import log_ndtr

from locbounds.axes import Array, Float, Int

NAMES = (
    "los_mean",
    "los_log_std",
    "nlos_mean",
    "nlos_log_std",
    "log_rate_los_to_nlos",
    "log_rate_nlos_to_los",
    "outlier_logit",
    "outlier_mean",
    "outlier_log_std",
    "start_nlos_logit",
)

FORBIDDEN = -1e6
"""Log likelihood of a sight that a label rules out: exp() of it is zero in double precision, its gradient is finite."""

_HALF_LOG_2PI = 0.9189385332046727


def log_transition(
    log_a: Float[Array, ""], log_b: Float[Array, ""], dt: Float[Array, "*steps"]
) -> Float[Array, "*steps 2 2"]:
    """Logarithm of expm(G dt) in closed form; ``[..., i, j] = log Pr(next = j | now = i)``, rows sum to one.

    Parameters
    ----------
    log_a, log_b : float
        Logarithms of the rates LOS to NLOS and NLOS to LOS, 1/s.
    dt : array
        Intervals, s, positive.
    """
    log_sum = jnp.logaddexp(log_a, log_b)
    change = jnp.log(-jnp.expm1(-jnp.exp(log_sum) * dt))  # log(1 - exp(-(a+b) dt))
    keep = -jnp.exp(log_sum) * dt
    log_pi0, log_pi1 = log_b - log_sum, log_a - log_sum  # stationary law
    p01, p10 = log_pi1 + change, log_pi0 + change
    p00, p11 = jnp.logaddexp(log_pi0, log_pi1 + keep), jnp.logaddexp(log_pi1, log_pi0 + keep)
    return jnp.stack([jnp.stack([p00, p01], -1), jnp.stack([p10, p11], -1)], -2)


def log_start(theta: Float[Array, "10"], *, stationary: bool) -> Float[Array, "2"]:
    """Logarithm of the law of the sight at the first time: stationary, or from the parameter ``theta[9]``."""
    if stationary:
        log_sum = jnp.logaddexp(theta[4], theta[5])
        return jnp.stack([theta[5] - log_sum, theta[4] - log_sum])
    return jnp.stack([jax.nn.log_sigmoid(-theta[9]), jax.nn.log_sigmoid(theta[9])])


def _log_normal(e, mean, log_std):
    u = (e - mean) * jnp.exp(-log_std)
    return -0.5 * u * u - log_std - _HALF_LOG_2PI


def log_emission(
    theta: Float[Array, "10"], e: Float[Array, "steps"], label: Int[Array, "steps"], *, outliers: bool
) -> Float[Array, "steps 2"]:
    """Log density of e_n in both sights; zero where ``e`` is NaN; a label (0, 1; -1 unknown) rules out the other."""
    there = jnp.isfinite(e)
    e = jnp.where(there, e, theta[0])
    b = jnp.stack([_log_normal(e, theta[0], theta[1]), _log_normal(e, theta[2], theta[3])], -1)
    if outliers:
        wide = jax.nn.log_sigmoid(theta[6]) + _log_normal(e, theta[7], theta[8])
        b = jnp.logaddexp(jax.nn.log_sigmoid(-theta[6]) + b, wide[:, None])
    b = jnp.where(there[:, None], b, 0.0)
    ruled_out = (label[:, None] >= 0) & (label[:, None] != jnp.arange(2))
    return jnp.where(ruled_out, FORBIDDEN, b)


def forward(
    log_pi: Float[Array, "2"], log_p: Float[Array, "steps 2 2"], log_b: Float[Array, "steps 2"], valid
) -> Float[Array, "steps 2"]:
    """Forward variables ``log p(e_1..e_n, r_n)``; ``log_p[0]`` is not used; where not ``valid`` (padding) they stay."""

    def step(alpha, inputs):
        p, b, ok = inputs
        new = b + jnp.logaddexp(alpha[0] + p[0], alpha[1] + p[1])
        alpha = jnp.where(ok, new, alpha)
        return alpha, alpha

    alpha = log_pi + log_b[0]
    _, rest = jax.lax.scan(step, alpha, (log_p[1:], log_b[1:], valid[1:]), unroll=1)
    return jnp.concatenate([alpha[None], rest])


def _pieces(theta, t, e, label, stationary, outliers):
    valid = jnp.isfinite(t)
    dt = jnp.concatenate([jnp.ones(1, t.dtype), jnp.diff(t)])
    log_p = log_transition(theta[4], theta[5], jnp.where(jnp.isfinite(dt), dt, 1.0))
    return (
        log_start(theta, stationary=stationary),
        log_p,
        log_emission(theta, e, label, outliers=outliers),
        valid,
    )


def log_likelihood(
    theta: Float[Array, "10"],
    t: Float[Array, "steps"],
    e: Float[Array, "steps"],
    label: Int[Array, "steps"],
    *,
    stationary: bool,
    outliers: bool,
) -> Float[Array, ""]:
    """Log density of all errors of one sequence.

    Parameters
    ----------
    theta : array [10]
        See `NAMES`; logarithms of 1/s and m.
    t : array [steps]
        Times, s, increasing; NaN at the end is padding.
    e : array [steps]
        Range errors, m; NaN is a missing range.
    label : int array [steps]
        0 or 1 where the sight is known, -1 elsewhere.
    """
    alpha = forward(*_pieces(theta, t, e, label, stationary, outliers))[-1]
    return jnp.logaddexp(alpha[0], alpha[1])


def smooth(theta, t, e, label, *, stationary: bool, outliers: bool) -> tuple[Array, Array]:
    """Posterior of the sight and one-step prediction of the errors, for one sequence.

    Returns
    -------
    posterior : array [steps, 2]
        Pr(r_n = r | e_1..e_K): the derivative of the log likelihood by each log emission, so that no second recursion
        is needed.
    score : array [steps]
        Normal scores of the one-step prediction, Phi^-1(Pr(e_n' <= e_n | e_1..e_{n-1})): white and standard normal if
        the law is true; NaN where missing.  Computed from the nearer tail, so that outliers stay finite.
    """
    log_pi, log_p, log_b, valid = _pieces(theta, t, e, label, stationary, outliers)

    def value(log_b):
        alpha = forward(log_pi, log_p, log_b, valid)
        return jnp.logaddexp(alpha[-1, 0], alpha[-1, 1]), alpha

    posterior, alpha = jax.grad(value, has_aux=True)(log_b)
    ahead = jnp.logaddexp(alpha[:-1, 0, None] + log_p[1:, 0], alpha[:-1, 1, None] + log_p[1:, 1])
    ahead = jnp.concatenate([log_pi[None], ahead])
    ahead = ahead - jnp.logaddexp(ahead[:, :1], ahead[:, 1:])

    def tail(sign):
        u = jnp.stack([(e - theta[0]) * jnp.exp(-theta[1]), (e - theta[2]) * jnp.exp(-theta[3])], -1)
        log_f = log_ndtr(sign * u)
        if outliers:
            wide = jax.nn.log_sigmoid(theta[6]) + log_ndtr(sign * (e - theta[7]) * jnp.exp(-theta[8]))
            log_f = jnp.logaddexp(jax.nn.log_sigmoid(-theta[6]) + log_f, wide[:, None])
        f = ahead + log_f
        return jnp.exp(jnp.logaddexp(f[:, 0], f[:, 1]))

    low, high = tail(1.0), tail(-1.0)
    ndtri = jax.scipy.special.ndtri
    return posterior, jnp.where(low < high, ndtri(low), -ndtri(high))
