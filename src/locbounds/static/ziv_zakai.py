"""The extended Ziv-Zakai bound of a plan, along a direction or summed over the axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.result import Result
from locbounds.static import ziv_zakai_kernel as kernel
from locbounds.static.common import check_rtol, static_result, verdict_of
from locbounds.static.pair_laws import GaussianPairs, PairLaw
from locbounds.static.plan_laws import needs_prior, pair_law, support_of
from locbounds.static.support import Support

NODES, MOST_NODES = 10, 120  # along a side
SHIFTS = ("along", "free")
PROBABILITIES = ("general", "equal")


class Sum(NamedTuple):
    """The bound on the trace, one row per noise level.

    Attributes
    ----------
    axes_m2 : array [scales, space]
    error : array [scales]
        Relative change of the root mean square error on finer nodes, and of the integral over h.
    parts : tuple of kernel.Along
    """

    axes_m2: Float[ndarray, "scales space"]
    error: Float[ndarray, " scales"]
    parts: tuple[kernel.Along, ...]


def over_axes(
    support: Support, law: PairLaw, axes: Float[ndarray, "axes space"], scales: Sequence[float], *,
    free: bool = False, valley: bool = True, equal: bool = False, n: int = NODES, rtol: float = 1e-3,
) -> Sum:  # fmt: skip
    """The bound along each axis, on nodes that are refined until finer ones agree for every noise level."""

    def at(nodes: int) -> tuple[kernel.Along, ...]:
        options = {"free": free, "valley": valley, "equal": equal, "rtol": 2 * rtol}
        return tuple(kernel.along(support, law, a, nodes, scales, **options) for a in axes)

    parts = at(n)
    while True:
        n = n + n // 2 + 1
        finer = at(n)
        old, new = (np.stack([p.mse_m2 for p in each], -1) for each in (parts, finer))
        change = np.abs(np.sqrt(new.sum(-1) / np.maximum(old.sum(-1), 1e-300)) - 1)
        if change.max() <= rtol or n > MOST_NODES:
            return Sum(new, change, finer)
        parts = finer


@double_precision
def ezzb(
    plan: Plan,
    *,
    direction: Sequence[float] | Float[ndarray, " space"] | None = None,
    shifts: str = "along",
    valley_filling: bool = True,
    probabilities: str = "general",
    rtol: float = 1e-3,
) -> Result:
    r"""Extended Ziv-Zakai bound: no estimator of the position has a smaller mean square error, averaged over the prior.

    Parameters
    ----------
    plan
        With a prior of any kind.
    direction
        Vector a of the bound on ``E[(a . error)^2]``; by default the sum over the axes, which bounds the mean square
        position error.
    shifts
        ``"along"``: delta = h a, the chapter's quick form; ``"free"``: the best delta with ``a . delta = h``.
    valley_filling
        Replace A(h) by its maximum over all larger h: never smaller.
    probabilities
        ``"general"``: error probabilities for the prior's two densities, equation (24); ``"equal"``: for equally likely
        places and the smaller density, equation (26), which is all that is known for noise that is not Gaussian.
        Both are the same for a uniform prior.
    rtol
        Largest relative change of the RMSE when the quadrature is refined.

    Returns
    -------
    Result
        ``covariance[0]`` has the bounds along the axes on its diagonal (NaN elsewhere; with a direction only
        ``position_mse`` is known); ``diagnostics`` hold ``h_m`` and ``filled`` (V[A(h)]) per axis, and
        ``quadrature_error`` (relative).

    Raises
    ------
    InputError
        If the plan has no prior, or an option cannot be used.

    Notes
    -----
    Bell et al. 1997; (24) to (26) of the chapter with its missing factors: the error probability of equally likely
    places is ``1/2 erfc(d / (2 sqrt 2))`` in the Mahalanobis distance d of their means.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], 2.0, prior=lb.UniformDisc([0, 0], 15))
    >>> print(lb.ezzb(plan))
    EZZB: position RMSE 2.216 m; valid (any prior, any measurement)
    """
    prior = needs_prior(plan, "the Ziv-Zakai bound")
    verdict, rtol = verdict_of("ezzb", plan), check_rtol(rtol)
    for value, name, known in ((shifts, "shifts", SHIFTS), (probabilities, "probabilities", PROBABILITIES)):
        if value not in known:
            raise InputError(f"{name} is {value!r}", f"Choose {' or '.join(map(repr, known))}")
    axes, weight = np.eye(plan.dim), 1.0
    if direction is not None:
        a = np.asarray(direction, float)
        if a.shape != (plan.dim,) or not np.all(np.isfinite(a)) or not np.any(a):
            raise InputError(f"the direction is {direction}", f"Give {plan.dim} finite numbers, not all zero")
        weight = float(a @ a)
        axes = (a / np.sqrt(weight))[None]
    support, law = support_of(prior, plan.anchors), pair_law(plan)
    found = over_axes(
        support, law, axes, [1.0], free=shifts == "free", valley=valley_filling, equal=probabilities == "equal", rtol=rtol
    )
    known = found.axes_m2[0] * weight
    matrix = np.full((plan.dim, plan.dim), np.nan)
    if direction is None:
        matrix[np.diag_indices(plan.dim)] = known
    exact = probabilities == "general" and (support.uniform or isinstance(law, GaussianPairs))
    how = f"shifts {shifts}, {'general' if exact else 'equal'} probabilities, adaptive in h, valleys " + (
        "filled" if valley_filling else "kept"
    )
    diagnostics = {
        "axes": axes,
        "axes_mse_m2": known,
        "h_m": [p.h_m for p in found.parts],
        "filled": [p.filled[0] for p in found.parts],
        "quadrature_error": float(found.error[0]),
    }
    return static_result("ezzb", matrix, verdict, how, mse=float(known.sum()), diagnostics=diagnostics)
