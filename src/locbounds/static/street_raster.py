r"""Bounds over streets on a square raster: any region, any path lengths, deviations that differ from place to place.

Links in a city are tables: of path lengths, or of what a ray tracer found. Shifts of a whole number of cells take
cells to cells, so that every integral over the places whose shifted copies are streets too is a sum over pairs of
cells, without a formula for the region (which need not be convex). For a model that is constant on each cell the sums
are exact; for a smooth one they are the midpoint rule, and a raster of twice the step tells its error.

With f uniform on n cells and rho the Bhattacharyya coefficient of two Gaussian laws (of different covariances too),
``T(u, v) = (1/n) sum rho(i + u, i + v)`` over cells i with i, i + u, i + v on the streets gives the Weiss-Weinstein
matrix (static/weiss_weinstein_kernel.py), and ``A(d) = (1/n) sum P(i, i + d)`` over the pairs the Ziv-Zakai bound
``int h max_{x >= h} max_{d: a.d = x} A(d) dh``. P is the least error probability, ``Q(|m_i - m_j| / 2)`` for equal
covariances and its lower bound ``(1 - sqrt(1 - rho^2)) / 2`` otherwise.
"""

from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import Float, Int, ndarray
from locbounds.errors import InputError
from locbounds.propagation.link_table import RASTER

CELLS = 40_000  # more take too long: choose a larger step
FEWEST = 9
CHUNK = 4_000_000  # numbers at once


class StreetRaster(NamedTuple):
    """Cells of streets, and the Gaussian law of the measurements in each.

    Attributes
    ----------
    step_m
        Side of a cell.
    index
        Column and row of every cell, [cells, 2].
    points
        Centres, [cells, 2] in metres.
    mean
        Whitened means [cells, channels] if ``root`` is None, else plain ones.
    covariance
        [cells, channels, channels] where it differs from place to place, else None.

    Examples
    --------
    >>> line = np.stack([np.arange(100) + 0.5, np.full(100, 0.5)], axis=1)
    >>> raster = street_raster(line, line[:, :1], np.array([[25.0]]), step_m=1.0)
    >>> round(float(raster_mmse(raster, draws=2000, seed=0)[0]), 1)
    4.8
    """

    step_m: float
    index: Int[ndarray, "cells 2"]
    points: Float[ndarray, "cells 2"]
    mean: Float[ndarray, "cells channels"]
    covariance: Float[ndarray, "cells channels channels"] | None

    def ids(self) -> Int[ndarray, "columns rows"]:
        """Number of the cell at every column and row, -1 off the streets."""
        table = np.full(self.index.max(axis=0) + 1, -1)
        table[tuple(self.index.T)] = np.arange(len(self.index))
        return table


def street_raster(points: Any, mean: Any, covariance: Any, *, step_m: float) -> StreetRaster:
    """Cells with their measurement laws.

    Parameters
    ----------
    points
        Centres of cells on a raster of ``step_m``, [cells, 2] in metres.
    mean
        Means of the measurements, [cells, channels].
    covariance
        [channels, channels], or one per cell.

    Raises
    ------
    InputError
        If there are fewer than nine or more than 40,000 cells, points are off the raster, or a mean is not finite.

    Examples
    --------
    >>> street_raster([[0.5, 0.5]], [[1.0]], [[1.0]], step_m=1.0)
    Traceback (most recent call last):
    ...
    locbounds.errors.InputError: the streets have 1 cells of 1 m. Choose a larger area or a smaller step
    """
    places, mean = np.asarray(points, dtype=float).reshape(-1, 2), np.asarray(mean, dtype=float)
    n = len(places)
    if not FEWEST <= n <= CELLS:
        remedy = "Choose a larger area or a smaller step" if n < FEWEST else "Choose a larger step"
        raise InputError(f"the streets have {n:,} cells of {step_m:g} m", remedy)
    off = (places - places.min(axis=0)) / step_m
    if np.abs(off - np.round(off)).max() > RASTER:
        raise InputError(f"the points are on no raster of {step_m:g} m", "Give centres of square cells")
    if not np.isfinite(mean).all():
        i = np.argwhere(~np.isfinite(mean))[0][0]
        raise InputError(
            f"the point ({places[i][0]:.1f}, {places[i][1]:.1f}) m has a link without a path",
            "Leave such points out: it lies in a closed courtyard, or the anchor does",
        )
    covariance = np.asarray(covariance, dtype=float)
    if covariance.ndim == 2:
        mean, covariance = mean @ np.linalg.inv(np.linalg.cholesky(covariance)).T, None
    return StreetRaster(float(step_m), np.round(off).astype(int), places, mean, covariance)


