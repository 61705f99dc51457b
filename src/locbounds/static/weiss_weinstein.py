"""The Weiss-Weinstein bound of a plan, with its supremum searched globally."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError, RefusedError
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.result import Result
from locbounds.static import weiss_weinstein_kernel as kernel
from locbounds.static.common import check_rtol, static_result, verdict_of
from locbounds.static.pair_laws import GaussianPairs, PairLaw
from locbounds.static.plan_laws import needs_prior, pair_law, support_of
from locbounds.static.support import Support

NODES, MOST_NODES = 10, 160  # along a side
FEW = 8  # while the scale of many test points is searched
GRID = 25  # lengths swept at first
DECADES = 3.0  # over which they reach down from the longest
ZOOMS = 3  # times that a parabola is laid through the largest local maxima
PEAKS = 3  # of them at first, then the largest only
LENGTHS = (1.0, 1.7, 2.9, 4.9)  # of many test points, relative to the shortest
TOO_SHORT = 1.6  # a grid that misses the maximum grows by this factor


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


def equal_lengths(
    support: Support, law: PairLaw, scales: Sequence[float], *, form: str = "support", n: int = NODES,
    lengths: ndarray | None = None, pattern: ndarray | None = None,
) -> tuple[list[Best], Swept]:  # fmt: skip
    """Supremum over the length h of the test vectors ``h * pattern`` (by default h I), for several noise levels.

    Parameters
    ----------
    form
        ``"support"``, or ``"printed"`` for the chapter's (18).
    lengths
        Swept first; where the largest value is at an end, the sweep goes on beyond it.
    pattern
        [space, points].
    """
    pattern = np.eye(support.space) if pattern is None else pattern
    grams = kernel.grams if form == "support" else kernel.printed
    longest = _longest(support, pattern)

    def values(h: ndarray, nodes: int = n) -> ndarray:
        found = grams(support, law, [k * pattern for k in h], nodes, scales)
        each = [kernel.bound_matrices(k * pattern, gram) for k, gram in zip(h, found, strict=True)]
        return np.trace(np.stack(each, 1), axis1=2, axis2=3)

    h = longest * np.logspace(-DECADES, 0, GRID + 1)[:-1] if lengths is None else np.unique(np.asarray(lengths, float))
    mse = values(h)
    for _ in range(60):
        more = _beyond(h, mse, longest, support)
        if not len(more):
            break
        h, mse = _merge(h, mse, more, values(more))
    for zoom in range(ZOOMS):
        closer = np.unique(np.concatenate([_closer(h, row, zoom) for row in mse]))
        closer = closer[~np.isin(closer, h)]
        if len(closer):
            h, mse = _merge(h, mse, closer, values(closer))
    fresh, best = n + n // 2 + 1, []
    tops = h[mse.argmax(1)]
    final = {k: grams(support, law, [k * pattern], fresh, scales)[0] for k in np.unique(tops)}
    for s, top in enumerate(tops):
        matrix = kernel.bound_matrices(top * pattern, final[top])[s]
        before = mse[s].max()
        best.append(Best(matrix, top * pattern, float(abs(np.sqrt(np.trace(matrix) / max(before, 1e-300)) - 1))))
    return best, Swept(h, mse)


def _longest(support: Support, pattern: ndarray) -> float:
    """Length beyond which no test vector has any overlap."""
    size = np.linalg.norm(pattern, axis=0)
    reach = [support.reach(u / s) / s for u, s in zip(pattern.T, size, strict=True)]
    return max(reach) * (1 - 1e-9)


def _beyond(h: ndarray, mse: ndarray, longest: float, support: Support) -> ndarray:
    """Lengths to add where the best one is at an end of the sweep."""
    at = mse.argmax(1)
    steps = TOO_SHORT ** np.arange(1, 4)
    more = []
    if np.any(at == len(h) - 1) and h[-1] < 0.999 * longest:
        more.append(np.minimum(h[-1] * steps, 0.9999 * longest))
    if np.any(at == 0) and h[0] > (1e-3 if support.whole else 1e-9) * np.sqrt(np.linalg.eigvalsh(support.covariance)[0]):
        flat = support.whole and np.all(mse[at == 0, 0] <= mse[at == 0, min(1, len(h) - 1)] * (1 + 1e-7))
        if not flat:
            more.append(h[0] / steps)
    return np.unique(np.concatenate(more)) if more else np.zeros(0)


def _merge(h: ndarray, mse: ndarray, more: ndarray, values: ndarray) -> tuple[ndarray, ndarray]:
    every = np.concatenate([h, more])
    order = np.argsort(every)
    return every[order], np.concatenate([mse, values], axis=1)[:, order]


def _closer(h: ndarray, row: ndarray, zoom: int) -> ndarray:
    """Where parabolas through the largest local maxima and their neighbours are largest."""
    inner = np.flatnonzero((row >= np.r_[-np.inf, row[:-1]]) & (row >= np.r_[row[1:], -np.inf]))
    inner = inner[(inner > 0) & (inner < len(h) - 1)]
    peaks = inner[np.argsort(-row[inner])][: PEAKS if zoom == 0 else 1]
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


@double_precision
def wwb(
    plan: Plan,
    *,
    tests: str | int | Float[ndarray, "space points"] = "equal",
    lengths_m: Sequence[float] | Float[ndarray, " lengths"] | None = None,
    exponent: float = 0.5,
    form: str = "support",
    rtol: float = 1e-3,
) -> Result:
    r"""Weiss-Weinstein bound: no estimator of the position has a smaller mean square error, averaged over the prior.

    Parameters
    ----------
    plan
        With a prior of any kind.
    tests
        Which test vectors: ``"equal"``, one of the same length h along every axis (the chapter's H = h I);
        ``"diagonal"``, with a length per axis; a number of test points, spread over directions and four lengths; or the
        vectors themselves, [space, points] in metres. Lengths of the first three are searched for the largest bound.
    lengths_m
        Lengths to sweep first, in metres; the sweep goes on beyond them where the largest value is at an end.
    exponent
        s between 0 and 1. Other than 1/2 for Gaussian noise only; 1/2 was the best in all settings that we know.
    form
        ``"support"``, or ``"printed"``: equation (18) of the chapter, which is valid but looser where the prior's support
        is not everything.
    rtol
        Largest relative change of the RMSE when the quadrature is refined; the value returned is that of the finer
        nodes, which took no part in the search.

    Returns
    -------
    Result
        ``covariance[0]`` is the bound on the mean square error matrix; ``diagnostics`` hold the test vectors ``tests_m``,
        the sweep ``lengths_m`` and ``swept_mse_m2``, and ``quadrature_error`` (relative). In regular problems the largest
        value may be the limit h -> 0, which is the Bayesian Cramér-Rao bound; ``limit`` says so.

    Raises
    ------
    InputError
        If the plan has no prior, or an option cannot be used.
    RefusedError
        If an exponent other than 1/2 is asked for a noise that is not Gaussian.

    Notes
    -----
    :mod:`locbounds.static.weiss_weinstein_kernel` has the formulas; Weinstein and Weiss 1988, and (13) to (23) of the
    chapter with its expectation restricted to the support of the prior.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], 2.0, prior=lb.UniformDisc([0, 0], 15))
    >>> bound = lb.wwb(plan)
    >>> print(bound)
    WWB: position RMSE 1.843 m; valid (any prior, any measurement)
    >>> bool(lb.wwb(plan, form="printed").position_mse < bound.position_mse)
    True
    """
    prior = needs_prior(plan, "the Weiss-Weinstein bound")
    verdict, rtol = verdict_of("wwb", plan), check_rtol(rtol)
    if form not in ("support", "printed"):
        raise InputError(f"the form is {form!r}", 'Choose "support" or "printed"')
    if not 0 < exponent < 1:
        raise InputError(f"the exponent is {exponent}", "Give a number between 0 and 1, for example 0.5")
    many = not isinstance(tests, str) and (np.ndim(tests) == 0 or np.shape(tests)[-1] > 2 * plan.dim)
    support, law = support_of(prior, None if many else plan.anchors), pair_law(plan)
    name = "WWB as printed" if form == "printed" else None
    fixed = None if isinstance(tests, str | int) else _vectors(tests, plan.dim)
    if exponent != 0.5:
        best, swept = _any_exponent(support, law, exponent, fixed, tests, form, rtol)
    else:
        best, swept = _refined(lambda n: _search(support, law, tests, fixed, form, n, lengths_m), rtol)
    diagnostics = {"tests_m": best.tests, "quadrature_error": best.error, "limit": False}
    if swept is not None:
        diagnostics |= {"lengths_m": swept.lengths_m, "swept_mse_m2": swept.mse_m2[0]}
    matrix, how = best.matrix, f"quadrature over overlaps of the prior's shifted copies, {best.tests.shape[1]} tests"
    limit = _limit(plan) if fixed is None and form == "support" else None
    if limit is not None and np.trace(limit) >= np.trace(matrix):
        matrix, how = limit, "limit of short test vectors: the Bayesian Cramér-Rao bound"
        diagnostics["limit"] = True
    return static_result("wwb", matrix, verdict, how, name=name, diagnostics=diagnostics)


def _refined(search: Callable[[int], tuple[Best, Swept | None]], rtol: float) -> tuple[Best, Swept | None]:
    """Search on more nodes until fresh ones agree."""
    n = NODES
    best, swept = search(n)
    while best.error > rtol and n < MOST_NODES:
        n = n + n // 2
        best, swept = search(n)
    return best, swept


def _search(
    support: Support, law: PairLaw, tests: Any, fixed: ndarray | None, form: str, n: int, lengths: Any
) -> tuple[Best, Swept | None]:
    if fixed is not None:
        return _at(support, law, fixed, form, n), None
    if isinstance(tests, str):
        if tests not in ("equal", "diagonal"):
            raise InputError(f"the tests are {tests!r}", 'Choose "equal", "diagonal", a number, or vectors')
        best, swept = equal_lengths(support, law, [1.0], form=form, n=n, lengths=_lengths(lengths))
        if tests == "diagonal" and support.space > 1:
            return _diagonal(support, law, best[0], form, n), swept
        return best[0], swept
    if tests < support.space:
        raise InputError(f"{tests} test points in {support.space} dimensions", "Give at least one per dimension")
    return _many(support, law, int(tests), form, n, _lengths(lengths))


def _many(
    support: Support, law: PairLaw, count: int, form: str, n: int, lengths: ndarray | None
) -> tuple[Best, Swept | None]:
    """So many test points: directions times four lengths, whose common scale is searched on few nodes."""
    each = len(LENGTHS) if count >= len(LENGTHS) * support.space else 1
    directions = fan(support.space, -(-count // each))
    pattern = np.concatenate([h * directions for h in LENGTHS[:each]], axis=1)[:, :count]
    grams = kernel.grams if form == "support" else kernel.printed

    def values(lengths: ndarray) -> ndarray:
        found = [kernel.bound_matrices(k * pattern, grams(support, law, [k * pattern], FEW, [1.0])[0]) for k in lengths]
        return np.trace(np.stack(found, 1), axis1=2, axis2=3)

    h = _longest(support, pattern) * np.logspace(-2, 0, 9)[:-1] if lengths is None else lengths
    mse = values(h)
    for zoom in range(ZOOMS):
        closer = _closer(h, mse[0], zoom)
        if len(closer):
            h, mse = _merge(h, mse, closer, values(closer))
    return _at(support, law, h[mse[0].argmax()] * pattern, form, n), Swept(h, mse)


def _lengths(lengths: Any) -> ndarray | None:
    if lengths is None:
        return None
    found = np.asarray(lengths, float)
    if found.ndim != 1 or not len(found) or not np.all(np.isfinite(found) & (found > 0)):
        raise InputError(f"the lengths of test vectors are {lengths}", "Give positive numbers of metres")
    return found


def _vectors(tests: Any, space: int) -> ndarray:
    found = np.asarray(tests, float)
    if found.ndim != 2 or found.shape[0] != space or not np.all(np.isfinite(found)) or np.any(np.all(found == 0, axis=0)):
        raise InputError(f"test vectors of shape {found.shape}", f"Give [{space}, points] metres, none of them zero")
    return found


def _at(support: Support, law: PairLaw, H: ndarray, form: str, n: int) -> Best:
    grams = kernel.grams if form == "support" else kernel.printed
    coarse, fine = (kernel.bound_matrices(H, grams(support, law, [H], k, [1.0])[0])[0] for k in (n, n + n // 2 + 1))
    change = np.sqrt(np.trace(fine) / max(np.trace(coarse), 1e-300)) - 1
    return Best(fine, H, float(abs(change)) if np.trace(fine) > 0 else 0.0)


def _diagonal(support: Support, law: PairLaw, start: Best, form: str, n: int) -> Best:
    """A length per axis: a coarse grid over all of them, then a simplex search."""
    from scipy.optimize import minimize

    grams = kernel.grams if form == "support" else kernel.printed
    reach = np.array([support.reach(a) for a in np.eye(support.space)]) * (1 - 1e-9)

    def loss(logs: ndarray) -> float:
        H = np.diag(np.minimum(np.exp(logs), reach))
        return -float(np.trace(kernel.bound_matrices(H, grams(support, law, [H], n, [1.0])[0])[0]))

    ladder = np.array([0.003, 0.01, 0.03, 0.1, 0.22, 0.4, 0.65])
    grid = np.stack(np.meshgrid(*[ladder] * support.space, indexing="ij"), -1).reshape(-1, support.space)
    starts = [np.log(np.diagonal(start.tests)), *np.log(grid * reach)]
    losses = [loss(x) for x in starts]
    found = [
        minimize(loss, starts[k], method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-7, "maxfev": 120})
        for k in np.argsort(losses)[:2]
    ]
    top = min(found, key=lambda f: f.fun)
    return _at(support, law, np.diag(np.minimum(np.exp(top.x), reach)), form, n)


def _any_exponent(
    support: Support, law: PairLaw, s: float, fixed: ndarray | None, tests: Any, form: str, rtol: float
) -> tuple[Best, Swept | None]:
    if not isinstance(law, GaussianPairs) or np.any(np.isfinite(law.period)):
        raise RefusedError(
            f"the exponent {s} needs integrals of three densities, which are known for Gaussian noise only",
            "Use the exponent 1/2",
        )
    if form == "printed" or (fixed is None and tests != "equal"):
        raise InputError(f"the exponent {s} with tests={tests!r} and form={form!r}", 'Use tests="equal" or vectors')

    def trace(H: ndarray, n: int) -> ndarray:
        gram = kernel.with_exponent(support, law, [H], s, n, [1.0])[0]
        if not np.all(np.isfinite(gram.q)):
            return np.zeros((support.space, support.space))
        return kernel.bound_matrices(H, gram)[0]

    swept = None
    if fixed is None:
        identity = np.eye(support.space)
        h = _longest(support, identity) * np.logspace(-DECADES, 0, GRID + 1)[:-1]
        mse = np.array([np.trace(trace(k * identity, NODES)) for k in h])
        for zoom in range(ZOOMS):
            closer = _closer(h, mse, zoom)
            if len(closer):
                new = np.array([np.trace(trace(k * identity, NODES)) for k in closer])
                h, both = _merge(h, mse[None], closer, new[None])
                mse = both[0]
        fixed, swept = h[mse.argmax()] * identity, Swept(h, mse[None])

    def at(n: int) -> tuple[Best, Swept | None]:
        coarse, fine = trace(fixed, n), trace(fixed, n + n // 2 + 1)
        error = abs(np.sqrt(np.trace(fine) / max(np.trace(coarse), 1e-300)) - 1)
        return Best(fine, fixed, float(error)), swept

    return _refined(at, rtol)


def _limit(plan: Plan) -> ndarray | None:
    """The limit of short test vectors where it exists: the Bayesian Cramér-Rao matrix."""
    from locbounds.registry import method
    from locbounds.bounds.bcrb_of_plan import bayesian_information
    from locbounds.verdict import Status

    if method("bcrb").verdict(plan).status is not Status.VALID:
        return None
    return np.linalg.inv(bayesian_information(plan)[0])
