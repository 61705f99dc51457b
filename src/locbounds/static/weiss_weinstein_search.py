"""The supremum of the Weiss-Weinstein bound over test vectors: lengths, a length per axis, many points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.static import weiss_weinstein_kernel as kernel
from locbounds.static.pair_laws import PairLaw
from locbounds.static.support import Support

NODES = 6  # along a side
FEW = 8  # while the scale of many test points is searched
FIRST = np.concatenate([np.geomspace(1e-3, 0.1, 10), np.linspace(0.15, 0.99, 13)])  # lengths, relative to the longest
FIRST_OF_MANY = np.logspace(-2, 0, 9)[:-1]
ZOOMS = 2  # times that a parabola is laid through the largest local maxima
PEAKS = 3  # of them at first, then the largest only
NEARLY = 0.9  # of the largest value so far: what a lower maximum must have to be looked at
LENGTHS = (1.0, 1.7, 2.9, 4.9)  # of many test points, relative to the shortest
TOO_SHORT = 1.6  # a grid that misses the maximum grows by this factor
LADDER = np.array([0.003, 0.01, 0.03, 0.1, 0.22, 0.4, 0.65])  # lengths per axis, relative to the longest
FORMS = {"support": kernel.grams, "printed": kernel.printed}


class Swept(NamedTuple):
    """A sweep of lengths, one row per noise level.

    Attributes
    ----------
    lengths_m : array [lengths]
    mse_m2 : array [scales, lengths]
        The bound at each length.
    """

    lengths_m: Float[ndarray, " lengths"]
    mse_m2: Float[ndarray, "scales lengths"]


class Best(NamedTuple):
    """The largest bound found at one noise level.

    Attributes
    ----------
    matrix : array [space, space]
        Bound on the mean square error matrix, on nodes that the search has not seen, m^2.
    tests : array [space, points]
        Its test vectors, m.
    error : float
        Relative change of the root mean square error from the last nodes to the fresh ones.
    """

    matrix: Float[ndarray, "space space"]
    tests: Float[ndarray, "space points"]
    error: float


def sweep(
    values: Callable[[ndarray], ndarray], lengths: ndarray, longest: float, shortest: float, zooms: int, *, whole: bool
) -> Swept:
    """Evaluate lengths, go on where the largest value is at an end, then look closer at the largest local maxima.

    Parameters
    ----------
    values
        ``lengths -> [scales, lengths]``.
    longest, shortest
        Where going on ends, m.
    whole
        The prior is positive everywhere: towards short lengths the bound may level off at its limit.

    Examples
    --------
    >>> def hill(h):
    ...     return np.exp(-np.log(h / 2.0)[None] ** 2)
    >>> found = sweep(hill, np.array([0.1, 0.2]), 10.0, 1e-6, 4, whole=False)
    >>> bool(abs(found.lengths_m[found.mse_m2[0].argmax()] - 2.0) < 1e-3)
    True
    """
    h = np.unique(lengths)
    mse = values(h)
    for _ in range(60):
        more = _beyond(h, mse, longest, shortest, whole)
        if not len(more):
            break
        h, mse = _merge(h, mse, more, values(more))
    for zoom in range(zooms):
        closer = np.unique(np.concatenate([_closer(h, row, zoom) for row in mse]))
        closer = closer[~np.isin(closer, h)]
        if len(closer):
            h, mse = _merge(h, mse, closer, values(closer))
    return Swept(h, mse)


def _beyond(h: ndarray, mse: ndarray, longest: float, shortest: float, whole: bool) -> ndarray:
    """Lengths to add where the best one is at an end of the sweep."""
    at = mse.argmax(1)
    steps = TOO_SHORT ** np.arange(1, 4)
    more = []
    if np.any(at == len(h) - 1) and h[-1] < 0.999 * longest:
        more.append(np.minimum(h[-1] * steps, 0.9999 * longest))
    if np.any(at == 0) and h[0] > shortest:
        flat = whole and np.all(mse[at == 0, 0] <= mse[at == 0, min(1, len(h) - 1)] * (1 + 1e-7))
        if not flat:
            more.append(h[0] / steps)
    return np.unique(np.concatenate(more)) if more else np.zeros(0)


def shortest(support: Support) -> float:
    """Where sweeps of lengths end: with an edge the largest value may be at very short ones."""
    return (1e-3 if support.whole else 1e-9) * float(np.sqrt(np.linalg.eigvalsh(support.covariance)[0]))


def longest(support: Support, pattern: ndarray) -> float:
    """Length beyond which no test vector has any overlap."""
    size = np.linalg.norm(pattern, axis=0)
    reach = [support.reach(u / s) / s for u, s in zip(pattern.T, size, strict=True)]
    return max(reach) * (1 - 1e-9)


def equal_lengths(
    support: Support, law: PairLaw, scales: Sequence[float], *, form: str = "support", n: int = NODES,
    lengths: ndarray | None = None,
) -> tuple[list[Best], Swept]:  # fmt: skip
    """Supremum over the length h of the test vectors ``h I``, for several noise levels.

    Parameters
    ----------
    form
        ``"support"``, or ``"printed"`` for the chapter's (18).
    lengths
        Swept beside those that are always swept, m.
    """
    pattern = np.eye(support.space)
    grams = FORMS[form]
    top = longest(support, pattern)
    coarse = max(3, 2 * n // 3)  # to search on

    def values(h: ndarray) -> ndarray:
        found = grams(support, law, [k * pattern for k in h], coarse, scales)
        each = [kernel.bound_matrices(k * pattern, gram) for k, gram in zip(h, found, strict=True)]
        return np.trace(np.stack(each, 1), axis1=2, axis2=3)

    zooms = ZOOMS if len(scales) > 1 else 2 * ZOOMS
    swept = sweep(values, _with(lengths, top * FIRST), top, shortest(support), zooms, whole=support.whole)
    tops = swept.lengths_m[swept.mse_m2.argmax(1)]
    once = np.unique(tops)
    each, finer = (grams(support, law, [k * pattern for k in once], m, scales) for m in (n, n + n // 2 + 1))
    best = []
    for s, h in enumerate(tops):
        k = int(np.searchsorted(once, h))
        before, matrix = (kernel.bound_matrices(h * pattern, found[k])[s] for found in (each, finer))
        best.append(Best(matrix, h * pattern, relative_change(before, matrix)))
    return best, swept


def _with(lengths: ndarray | None, always: ndarray) -> ndarray:
    return always if lengths is None else np.concatenate([lengths, always])


def relative_change(before: ndarray, after: ndarray) -> float:
    """Of the root mean square error of two bound matrices; zero if both vanish."""
    if np.trace(after) <= 0:
        return 0.0
    return float(abs(np.sqrt(np.trace(after) / max(np.trace(before), 1e-300)) - 1))


def _merge(h: ndarray, mse: ndarray, more: ndarray, values: ndarray) -> tuple[ndarray, ndarray]:
    every = np.concatenate([h, more])
    order = np.argsort(every)
    return every[order], np.concatenate([mse, values], axis=1)[:, order]


def _closer(h: ndarray, row: ndarray, zoom: int) -> ndarray:
    """Where parabolas through the largest local maxima and their neighbours are largest."""
    inner = np.flatnonzero((row >= np.r_[-np.inf, row[:-1]]) & (row >= np.r_[row[1:], -np.inf]))
    inner = inner[(inner > 0) & (inner < len(h) - 1)]
    peaks = inner[np.argsort(-row[inner])][: PEAKS if zoom == 0 else 1]
    peaks = peaks[row[peaks] >= NEARLY * row.max()]
    found = []
    for k in peaks:
        x, y = np.log(h[k - 1 : k + 2]), row[k - 1 : k + 2]
        left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
        if left <= right:  # flat
            continue
        top = 0.5 * (x[0] + x[1]) + left * 0.5 * (x[2] - x[0]) / (left - right)
        if min(abs(top - x)) > 1e-4 * (x[2] - x[0]):
            found.append(float(np.exp(np.clip(top, x[0], x[2]))))
    return np.array(found)


def fan(space: int, directions: int) -> Float[ndarray, "space directions"]:
    """Unit vectors spread over half of all directions (a vector and its opposite tell the same).

    >>> fan(2, 2).round(12).T.tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    if space == 1:
        return np.ones((1, 1))
    if space == 2:
        angle = np.pi * np.arange(directions) / directions
        return np.stack([np.cos(angle), np.sin(angle)])
    k = np.arange(directions)
    z = (k + 0.5) / directions
    angle = np.pi * (1 + np.sqrt(5)) * k
    return np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])


