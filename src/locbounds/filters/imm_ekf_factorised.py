"""IMM-EKF factorised over links: cost linear in the number of links."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from locbounds.axes import Array
from locbounds.filters.estimates import Estimates
from locbounds.filters.lowering import Model, check_measurements, estimates, lower, transition_pattern
from locbounds.filters.over_tracks import over_tracks
from locbounds.filters.range_update import correct, corrected, direction, no_correction, relative_weights
from locbounds.filters.tracks_last import (
    Pattern,
    Symmetric,
    Vector,
    apply,
    congruence,
    dense,
    dot,
    entry,
    materialise,
    symmetric,
    times,
    upper,
)
from locbounds.precision import double_precision
from locbounds.scenario import Scenario

TINY = 1e-290  # a mode less likely than this has no mean

# C stands for the transport x -> x - C x_position, stored as [state][space] arrays.
Transport = list


def transported(C: Transport, s: Vector, D: Symmetric) -> tuple[Vector, Symmetric]:
    """A mean offset and a covariance offset under ``B = I - C [I 0]``: ``B s`` and ``B D B^T``."""
    n, dim = len(s), len(C[0])
    position = [entry(D, i, j) for i, j in upper(dim)]
    D_pp = dict(zip(upper(dim), position, strict=True))
    CD = [[dot(C[i], [entry(D, a, j) for a in range(dim)]) for j in range(n)] for i in range(n)]
    CDC = {(i, j): dot(times(D_pp, C[i]), C[j]) for i, j in D}
    return (
        [s[i] - dot(C[i], s[:dim]) for i in range(n)],
        {(i, j): D[i, j] - CD[i][j] - CD[j][i] + CDC[i, j] for i, j in D},
    )


def imm_ekf_factorised(model: Model, z: Array, *, kinds: Pattern, covariance: bool) -> tuple[Array, Array | None]:
    r"""Interacting multiple model filter with one chain per link, and the mode-conditioned moments as main effects.

    **The approximation.** The joint filter keeps one probability, mean and covariance for each of the modes^links joint
    modes r = (r_1, ..., r_n). Here the links' modes are independent given the measurements, and means and covariances
    are sums of main effects,

        Pr(r) = prod_l w_l(r_l),   mean(r) = m + sum_l s_l(r_l),   covariance(r) = P~ + sum_l D~_l(r_l),

    with effects of mean zero, ``sum_j w_l(j) s_l(j) = 0``. What is stored is the overall mean m and covariance P and,
    per link and mode, ``s_l(j) = E[x | r_l = j] - m`` and ``D_l(j) = Cov[x | r_l = j] - P``. Mixing and prediction keep
    this form exactly. The update takes the links one after the other. For link l it is the joint filter's: per mode an
    EKF update of N(m + s_l(j), P + D_l(j)), then the moments of the mixture; its result is the new m and P. It leaves
    the form only in what it does to the *other* links, where

    - range l does not change their mode probabilities (in the joint filter it does, through the means), and
    - their s and D undergo one linear map ``A = I - k u^T`` common to all modes, the Kalman correction with the gain
      k that takes the variance of P along the range's direction u to its new value (and with k = 0 where the update
      makes that variance larger).

    For one link nothing is approximated: the filter is then the joint one.

    **Linear cost.** Applying every link's A to every other link would be quadratic. As in a product of matrices with
    one left out, a forward pass over the links carries the product of the maps so far, and a backward pass that of
    the remaining ones.

    Parameters and returns are those of :func:`locbounds.filters.imm_ekf.imm_ekf`.
    """
    _, modes, _ = model.means.shape
    dim, n, tracks = model.anchors.shape[1], len(model.m0), z.shape[-1]
    # [links, components, modes, 1]
    noises = tuple(
        jnp.moveaxis(jnp.asarray(a), -1, 1)[..., None] for a in (model.weights, model.means, model.variances)
    )

    def over_modes(values: Array) -> Array:
        return sum(values[j] for j in range(modes))  # pyright: ignore[reportReturnType]

    def no_transport() -> Transport:
        return [[jnp.zeros(tracks)] * dim for _ in range(n)]

    def forward(carry: Any, piece: Any) -> Any:
        m, P, C = carry
        w, s, D, anchor, z, noise = piece  # w [modes, tracks]
        s, D = transported(C, s, D)
        x = [a + b for a, b in zip(m, s, strict=True)]
        P_j = {pair: P[pair] + D[pair] for pair in P}
        x, P_j = materialise((x, P_j))
        P_pp = {pair: P_j[pair] for pair in upper(dim)}
        correction = correct(no_correction(x[0], dim), P_pp, direction(x[:dim], anchor), z, noise)
        mu = materialise(relative_weights(w, correction))
        mu = materialise(mu / over_modes(mu))
        x, P_j = materialise(corrected(x, P_j, correction))

        m_new = materialise([over_modes(mu * a) for a in x])
        s = materialise([a - b for a, b in zip(x, m_new, strict=True)])
        P_new = materialise({(i, j): over_modes(mu * (P_j[i, j] + s[i] * s[j])) for i, j in P})
        D = {pair: P_j[pair] - P_new[pair] for pair in P}

        _, u = direction(m[:dim], anchor)
        gain = [dot([entry(P, i, a) for a in range(dim)], u) for i in range(n)]
        before = dot(gain[:dim], u)
        after = dot(times({pair: P_new[pair] for pair in upper(dim)}, u), u)
        useful = jnp.isfinite(z) & (before > after)
        kappa = jnp.where(useful, (before - after) / jnp.where(useful, before, 1.0) ** 2, 0.0)
        k = [g * kappa for g in gain]
        u, k = materialise((u, k))
        # (I - k u^T)(I - C [I 0]) = I - (C + k (u^T - u^T C_p)) [I 0]
        rest = [u[a] - dot(u, [C[b][a] for b in range(dim)]) for a in range(dim)]
        C = [[C[i][a] + k[i] * rest[a] for a in range(dim)] for i in range(n)]
        return materialise((m_new, P_new, C)), materialise((mu, s, D, k, u))

    def backward(C: Transport, piece: Any) -> Any:
        s, D, k, u = piece
        moved = transported(C, s, D)
        # (I - C [I 0])(I - k u^T) = I - (C + (k - C k_p) u^T) [I 0]
        rest = [k[i] - dot(C[i], k[:dim]) for i in range(n)]
        C = [[C[i][a] + rest[i] * u[a] for a in range(dim)] for i in range(n)]
        return materialise(C), materialise(moved)

    def step(carry: Any, piece: Any) -> Any:
        m, P, w, s, D = carry  # w [links, modes, tracks]; s, D lists of such
        F, Q, T, z = piece

        def mix(values: Array) -> Array:
            return sum(T[:, i, :, None] * values[:, i : i + 1] for i in range(modes))  # pyright: ignore[reportReturnType]

        c = mix(w)
        inverse = materialise(jnp.where(c > TINY, 1.0 / jnp.where(c > TINY, c, 1.0), 0.0))
        S1 = materialise([mix(w * a) * inverse for a in s])
        D = {(i, j): mix(w * (D[i, j] + s[i] * s[j])) * inverse - S1[i] * S1[j] for i, j in D}
        s, D = apply(F, kinds, S1), congruence(F, kinds, D)
        m, P = apply(F, kinds, m), congruence(F, kinds, P)
        P = {(i, j): P[i, j] + Q[i, j] for i, j in P}
        m, P, c, s, D = materialise((m, P, c, s, D))

        links = c, s, D, jnp.asarray(model.anchors), z, noises
        (m, P, _), (w, s, D, k, u) = jax.lax.scan(forward, (m, P, no_transport()), links)
        _, (s, D) = jax.lax.scan(backward, no_transport(), (s, D, k, u), reverse=True)
        return (m, P, w, s, D), (jnp.stack(m), dense(P) if covariance else None)

    P_0 = symmetric(jnp.asarray(model.P0))
    w = jnp.asarray(model.start)[:, :, None] * jnp.ones(tracks)
    zero = jnp.zeros_like(w)
    first = (
        [jnp.broadcast_to(model.m0[i], tracks) for i in range(n)],
        {pair: jnp.broadcast_to(P_0[pair], tracks) for pair in P_0},
        w,
        [zero] * n,
        dict.fromkeys(P_0, zero),
    )
    pieces = model.F, model.Q, jnp.moveaxis(jnp.asarray(model.transitions), 0, 1), z
    return jax.lax.scan(step, first, pieces)[1]


class FactorisedImmEkf(eqx.Module):
    """IMM-EKF with one chain per link: like :class:`ImmEkf`, at a cost that is linear in the number of links.

    Parameters
    ----------
    covariance
        Whether the estimates carry covariances.

    Notes
    -----
    The links' sights are taken as independent given the measurements, and the means and covariances given the joint
    sight as sums of one effect per link; :func:`imm_ekf_factorised` says exactly what that leaves out. For one link it
    is :class:`ImmEkf` itself. The links are processed in the scenario's order, which matters slightly.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> FactorisedImmEkf()(scenario, lb.simulate(scenario, runs=2, seed=0).measurements).mean.shape
    (2, 4, 4)
    """

    covariance: bool = eqx.field(static=True, default=True, kw_only=True)

    id: ClassVar[str] = "imm-ekf-factorised"
    name: ClassVar[str] = "IMM-EKF, factorised"
    sees: ClassVar[frozenset[str]] = frozenset({"ranges"})

    @double_precision
    def __call__(self, scenario: Scenario, z: Array, seed: int = 0) -> Estimates:
        """Filter many tracks.

        Parameters
        ----------
        scenario
            The model.
        z
            Ranges in metres, [runs, steps, links], NaN = missing.
        seed
            Not used: the filter draws nothing.

        Raises
        ------
        InputError
            If shapes do not match or a range is infinite.
        """
        z = check_measurements(scenario, z)
        model = lower(scenario)
        results = over_tracks(
            imm_ekf_factorised,
            model,
            (z,),
            (model.m0, model.P0),
            hypotheses=8 * model.means.shape[1],
            kinds=transition_pattern(model),
            covariance=self.covariance,
        )
        return estimates(scenario, *results)