def _pairs(ids: ndarray, *shifts: tuple[int, int]) -> list[ndarray]:
    """Numbers of the cells i + shift, for all i for which every one of them is a street."""
    low = np.minimum(0, np.min(shifts, axis=0))
    high = np.array(ids.shape) - np.maximum(0, np.max(shifts, axis=0))
    if (high <= -low).any():
        return [np.zeros(0, int) for _ in shifts]
    parts = [ids[-low[0] + a : high[0] + a, -low[1] + b : high[1] + b].ravel() for a, b in shifts]
    every = np.logical_and.reduce([part >= 0 for part in parts])
    return [part[every] for part in parts]


def _rho(raster: StreetRaster, i: ndarray, j: ndarray) -> ndarray:
    gap = raster.mean[i] - raster.mean[j]
    if raster.covariance is None:
        return np.exp(-np.sum(gap**2, axis=1) / 8)
    one, two = raster.covariance[i], raster.covariance[j]
    middle = (one + two) / 2
    square = np.einsum("na,na->n", gap, np.linalg.solve(middle, gap[..., None])[..., 0])
    logs = [np.linalg.slogdet(c)[1] for c in (middle, one, two)]
    return np.exp(-square / 8 - 0.5 * (logs[0] - 0.5 * (logs[1] + logs[2])))


def _error(raster: StreetRaster, i: ndarray, j: ndarray) -> ndarray:
    if raster.covariance is None:
        from scipy.special import ndtr

        return ndtr(-np.sqrt(np.sum((raster.mean[i] - raster.mean[j]) ** 2, axis=1)) / 2)
    rho = np.minimum(_rho(raster, i, j), 1.0)
    return 0.5 * rho**2 / (1 + np.sqrt(1 - rho**2))


