"""Motion and prior from true positions along tracks.

The intensity of a constant-velocity model by maximum likelihood: a Kalman filter per axis whose start is exactly
diffuse (the first two positions give the state and its covariance), at the tracks' own irregular times.

References
----------
Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, sections 6.2.2 (the
model) and 5.5.3 (two-point initiation).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from locbounds.axes import Array, Float, ndarray
from locbounds.errors import InputError
from locbounds.precision import double_precision

STRAIGHT = 0.9
"""Share of steps on a straight line at constant speed from which the truth is reported as interpolated."""


@dataclass(frozen=True)
class MotionFit:
    """Fitted intensity of the constant-velocity model.

    Attributes
    ----------
    psd_m2_s3 : float
        Power spectral density of the white acceleration, m^2/s^3, the same on all axes.
    stderr : float
        Its standard error, from the scores of the tracks (robust to a wrong model); NaN with one track.
    truth_std_m, truth_std_stderr : float
        Deviation of the true positions from the model's path, independent from one to the next, m, and its standard
        error (NaN if given).
    straight_share : float
        Share of steps at which the velocity of the truth does not change within twice that deviation.
    tracks, steps : int
        What was fitted to.
    notes : tuple of str
    """

    psd_m2_s3: float
    stderr: float
    truth_std_m: float
    truth_std_stderr: float
    straight_share: float
    tracks: int
    steps: int
    notes: tuple[str, ...] = ()


def _log_likelihood(theta: Float[Array, "2"], t: Float[Array, "n"], x: Float[Array, "n space"]) -> Float[Array, ""]:
    """Log density of positions x_2.. at times t given x_0, x_1; theta = log (q, r^2); NaN times are padding."""
    q, r2 = jnp.exp(theta)
    dt = jnp.diff(t)
    ok = jnp.isfinite(dt)
    dt, x = jnp.where(ok, dt, 1.0), jnp.where(jnp.isfinite(x), x, 0.0)
    # Position and velocity at x_1 from a flat start: v = (x_1 - x_0)/dt, whose error is also the process noise's.
    p, v = x[1], (x[1] - x[0]) / dt[0]
    start = (p, v, r2, r2 / dt[0], 2 * r2 / dt[0] ** 2 + q * dt[0] / 3)

    def step(carry, inputs):
        p, v, pp, pv, vv = carry
        dt, z, ok = inputs
        m = p + dt * v
        a = pp + 2 * dt * pv + dt**2 * vv + q * dt**3 / 3
        b = pv + dt * vv + q * dt**2 / 2
        c = vv + q * dt
        s = a + r2
        y = z - m
        new = (m + a / s * y, v + b / s * y, a * r2 / s, b * r2 / s, c - b * b / s)
        gain = -0.5 * jnp.sum(y**2 / s + jnp.log(2 * jnp.pi * s))
        return jax.tree.map(lambda n, o: jnp.where(ok, n, o), new, carry), jnp.where(ok, gain, 0.0)

    _, gains = jax.lax.scan(step, start, (dt[1:], x[2:], ok[1:]))
    return gains.sum()


@cache
def _kernel():
    return jax.jit(jax.vmap(jax.value_and_grad(_log_likelihood), (None, 0, 0)))


@cache
def _values():
    return jax.jit(jax.vmap(jax.vmap(_log_likelihood, (None, 0, 0)), (0, None, None)))


@double_precision
def fit_psd(times_s, positions_m, *, truth_std_m: float | None = None) -> MotionFit:
    """Intensity of the constant-velocity model by maximum likelihood, pooled over tracks and axes.

    Parameters
    ----------
    times_s : sequence of arrays [n]
        Times of each track, s, increasing.
    positions_m : sequence of arrays [n, space]
        True positions, m.
    truth_std_m : float, optional
        Deviation of the true positions, independent from one to the next, m; zero is allowed.  Default: estimated
        too.  It matters: jitter of the truth that is taken for motion makes the intensity far too large.

    Returns
    -------
    MotionFit

    Raises
    ------
    InputError
        No track with three positions, or a truth without any change of velocity.

    Notes
    -----
    A truth interpolated between corner points has no acceleration but at the corners; the estimate is then about the
    mean squared change of velocity per second, right for the covariance over a whole leg, too large within one and
    too small at a corner.

    Examples
    --------
    White acceleration of 0.01 m^2/s^3, by its exact integral over steps of one second:

    >>> rng = np.random.default_rng(0)
    >>> a = rng.multivariate_normal([0, 0], 0.01 * np.array([[1 / 3, 1 / 2], [1 / 2, 1]]), size=(4000, 2))
    >>> v = np.cumsum(a[..., 1], 0) - a[..., 1]
    >>> x = np.cumsum(v + a[..., 0], 0)
    >>> round(fit_psd([np.arange(4000.0)], [x], truth_std_m=0.0).psd_m2_s3, 3)
    0.010
    """
    pairs = [(np.asarray(t, float), np.asarray(x, float)) for t, x in zip(times_s, positions_m, strict=True)]
    pairs = [(t, x) for t, x in pairs if len(t) >= 3]
    if not pairs:
        raise InputError(
            "no track has three true positions: motion.psd_m2_s3 cannot be estimated", "Give a value for it"
        )
    if truth_std_m is not None and not (np.isfinite(truth_std_m) and truth_std_m >= 0):
        raise InputError(f"truth_std_m is {truth_std_m}", "Give the deviation of the true positions in metres")
    t, x, bend, span = _pad(pairs)
    moment = float((bend**2).sum() / x.shape[-1] / span.sum())  # mean squared change of velocity per second, per axis
    if not moment > 0:
        raise InputError("the true velocity never changes: motion.psd_m2_s3 cannot be estimated", "Give a value for it")
    arrays, kernel = (jnp.asarray(t), jnp.asarray(x)), _kernel()

    def at(theta):
        value, score = kernel(jnp.asarray(theta), *arrays)
        return np.asarray(value), np.asarray(score)

    low, high = np.log(moment) - 25.0, np.log(moment) + 3.0
    if truth_std_m is None:
        jitter = 2 * np.log(np.sqrt(np.median((bend * span) ** 2)) + 1e-12)  # if all of it were the truth's
        jitters = np.linspace(jitter - 12, jitter + 3, 11)
        free = np.array([True, True])
    else:
        with np.errstate(divide="ignore"):
            jitters = 2 * np.log(np.array([truth_std_m]))
        free = np.array([True, False])
    starts = np.array([[q, r] for r in jitters for q in np.linspace(low, high, 15)])
    start = starts[int(np.argmax(np.asarray(_values()(jnp.asarray(starts), *arrays)).sum(1)))]

    def whole(free_part):
        theta = start.copy()
        theta[free] = free_part
        return theta

    def cost(free_part):
        value, score = at(whole(free_part))
        return -value.sum(), -score.sum(0)[free]

    box = [(low - 5, high), (jitters[0] - 5, jitters[-1] + 5)][: free.sum()]
    found = minimize(cost, start[free], jac=True, method="L-BFGS-B", bounds=box, options={"ftol": 1e-13})
    theta = whole(found.x)
    if theta[0] < low:
        raise InputError(
            "the true velocity does not change by more than the error of the truth explains: motion.psd_m2_s3 "
            "cannot be estimated",
            "Give a value for it",
        )
    stderr = _stderr(at, theta, free)
    q, r = np.exp(theta[0]), np.exp(theta[1] / 2)
    straight = float(np.mean(bend * span <= 2 * r))
    notes = []
    if straight > STRAIGHT:
        notes.append(
            f"The truth runs straight at constant speed in {straight:.0%} of its steps (within {2 * r:.2g} m), as if "
            "interpolated between corner points: the intensity measures the corners, and the real walk may be livelier."
        )
    return MotionFit(
        psd_m2_s3=float(q),
        stderr=float(q * stderr[0]),
        truth_std_m=float(r),
        truth_std_stderr=float(r / 2 * stderr[1]) if truth_std_m is None else float("nan"),
        straight_share=straight,
        tracks=len(pairs),
        steps=int(sum(len(t) - 1 for t, _ in pairs)),
        notes=tuple(notes),
    )


def _pad(pairs):
    """Padded times and positions; at every inner step the change of velocity and the time it took."""
    n, dim = max(len(t) for t, _ in pairs), pairs[0][1].shape[1]
    t, x = np.full((len(pairs), n), np.nan), np.full((len(pairs), n, dim), np.nan)
    bend, span = [], []
    for i, (ti, xi) in enumerate(pairs):
        t[i, : len(ti)], x[i, : len(ti)] = ti - ti[0], xi - xi[0]
        dt = np.diff(ti)
        bend.append(np.linalg.norm(np.diff(np.diff(xi, axis=0) / dt[:, None], axis=0), axis=1))
        span.append((dt[1:] + dt[:-1]) / 2)
    return t, x, np.concatenate(bend), np.concatenate(span)


def _stderr(at, theta, free) -> Float[ndarray, "2"]:
    """Standard errors of the free parameters from the scores of the tracks, as in `maximum.covariances`."""
    where, score = np.flatnonzero(free), at(theta)[1]
    found = np.full(2, np.nan)
    if len(score) < 2:
        return found
    step = 1e-3 * np.eye(2)[where]
    h = np.stack([at(theta - d)[1].sum(0)[where] - at(theta + d)[1].sum(0)[where] for d in step]) / 2e-3
    inverse = np.linalg.pinv(0.5 * (h + h.T), hermitian=True)
    s = score[:, where]
    found[where] = np.sqrt(np.diag(inverse @ (s.T @ s) @ inverse) * len(s) / (len(s) - 1))
    return found


def prior_from_tracks(
    times_s: Sequence[ndarray], positions_m: Sequence[ndarray], *, where: str = "area", window_s: float = 1.0
) -> tuple[ndarray, ndarray]:
    """Mean and covariance of position and velocity over tracks, as a Gaussian prior of step 0.

    Parameters
    ----------
    times_s, positions_m
        As for `fit_psd`.
    where : {"area", "start"}
        "area": the mobile is somewhere the tracks have been, each moment alike (default: it promises nothing about
        where a new track starts).  "start": it starts where the tracks started, for logs that always begin at the same
        place; needs at least three tracks.
    window_s : float
        Velocities are differences over at least this long, so that jitter of the truth does not enter.

    Returns
    -------
    mean [state], covariance [state, state]
        State order: position, velocity; SI.  Position and velocity are taken as uncorrelated.
    """
    if where not in ("area", "start"):
        raise InputError(f'prior is "{where}"', 'Choose "area" or "start"')
    if where == "start" and len(times_s) < 3:
        raise InputError(
            f"{len(times_s)} tracks do not tell where tracks start: prior.position_m cannot be estimated",
            'Give it, or take "area"',
        )
    places, weights, speeds, spans = [], [], [], []
    for t, x in zip(times_s, positions_m, strict=True):
        t, x = np.asarray(t, float), np.asarray(x, float)
        gap = np.gradient(t)
        places.append(x[:1] if where == "start" else x)
        weights.append(np.ones(1) if where == "start" else gap)
        ahead = np.minimum(np.searchsorted(t, t + window_s), len(t) - 1)
        use = ahead > np.arange(len(t))
        speeds.append(((x[ahead] - x) / np.where(use, t[ahead] - t, 1.0)[:, None])[use])
        spans.append(gap[use])
    dim = places[0].shape[1]
    mean, covariance = np.zeros(2 * dim), np.zeros((2 * dim, 2 * dim))
    for block, values, weight in ((slice(0, dim), places, weights), (slice(dim, None), speeds, spans)):
        v, w = np.concatenate(values), np.concatenate(weight)
        mean[block] = w @ v / w.sum()
        d = v - mean[block]
        covariance[block, block] = (d * w[:, None]).T @ d / w.sum()
    if where == "start":
        covariance[:dim, :dim] *= len(times_s) / (len(times_s) - 1)
    # A straight corridor leaves one direction without spread: keep the covariance positive definite.
    floor = 1e-6 * np.trace(covariance[:dim, :dim]) / dim, 1e-6 * np.trace(covariance[dim:, dim:]) / dim
    return mean, covariance + np.diag(np.repeat(np.maximum(floor, 1e-12), dim))
