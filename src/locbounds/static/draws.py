"""Places of a prior from uniform numbers, for randomised quasi-Monte Carlo."""

from __future__ import annotations

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.priors import GaussianPrior, PositionPrior, PriorMixture, UniformBox, UniformDisc, UniformPolygon


def places(prior: PositionPrior, u: Float[ndarray, "n space"]) -> Float[ndarray, "n space"]:
    """Law of the prior from uniform numbers [n, space] in (0, 1): a smooth map wherever there is one.

    >>> places(UniformBox([0.0, 0.0], [2.0, 4.0]), np.array([[0.5, 0.25]])).tolist()
    [[1.0, 1.0]]
    """
    if isinstance(prior, UniformDisc):
        r, angle = float(prior.radius) * np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
        return np.asarray(prior.center) + np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)
    if isinstance(prior, UniformBox):
        return np.asarray(prior.low) + u * (np.asarray(prior.high) - np.asarray(prior.low))
    if isinstance(prior, GaussianPrior):
        from scipy.special import ndtri

        return np.asarray(prior.mean) + ndtri(u) @ np.linalg.cholesky(np.asarray(prior.covariance)).T
    if isinstance(prior, UniformPolygon):
        a, b, c = np.moveaxis(np.asarray(prior.triangles), 1, 0)
        size = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        k, s = _pick(size / size.sum(), u[:, 0])
        s, t = np.sqrt(s)[:, None], u[:, 1:]
        return a[k] + s * ((b - a)[k] + t * (c - b)[k])
    if isinstance(prior, PriorMixture):
        k, rest = _pick(np.asarray(prior.weights), u[:, 0])
        out = np.empty_like(u)
        for part, law in enumerate(prior.parts):
            mine = k == part
            out[mine] = places(law, np.column_stack([rest[mine], u[mine, 1:]]))
        return out
    return prior.sample(len(u), seed=int(u[0, 0] * 2**31))


def _pick(shares: ndarray, u: ndarray) -> tuple[ndarray, ndarray]:
    """Which part a uniform number falls into, and where in it."""
    ends = np.cumsum(shares)
    k = np.minimum(np.searchsorted(ends, u, side="right"), len(shares) - 1)
    start = ends[k] - shares[k]
    return k, np.clip((u - start) / shares[k], 1e-12, 1 - 1e-12)


def sobol(runs: int, replicates: int, dims: int, seed: int) -> Float[ndarray, "replicates runs dims"]:
    """Scrambled Sobol points: independent replicates of ``runs`` (a power of two) numbers inside (0, 1)."""
    from scipy.stats import qmc

    rng = np.random.default_rng([seed, 0x51A7])
    sets = [qmc.Sobol(dims, rng=child).random(runs) for child in rng.spawn(replicates)]
    return np.clip(np.stack(sets), 1e-12, 1 - 1e-12)
