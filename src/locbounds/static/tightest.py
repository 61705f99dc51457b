"""The tightest valid bound of a plan, with the reason and the runner-up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeGuard

from locbounds.errors import RefusedError
from locbounds.plan import Plan
from locbounds.registry import RANGES, method
from locbounds.result import Result
from locbounds.result import tightest as of_results
from locbounds.static.over_prior import Numbers, Refusal, over_prior, rmse_of
from locbounds.verdict import Status

CANDIDATES = ("bcrb", "wwb", "ezzb")


class Tightest(NamedTuple):
    """The largest of the valid bounds.

    Attributes
    ----------
    best : Result
    runner_up : Result or None
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
    refused: dict[str, str]

    @property
    def rmse_m(self) -> float:
        """Of the best, in metres."""
        return rmse_of(self.best)[0]

    @property
    def reason(self) -> str:
        """Why this one, in a sentence."""
        text = f"{self.best.name} is the tightest valid bound over the prior: {self.rmse_m:.3f} m"
        if self.runner_up is None:
            return text
        other = rmse_of(self.runner_up)[0]
        above = f"{100 * (self.rmse_m / other - 1):.2g} % above" if other > 0 else "above"
        return f"{text}, {above} {self.runner_up.name} ({other:.3f} m)"

    def __str__(self) -> str:
        return "; ".join(
            [self.reason, *(f"{method(id).name} does not apply: {why}" for id, why in self.refused.items())]
        )


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
    EZZB is the tightest valid bound over the prior: 2.215 m, 4.4 % above WWB (2.121 m); BCRB does not apply: ...
    >>> [lb.tightest(lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], std, prior=plan.prior)).best.id for std in (2.0, 12.0)]
    ['ezzb', 'wwb']
    >>> scenario = lb.papers.fritsche2013.scenario(stay=0.6, steps=3)
    >>> [b.id for b in lb.tightest([lb.bcrb(scenario), lb.enumer(scenario), lb.los_only(scenario)])]
    ['bcrb']
    """
    if not isinstance(subject, Plan):
        return of_results(list(subject), sees=sees)
    numbers = over_prior(subject, CANDIDATES, rtol=rtol)
    found = choose(numbers)
    if found is None:
        raise RefusedError(
            "no bound applies to this plan", "; ".join(f"{k}: {v}" for k, v in _refused(numbers).items())
        )
    return found


def choose(found: Numbers) -> Tightest | None:
    """The largest of the valid bounds; None if there is none. Estimators are passed over.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7], [13, -7]], 2.0, prior=lb.UniformDisc([0, 0], 15))
    >>> choose(over_prior(plan, ["bcrb", "wwb", "ezzb"], rtol=1e-3)).reason
    'EZZB is the tightest valid bound over the prior: 2.214 m, 4.4 % above WWB (2.121 m)'
    """
    valid = [r for r in found.values() if _is_valid_bound(r)]
    if not valid:
        return None
    best, *others = sorted(valid, key=lambda r: -rmse_of(r)[0])
    return Tightest(best, others[0] if others else None, _refused(found))


def _is_valid_bound(found: Result | Refusal) -> TypeGuard[Result]:
    return isinstance(found, Result) and found.kind == "bound" and found.verdict.status is Status.VALID


def _refused(found: Numbers) -> dict[str, str]:
    """Bounds that are not valid, and why."""
    return {
        id: r.why if isinstance(r, Refusal) else "; ".join(r.verdict.reasons)
        for id, r in found.items()
        if method(id).kind == "bound" and not _is_valid_bound(r)
    }
