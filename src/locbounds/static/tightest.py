"""The tightest valid bound of a plan, with the reason and the runner-up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from locbounds.errors import RefusedError
from locbounds.plan import Plan
from locbounds.registry import RANGES, bounds_of, load, method
from locbounds.result import Result
from locbounds.result import tightest as of_results
from locbounds.verdict import Status

CANDIDATES = ("bcrb", "wwb", "ezzb")


class Tightest(NamedTuple):
    """The largest of the valid bounds.

    Attributes
    ----------
    best : Result
    runner_up : Result or None
    reason : str
        Why this one, in a sentence.
    refused : dict
        Id -> why a bound does not apply.

    Examples
    --------
    >>> import numpy as np, locbounds as lb
    >>> plan = lb.toa([[0, 9], [-8, -5], [8, -5]], 1.0, prior=lb.GaussianPrior([0, 0], 4 * np.eye(2)))
    >>> found = lb.tightest(plan)
    >>> found.best.id, found.runner_up.id, found.refused
    ('ezzb', 'wwb', {})
    """

    best: Result
    runner_up: Result | None
    reason: str
    refused: dict[str, str]

    def __str__(self) -> str:
        return self.reason


def tightest(
    subject: Plan | Sequence[Result], *, rtol: float = 1e-3, sees: frozenset[str] = RANGES
) -> Tightest | list[Result]:
    """The tightest valid bound: of a plan, computed and chosen; of results, those that none is tighter than.

    Parameters
    ----------
    subject
        A plan with a prior, whose bounds ``bcrb``, ``wwb`` and ``ezzb`` are computed as far as they apply. Or results
        of bounds for one scenario: the largest of the valid ones that hold for estimators which see no more than
        ``sees``, compared by average RMSE; those within four standard errors of it are returned with it.
    rtol
        Precision of the bounds of a plan.
    sees
        What the estimators of a scenario see, by default the ranges up to the present step.

    Returns
    -------
    Tightest or list of Result
        Of a plan; of results (largest first, empty if none is valid).

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], 2.0, prior=lb.UniformDisc([0, 0], 15))
    >>> print(lb.tightest(plan))
    EZZB is the tightest: 2.215 m, 4.4 % above WWB (2.121 m); BCRB does not apply: the density of a uniform law ...
    >>> [lb.tightest(lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], std, prior=plan.prior)).best.id for std in (2.0, 12.0)]
    ['ezzb', 'wwb']
    >>> scenario = lb.papers.fritsche2013.scenario(stay=0.6, steps=3)
    >>> [b.id for b in lb.tightest([lb.bcrb(scenario), lb.enumer(scenario), lb.los_only(scenario)])]
    ['bcrb']
    """
    if not isinstance(subject, Plan):
        return of_results(list(subject), sees=sees)
    found, refused = [], {}
    for entry in [method("bcrb"), *(m for m in bounds_of("plan") if m.id in CANDIDATES)]:
        verdict = entry.verdict(subject)
        if verdict.status is not Status.VALID:
            refused[entry.id] = "; ".join(verdict.reasons)
            continue
        try:
            found.append(load(entry)(subject, rtol=rtol))
        except RefusedError as error:
            refused[entry.id] = error.cause
    if not found:
        raise RefusedError("no bound applies to this plan", "; ".join(f"{k}: {v}" for k, v in refused.items()))
    found.sort(key=lambda r: -float(r.position_mse[0]))
    best, runner_up = found[0], found[1] if len(found) > 1 else None
    return Tightest(best, runner_up, _reason(best, runner_up, refused), refused)


def _reason(best: Result, runner_up: Result | None, refused: dict[str, str]) -> str:
    top = float(best.mean_position_rmse())
    text = f"{best.name} is the tightest: {top:.3f} m"
    if runner_up is not None:
        other = float(runner_up.mean_position_rmse())
        text += (
            f", {100 * (top / other - 1) if other > 0 else float('inf'):.2g} % above {runner_up.name} ({other:.3f} m)"
        )
    for id, why in refused.items():
        text += f"; {method(id).name} does not apply: {why}"
    return text
