"""What the bounds and estimators of a plan share: the result, and options checked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError, RefusedError
from locbounds.plan import Plan
from locbounds.registry import method
from locbounds.result import Provenance, Result
from locbounds.verdict import Status, Verdict

MOST_RTOL = 0.1


def verdict_of(id: str, plan: Plan, conditions: tuple[str, ...] = ()) -> Verdict:
    """Verdict of a method for a plan; a refusal is raised.

    Raises
    ------
    RefusedError
        With the reasons.
    """
    found = method(id).verdict(plan, conditions)
    if found.status is Status.REFUSED:
        raise RefusedError(
            f"{method(id).name} does not apply: {'; '.join(found.reasons)}",
            f"locbounds explain {id} says what it needs",
        )
    return found


def check_clock(plan: Plan) -> None:
    """Raise a RefusedError if an unknown clock adds to channels whose noise is not Gaussian."""
    if plan.clock_std_m is not None and np.any(plan.clocked & ~np.asarray(plan.gaussian)):
        raise RefusedError(
            "a clock offset is common to channels whose noise is not Gaussian",
            "Use lb.crlb, which takes that, or Gaussian noise, or a known clock",
        )


def check_rtol(rtol: Any) -> float:
    """Raise an InputError unless a precision can be asked for."""
    if not (isinstance(rtol, int | float | np.number) and 0 < float(rtol) <= MOST_RTOL):
        raise InputError(f"rtol is {rtol}", f"Give a number between 0 and {MOST_RTOL}, for example 1e-3")
    return float(rtol)


def not_refined(verdict: Verdict, change: float, rtol: float) -> Verdict:
    """The verdict, with a warning where a quadrature has not reached its precision.

    >>> not_refined(Verdict(Status.VALID, ()), 0.01, 1e-3).warnings
    ('finer nodes changed the RMSE by 1.0%, more than the 0.1% asked for',)
    """
    if change <= rtol:
        return verdict
    text = f"finer nodes changed the RMSE by {change:.1%}, more than the {rtol:.1%} asked for"
    return verdict._replace(warnings=(*verdict.warnings, text))


def static_result(
    id: str,
    matrix: Float[ndarray, "space space"],
    verdict: Verdict,
    how: str,
    *,
    name: str | None = None,
    mse: float | None = None,
    replicates: Float[ndarray, " groups"] | None = None,
    seed: int = 0,
    samples: int = 0,
    track: str = "",
    diagnostics: Mapping[str, Any] | None = None,
) -> Result:
    """The result of one number for a plan: one "time", no steps.

    Parameters
    ----------
    matrix
        Bound on (or estimate of) the mean square error matrix, m^2; NaN where nothing is known of an entry.
    mse
        Its trace, by default.
    replicates
        Deviations of the mean square error of groups of draws from their mean, m^2.
    """
    entry = method(id)
    total = float(np.trace(matrix)) if mse is None else float(mse)
    return Result(
        id=id,
        name=name or entry.name,
        kind=entry.kind,
        sees=entry.sees,
        time_s=np.zeros(1),
        position_mse=np.array([total]),
        replicates=np.zeros((1, 1)) if replicates is None else np.asarray(replicates, float)[:, None],
        covariance=np.asarray(matrix, float)[None],
        verdict=verdict,
        provenance=Provenance.now(seed, samples, how, entry.references),
        track=track,
        diagnostics=dict(diagnostics or {}),
    )
