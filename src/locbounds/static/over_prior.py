"""Bayesian numbers of a plan: bounds and errors on average over its prior, each with the reason where there is none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from locbounds.errors import RefusedError
from locbounds.plan import Plan
from locbounds.registry import load, method
from locbounds.result import Result
from locbounds.verdict import Status

OVER_PRIOR = ("bcrb", "wwb", "ezzb", "mmse", "ml", "ls")
RTOL = 5e-3


class Refusal(NamedTuple):
    """Why a method has no number."""

    id: str
    why: str


Numbers = dict[str, Result | Refusal]  # by method id


def over_prior(
    plan: Plan,
    ids: Sequence[str],
    *,
    rtol: float = RTOL,
    seed: int = 0,
    announce: Callable[[str], None] = lambda text: None,
) -> Numbers:
    """Bayesian numbers of a plan, by id: a result, or why there is none.

    Parameters
    ----------
    plan
        With a prior; without one, every method is refused.
    ids
        Methods, of :data:`OVER_PRIOR`.
    rtol
        Precision of bounds; relative standard error of the least error.
    seed
        Of the estimators' draws.
    announce
        Told what is being computed.

    Raises
    ------
    InputError
        If an option cannot be used: that is no property of a method.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7], [13, -7]], 2.0, prior=lb.UniformDisc([0, 0], 15))
    >>> found = over_prior(plan, ["bcrb", "ezzb"])
    >>> found["bcrb"].why[:34], round(float(found["ezzb"].position_rmse[0]), 1)
    ('the density of a uniform law jumps', 2.2)
    """
    out: Numbers = {}
    for id in ids:
        entry = method(id)
        verdict = entry.verdict(plan)
        if verdict.status is Status.REFUSED:
            out[id] = Refusal(id, "; ".join(verdict.reasons))
            continue
        announce(f"{entry.name} over the prior")
        options = {} if id in ("ml", "ls") else {"rtol": rtol}
        if entry.kind != "bound":
            options["seed"] = seed
        try:
            out[id] = load(entry)(plan, **options)
        except RefusedError as error:
            out[id] = Refusal(id, error.cause)
    return out


def rmse_of(found: Result | Refusal | None) -> tuple[float, float]:
    """RMSE and standard error in metres; NaN where a method has no number.

    >>> rmse_of(Refusal("wwb", "no prior"))
    (nan, nan)
    """
    if not isinstance(found, Result):
        return float("nan"), float("nan")
    return float(found.position_rmse[0]), float(found.position_rmse_stderr[0])