def many_points(
    support: Support, law: PairLaw, count: int, form: str, n: int, lengths: ndarray | None
) -> tuple[Best, Swept]:
    """So many test points: directions times four lengths, whose common scale is searched on few nodes."""
    each = len(LENGTHS) if count >= len(LENGTHS) * support.space else 1
    directions = fan(support.space, -(-count // each))
    pattern = np.concatenate([h * directions for h in LENGTHS[:each]], axis=1)[:, :count]
    grams = FORMS[form]

    def values(lengths: ndarray) -> ndarray:
        found = [kernel.bound_matrices(k * pattern, grams(support, law, [k * pattern], FEW, [1.0])[0]) for k in lengths]
        return np.trace(np.stack(found, 1), axis1=2, axis2=3)

    top = longest(support, pattern)
    h = _with(lengths, top * FIRST_OF_MANY)
    swept = sweep(values, h, top, shortest(support), ZOOMS, whole=support.whole)
    return at_vectors(support, law, swept.lengths_m[swept.mse_m2[0].argmax()] * pattern, form, n), swept


def at_vectors(support: Support, law: PairLaw, H: ndarray, form: str, n: int) -> Best:
    """The bound of given test vectors, on two sets of nodes."""
    grams = FORMS[form]
    coarse, fine = (kernel.bound_matrices(H, grams(support, law, [H], k, [1.0])[0])[0] for k in (n, n + n // 2 + 1))
    return Best(fine, H, relative_change(coarse, fine))


def diagonal(support: Support, law: PairLaw, start: Best, form: str, n: int) -> Best:
    """A length per axis: a coarse grid over all of them, then a simplex search."""
    from scipy.optimize import minimize

    grams = FORMS[form]
    reach = np.array([support.reach(a) for a in np.eye(support.space)]) * (1 - 1e-9)

    def loss(logs: ndarray) -> float:
        H = np.diag(np.minimum(np.exp(logs), reach))
        return -float(np.trace(kernel.bound_matrices(H, grams(support, law, [H], n, [1.0])[0])[0]))

    grid = np.stack(np.meshgrid(*[LADDER] * support.space, indexing="ij"), -1).reshape(-1, support.space)
    starts = [np.log(np.diagonal(start.tests)), *np.log(grid * reach)]
    losses = [loss(x) for x in starts]
    found = [
        minimize(loss, starts[k], method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-7, "maxfev": 120})
        for k in np.argsort(losses)[:2]
    ]
    top = min(found, key=lambda f: f.fun)
    return at_vectors(support, law, np.diag(np.minimum(np.exp(top.x), reach)), form, n)
