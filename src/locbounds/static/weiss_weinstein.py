"""The Weiss-Weinstein bound of a plan, with its supremum searched globally."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError, RefusedError
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.result import Result
from locbounds.static import weiss_weinstein_kernel as kernel
from locbounds.static.common import check_rtol, not_refined, static_result, verdict_of
from locbounds.static.pair_laws import GaussianPairs, PairLaw
from locbounds.static.plan_laws import needs_prior, pair_law, support_of
from locbounds.static.support import Support
from locbounds.static.weiss_weinstein_search import (
    FIRST,
    NODES,
    ZOOMS,
    Best,
    Swept,
    at_vectors,
    diagonal,
    equal_lengths,
    longest,
    many_points,
    relative_change,
    shortest,
    sweep,
)
from locbounds.verdict import Verdict

MOST_NODES = 160  # along a side


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
        Lengths to sweep, in metres, beside those that are always swept. Where the largest value is outside of them, the
        verdict warns.
    exponent
        s between 0 and 1. Other than 1/2 for Gaussian noise only; 1/2 was the best in all settings that we know.
    form
        ``"support"``, or ``"printed"``: equation (18) of the chapter, which is valid but looser where the prior's
        support is not everything.
    rtol
        Largest relative change of the RMSE when the quadrature is refined; the value returned is that of the finer
        nodes, which took no part in the search.

    Returns
    -------
    Result
        ``covariance[0]`` is the bound on the mean square error matrix; ``diagnostics`` hold the test vectors
        ``tests_m``, the sweep ``lengths_m`` and ``swept_mse_m2``, and ``quadrature_error`` (relative). In regular
        problems the largest value may be the limit h -> 0, the Bayesian Cramér-Rao bound; ``limit`` says so.

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
    WWB: position RMSE 2.121 m; valid (any prior; any measurement)
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
    lengths = _lengths(lengths_m)
    if exponent != 0.5:
        best, swept = _any_exponent(support, law, exponent, fixed, tests, form, lengths, rtol)
    else:
        best, swept = _refined(lambda n: _search(support, law, tests, fixed, form, n, lengths), rtol)
    diagnostics = {"tests_m": best.tests, "quadrature_error": best.error, "limit": False}
    if swept is not None:
        diagnostics |= {"lengths_m": swept.lengths_m, "swept_mse_m2": swept.mse_m2[0]}
    matrix, how = best.matrix, f"quadrature over overlaps of the prior's shifted copies, {best.tests.shape[1]} tests"
    limit = _limit(plan) if fixed is None and form == "support" else None
    if limit is not None and np.trace(limit) >= np.trace(matrix) * (1 - rtol):
        matrix, how = limit, "limit of short test vectors: the Bayesian Cramér-Rao bound"
        diagnostics["limit"] = True
    elif swept is not None and lengths is not None:
        verdict = _beside(verdict, swept, lengths)
    verdict = not_refined(verdict, best.error, rtol)
    return static_result("wwb", matrix, verdict, how, name=name, diagnostics=diagnostics)


def _beside(verdict: Verdict, swept: Swept, lengths: ndarray) -> Verdict:
    """The verdict, with a warning where lengths that were given miss the maximum."""
    top = float(swept.lengths_m[swept.mse_m2[0].argmax()])
    if lengths.min() <= top <= lengths.max():
        return verdict
    missed = f"the maximum, at {top:.3g} m, is not between the lengths given: others were swept too"
    return verdict._replace(warnings=(*verdict.warnings, missed))


def _refined(search: Callable[[int], tuple[Best, Swept | None]], rtol: float) -> tuple[Best, Swept | None]:
    """Search on more nodes until fresh ones agree."""
    n = NODES
    best, swept = search(n)
    while best.error > rtol and n < MOST_NODES:
        n = n + n // 2
        best, swept = search(n)
    return best, swept


def _search(
    support: Support, law: PairLaw, tests: Any, fixed: ndarray | None, form: str, n: int, lengths: ndarray | None
) -> tuple[Best, Swept | None]:
    if fixed is not None:
        return at_vectors(support, law, fixed, form, n), None
    if isinstance(tests, str):
        if tests not in ("equal", "diagonal"):
            raise InputError(f"the tests are {tests!r}", 'Choose "equal", "diagonal", a number, or vectors')
        best, swept = equal_lengths(support, law, [1.0], form=form, n=n, lengths=lengths)
        if tests == "diagonal" and support.space > 1:
            return diagonal(support, law, best[0], form, n), swept
        return best[0], swept
    if tests < support.space:
        raise InputError(f"{tests} test points in {support.space} dimensions", "Give at least one per dimension")
    return many_points(support, law, int(tests), form, n, lengths)


def _lengths(lengths: Any) -> ndarray | None:
    if lengths is None:
        return None
    found = np.asarray(lengths, float)
    if found.ndim != 1 or not len(found) or not np.all(np.isfinite(found) & (found > 0)):
        raise InputError(f"the lengths of test vectors are {lengths}", "Give positive numbers of metres")
    return found


def _vectors(tests: Any, space: int) -> ndarray:
    found = np.asarray(tests, float)
    if (
        found.ndim != 2
        or found.shape[0] != space
        or not np.all(np.isfinite(found))
        or np.any(np.all(found == 0, axis=0))
    ):
        raise InputError(f"test vectors of shape {found.shape}", f"Give [{space}, points] metres, none of them zero")
    return found


def _any_exponent(
    support: Support, law: PairLaw, s: float, fixed: ndarray | None, tests: Any, form: str, lengths: ndarray | None,
    rtol: float,
) -> tuple[Best, Swept | None]:  # fmt: skip
    if not isinstance(law, GaussianPairs) or np.any(np.isfinite(law.period)):
        raise RefusedError(
            f"the exponent {s} needs integrals of three densities, which are known for Gaussian noise only",
            "Use the exponent 1/2",
        )
    if form == "printed" or (fixed is None and tests != "equal"):
        raise InputError(f"the exponent {s} with tests={tests!r} and form={form!r}", 'Use tests="equal" or vectors')

    def matrix(H: ndarray, n: int) -> ndarray:
        gram = kernel.with_exponent(support, law, [H], s, n, [1.0])[0]
        if not np.all(np.isfinite(gram.q)):
            return np.zeros((support.space, support.space))
        return kernel.bound_matrices(H, gram)[0]

    swept, H = None, fixed
    if H is None:
        identity = np.eye(support.space)
        top = longest(support, identity)

        def values(h: ndarray) -> ndarray:
            return np.array([[np.trace(matrix(k * identity, NODES)) for k in h]])

        first = top * FIRST if lengths is None else np.concatenate([lengths, top * FIRST])
        swept = sweep(values, first, top, shortest(support), ZOOMS, whole=support.whole)
        H = swept.lengths_m[swept.mse_m2[0].argmax()] * identity

    def at(n: int, H: ndarray = H) -> tuple[Best, Swept | None]:
        coarse, fine = matrix(H, n), matrix(H, n + n // 2 + 1)
        return Best(fine, H, relative_change(coarse, fine)), swept

    return _refined(at, rtol)


def _limit(plan: Plan) -> ndarray | None:
    """The limit of short test vectors where it exists: the Bayesian Cramér-Rao matrix."""
    from locbounds.bounds.bcrb_of_plan import bayesian_information
    from locbounds.registry import method
    from locbounds.verdict import Status

    if method("bcrb").verdict(plan).status is not Status.VALID:
        return None
    return np.linalg.inv(bayesian_information(plan)[0])