def raster_wwb(raster: StreetRaster) -> tuple[float, Float[ndarray, " 2"]]:
    """Weiss-Weinstein bound with a length along each axis, the largest one found: RMSE in metres, and the lengths.

    Examples
    --------
    >>> line = np.stack([np.arange(100) + 0.5, np.full(100, 0.5)], axis=1)
    >>> rmse, lengths = raster_wwb(street_raster(line, line[:, :1], np.array([[25.0]]), step_m=1.0))
    >>> round(rmse, 1)
    4.8
    """
    ids, n, step = raster.ids(), len(raster.points), raster.step_m

    def term(u: tuple[int, int], v: tuple[int, int]) -> float:
        _, i, j = _pairs(ids, (0, 0), u, v)
        return float(np.sum(_rho(raster, i, j))) / n

    def matrix(a: int, b: int) -> ndarray:
        tests = [t for t in ((a, 0), (0, b)) if t != (0, 0)]
        mu = np.array([term((0, 0), t) for t in tests])
        minus = [(-x, -y) for x, y in tests]
        q = [
            [term(u, v) + term(mu_, mv) - term(u, mv) - term(mu_, v) for v, mv in zip(tests, minus, strict=True)]
            for u, mu_ in zip(tests, minus, strict=True)
        ]
        moved = np.array(tests, dtype=float).T * step * mu
        return moved @ np.linalg.pinv(np.array(q), rcond=1e-11, hermitian=True) @ moved.T

    found: dict[tuple[int, int], float] = {}

    def value(a: int, b: int) -> float:
        if (a, b) not in found:
            found[a, b] = float(np.trace(matrix(a, b)))
        return found[a, b]

    reach = [max(int(k), 1) for k in ids.shape]
    ladders = [np.unique(np.round(np.geomspace(1, max(0.7 * r, 1), 9)).astype(int)) for r in reach]
    best = max(
        ((int(a), int(b)) for a in ladders[0] for b in ladders[1] if ids.shape[0] > 1),
        key=lambda ab: value(*ab),
        default=(1, 1),
    )
    while True:  # climb to a local maximum over whole cells
        around = [(max(best[0] + i, 1), max(best[1] + j, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        top = max(around, key=lambda ab: value(*ab))
        if value(*top) <= value(*best):
            return float(np.sqrt(value(*best))), np.array(best) * step
        best = top


def raster_ezzb(raster: StreetRaster) -> tuple[float, Float[ndarray, " 2"]]:
    """Extended Ziv-Zakai bound, maximised over all shifts, with valley filling: RMSE in metres, and per axis.

    Examples
    --------
    >>> line = np.stack([np.arange(100) + 0.5, np.full(100, 0.5)], axis=1)
    >>> round(raster_ezzb(street_raster(line, line[:, :1], np.array([[25.0]]), step_m=1.0))[0], 1)
    4.8
    """
    ids, n, step = raster.ids(), len(raster.points), raster.step_m
    free = ids >= 0
    size = [2 * k for k in free.shape]
    count = np.fft.irfft2(np.abs(np.fft.rfft2(free.astype(float), size)) ** 2, size)  # pairs of cells per shift
    known: dict[tuple[int, int], float] = {}

    def overlap(a: int, b: int) -> float:
        key = (a, b) if (a, b) > (-a, -b) else (-a, -b)
        if key not in known:
            i, j = _pairs(ids, (0, 0), key)
            known[key] = float(np.sum(_error(raster, i, j))) / n
        return known[key]

    parts = []
    for axis in (0, 1):
        along, across = free.shape[axis], free.shape[1 - axis]
        A = np.zeros(along)
        for h in range(along):
            best = 0.0
            others = np.arange(-across + 1, across)
            most = count[h, others] if axis == 0 else count[others, h]
            for k in np.argsort(-most, kind="stable"):
                if most[k] / (2 * n) <= best + 1e-9:
                    break
                other = int(others[k])
                best = max(best, overlap(h, other) if axis == 0 else overlap(other, h))
            A[h] = best
        filled = np.maximum.accumulate(A[::-1])[::-1]
        parts.append(step**2 * float(np.arange(along) @ filled))
    return float(np.sqrt(sum(parts))), np.sqrt(parts)


def raster_mmse(raster: StreetRaster, *, draws: int = 4000, seed: int = 0) -> tuple[float, float]:
    """The least RMSE of any estimator and its standard error, in metres: posterior over the cells, drawn places.

    The variance of a place within its cell is part of it.

    Examples
    --------
    >>> line = np.stack([np.arange(100) + 0.5, np.full(100, 0.5)], axis=1)
    >>> exact = street_raster(line, line[:, :1], np.array([[1e-6]]), step_m=1.0)
    >>> round(raster_mmse(exact, draws=100)[0] ** 2, 6) == round(1 / 6, 6)  # a cell: 1/12 along each axis
    True
    """
    rng = np.random.default_rng(seed)
    n, channels = raster.mean.shape
    which = rng.integers(0, n, draws)
    noise = rng.normal(size=(draws, channels))
    roots = None if raster.covariance is None else np.linalg.cholesky(raster.covariance)
    z = raster.mean[which] + (noise if roots is None else np.einsum("nab,nb->na", roots[which], noise))
    inverse = None if roots is None else np.linalg.inv(roots)
    half_log = None if roots is None else np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    square = np.empty(draws)
    middle = raster.points.mean(axis=0)
    places = raster.points - middle
    chunk = max(CHUNK // (n * channels), 1)
    for k in range(0, draws, chunk):
        gap = z[k : k + chunk, None] - raster.mean
        if inverse is None:
            log = -0.5 * np.sum(gap**2, axis=2)
        else:
            log = -0.5 * np.sum(np.einsum("nab,knb->kna", inverse, gap) ** 2, axis=2) - half_log
        weight = np.exp(log - log.max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        mean = weight @ places
        square[k : k + chunk] = weight @ np.sum(places**2, axis=1) - np.sum(mean**2, axis=1)
    mse = float(square.mean()) + raster.step_m**2 / 6
    error = float(square.std(ddof=1) / np.sqrt(draws))
    return float(np.sqrt(mse)), error / (2 * float(np.sqrt(mse)))
