"""Dilutions of precision of a plan whose stations differ: with weights."""

import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.plan import Observations, Plan
from locbounds.static.crlb import Dop, crlb


def dop(
    plan: Plan,
    points: Float[Array, "points space"],
    *,
    weights: Float[Array, " channels"] | None = None,
    std: float | None = None,
) -> Dop:
    """Dilutions of precision: bounds on errors over the deviation of one station.

    Parameters
    ----------
    plan
        What is measured.
    points
        [points, space] in metres.
    weights
        One per channel: how much more accurate it is than the reference, ``(reference deviation / deviation)^2``; the
        result is then the error per unit of the reference's deviation, in metres per its unit, whatever the plan's
        noise. Needed where units are mixed.
    std
        Instead of weights: the deviation that errors are relative to.

    Raises
    ------
    InputError
        If units are mixed, or deviations differ, and neither is given.

    Examples
    --------
    >>> import locbounds as lb
    >>> square = [[0, 0], [100, 0], [100, 100], [0, 100]]
    >>> lb.dop(lb.toa(square, std_m=7.0), np.array([[50.0, 50.0]])).gdop  # 2 / sqrt(4), whatever the deviation
    array([1.])
    """
    if weights is None:
        if std is None and len(set(plan.units)) > 1:
            raise InputError(
                f"the plan mixes units ({', '.join(dict.fromkeys(plan.units))}): a common deviation has no meaning",
                "Give weights, one per channel: (reference deviation / deviation)^2",
            )
        return crlb(plan, points).dop(std=std)
    w = np.asarray(weights, dtype=float)
    if w.shape != (plan.size,) or not np.all(np.isfinite(w) & (w > 0)):
        raise InputError(f"{plan.size} channels have the weights {w}", "Give one positive number per channel")
    equal = Plan(
        [Observations(plan.measurements, np.diag(1 / w), names=[n for g in plan.groups for n in g.names])],
        clock_std_m=None if plan.clock_std_m is None else np.inf,
        prior=plan.prior,
    )
    return crlb(equal, points).dop(std=1.0)
