"""IMM-KF with fixed-interval smoothing of the ranges: it uses the ranges after a step too."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from locbounds.axes import Array
from locbounds.filters.estimates import Estimates
from locbounds.filters.imm_kf import (
    TINY,
    check_scenario,
    moments,
    over_modes,
    place,
    predicted,
    range_filter,
    range_models,
)
from locbounds.filters.lowering import Model, check_measurements, estimates, lower
from locbounds.filters.over_tracks import over_tracks
from locbounds.filters.tracks_last import Symmetric, Vector, materialise
from locbounds.precision import double_precision
from locbounds.scenario import Scenario

CHUNK = 64  # rows per track: all steps of the forward filter are kept


def imm_kf_smoother(model: Model, z: Array, *, weighted: bool, covariance: bool) -> tuple[Array, Array | None]:
    """Smooth each link's ranges forwards and backwards, then locate step by step.

    Forwards, the filter of :func:`locbounds.filters.imm_kf.imm_kf`. Backwards Kim's smoother (1994): from k+1 to k,
    for the modes i at k and j at k+1, with ``G_i = P_i F^T (F P_i F^T + Q)^-1`` of the filtered (x_i, P_i),

        x_ij = x_i + G_i (x_j^s - F x_i),     P_ij = P_i + G_i (P_j^s - F P_i F^T - Q) G_i^T,
        p_ij = mu_j^s mu_i T_ij / sum_i mu_i T_ij,

    then the moments over j for every i. With one mode it is the Rauch-Tung-Striebel smoother. The approximation beyond
    that of the filter: given the mode at k+1, later ranges say nothing more about the mode at k.

    Parameters and returns are those of :func:`locbounds.filters.imm_kf.imm_kf`.
    """
    dim, tracks = model.anchors.shape[1], z.shape[-1]
    anchors = jnp.asarray(model.anchors)
    F, Q, _, _ = range_models(model)
    T = jnp.moveaxis(jnp.asarray(model.transitions), 0, 1)
    filter_step, first = range_filter(model)
    first = jax.tree.map(lambda a: jnp.broadcast_to(a, (*a.shape[:2], tracks)), first)

    def forward(carry: Any, piece: Any) -> Any:
        carry, _ = filter_step(carry, piece)
        return carry, carry

    last, filtered = jax.lax.scan(forward, first, (F, Q, T, z))

    def backward(later: Any, piece: Any) -> Any:
        (mu, x, P), F, Q, T = piece
        smoothed = materialise(_one_back(later, (mu, x, P), F[..., None], Q[..., None], T[..., None]))
        return smoothed, moments(*smoothed)

    earlier = jax.tree.map(lambda a: a[:-1], filtered)
    _, ranges = jax.lax.scan(backward, last, (earlier, F[1:], Q[1:], T[1:]), reverse=True)
    ranges = jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), ranges, moments(*last))

    def locate(position: Any, ranges: Any) -> Any:
        position, velocity, spread = place(position, anchors, ranges, weighted=weighted, covariance=covariance)
        return position, (jnp.stack([*position, *velocity]), spread)

    start = [jnp.broadcast_to(model.m0[i], tracks) for i in range(dim)]
    return jax.lax.scan(locate, start, ranges)[1]


def _one_back(later: Any, now: Any, F: Array, Q: Array, T: Array) -> tuple[Array, Vector, Symmetric]:
    """Smoothed probabilities, means and covariances of every mode at k from those at k+1 and the filtered ones at k."""
    mu_s, x_s, P_s = later
    mu, x, P = now
    modes = range(len(mu))
    x_pred, S = predicted(F, Q, x, P)
    det = S[0, 0] * S[1, 1] - S[0, 1] ** 2
    inverse = jnp.where(det > 0, 1.0 / jnp.where(det > 0, det, 1.0), 0.0)
    full = [[P[0, 0], P[0, 1]], [P[0, 1], P[1, 1]]]
    PF = [[full[a][0] * F[b, 0] + full[a][1] * F[b, 1] for b in range(2)] for a in range(2)]
    G = [
        [(PF[a][0] * S[1, 1] - PF[a][1] * S[0, 1]) * inverse, (PF[a][1] * S[0, 0] - PF[a][0] * S[0, 1]) * inverse]
        for a in range(2)
    ]
    c = [sum(mu[i] * T[:, i, j] for i in modes) for j in modes]
    probabilities, means, covariances = [], [[], []], {pair: [] for pair in P}
    for i in modes:
        p = jnp.stack(
            [jnp.where(c[j] > TINY, mu_s[j] * mu[i] * T[:, i, j] / jnp.maximum(c[j], TINY), 0.0) for j in modes]
        )
        total = over_modes(p)
        share = jnp.where(total > TINY, p / jnp.maximum(total, TINY), 1.0 / len(mu))
        d = [a - b[i] for a, b in zip(x_s, x_pred, strict=True)]  # [modes j, links, tracks]
        g = [[G[a][b][i] for b in range(2)] for a in range(2)]
        x_i = [x[a][i] + g[a][0] * d[0] + g[a][1] * d[1] for a in range(2)]
        D = {pair: P_s[pair] - S[pair][i] for pair in P}
        gD = [[g[a][0] * D[0, b] + g[a][1] * D[min(1, b), max(1, b)] for b in range(2)] for a in range(2)]
        P_i = {(a, b): P[a, b][i] + gD[a][0] * g[b][0] + gD[a][1] * g[b][1] for a, b in P}
        mean, spread = moments(share, x_i, P_i)
        probabilities.append(total)
        for a in range(2):
            means[a].append(mean[a])
        for pair in P:
            covariances[pair].append(spread[pair])
    mu_now = jnp.stack(probabilities)
    return (
        mu_now / over_modes(mu_now),
        [jnp.stack(m) for m in means],
        {pair: jnp.stack(v) for pair, v in covariances.items()},
    )


class ImmKfSmoother(eqx.Module):
    """IMM-KF whose ranges are smoothed over the whole track: every position uses past and future ranges.

    No filtering bound holds for it: it sees what they assume to be unknown, says so, and comparing it with them is
    refused.

    Parameters
    ----------
    weighted, covariance
        As for :class:`ImmKf`.

    Notes
    -----
    Step 0 is the prior's mean and covariance, as for every filter. What :class:`ImmKf` says of itself applies here too.

    References
    ----------
    Liao, Chen, "Robust mobile location estimator with NLOS mitigation using interacting multiple model algorithm", IEEE
    Trans. Wireless Commun., 2006; Kim, "Dynamic linear models with Markov-switching", J. Econometrics, 1994.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> result = lb.evaluate(ImmKfSmoother(), scenario, runs=8)
    >>> result.efficiency(lb.enumer(scenario, samples=1024))
    Traceback (most recent call last):
        ...
    locbounds.errors.RefusedError: IMM-KF smoother sees future-ranges, which Enumer-BCRB assumes to be unknown: ...
    """

    weighted: bool = eqx.field(static=True, default=True, kw_only=True)
    covariance: bool = eqx.field(static=True, default=True, kw_only=True)

    id: ClassVar[str] = "imm-kf-smoother"
    name: ClassVar[str] = "IMM-KF smoother"
    sees: ClassVar[frozenset[str]] = frozenset({"ranges", "future-ranges"})

    @double_precision
    def __call__(self, scenario: Scenario, z: Array, seed: int = 0) -> Estimates:
        """Smooth many tracks.

        Parameters
        ----------
        scenario
            The model; its state must consist of positions and velocities.
        z
            Ranges in metres, [runs, steps, links], NaN = missing.
        seed
            Not used: nothing is drawn.

        Raises
        ------
        InputError
            As for :class:`ImmKf`.
        """
        z = check_measurements(scenario, z)
        check_scenario(self.id, scenario)
        model = lower(scenario)
        results = over_tracks(
            imm_kf_smoother,
            model,
            (z,),
            (model.m0, model.P0),
            hypotheses=CHUNK,
            weighted=self.weighted,
            covariance=self.covariance,
        )
        return estimates(scenario, *results)
