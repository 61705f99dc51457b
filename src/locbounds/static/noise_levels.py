"""Bounds of one plan at several noise levels: measurements are evaluated once for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError, RefusedError
from locbounds.plan import Plan
from locbounds.precision import double_precision
from locbounds.static.pair_laws import GaussianPairs
from locbounds.static.plan_laws import needs_prior, pair_law, support_of
from locbounds.static.weiss_weinstein import MOST_NODES, NODES, Best, equal_lengths
from locbounds.static.ziv_zakai import over_axes


class Level(NamedTuple):
    """Bounds at one noise level.

    Attributes
    ----------
    scale : float
        Noise relative to the plan's.
    wwb_m, printed_m, ezzb_m : float
        Root mean square errors: Weiss-Weinstein with H = h I, its printed form, Ziv-Zakai along the axes.
    wwb_error, printed_error, ezzb_error : float
        Relative quadrature errors.
    length_m : float
        h of the Weiss-Weinstein bound.
    """

    scale: float
    wwb_m: float
    printed_m: float
    ezzb_m: float
    wwb_error: float
    printed_error: float
    ezzb_error: float
    length_m: float


@double_precision
def bounds_over_noise(
    plan: Plan, scales: Sequence[float] | Float[ndarray, " scales"], *, printed: bool = True, rtol: float = 1e-3
) -> list[Level]:
    """Weiss-Weinstein and Ziv-Zakai bounds of a plan with Gaussian noise, at multiples of its noise.

    Parameters
    ----------
    plan
        With a prior; angles are taken on the circle at every level.
    scales
        Multiples of the plan's deviations.
    printed
        Also the chapter's form of the Weiss-Weinstein bound (else NaN).
    rtol
        Largest relative change of an RMSE when its quadrature is refined.

    Raises
    ------
    RefusedError
        If a noise is not Gaussian.

    Examples
    --------
    >>> import locbounds as lb
    >>> plan = lb.toa([[0, 15], [-13, -7.5], [13, -7.5]], 1.0, prior=lb.UniformDisc([0, 0], 15))
    >>> [round(level.ezzb_m, 3) for level in bounds_over_noise(plan, [1.0, 2.0], printed=False)]
    [1.148, 2.215]
    """
    levels = [float(s) for s in np.asarray(scales, float)]
    if not levels or not all(np.isfinite(s) and s > 0 for s in levels):
        raise InputError(f"the noise levels are {list(scales)}", "Give positive numbers")
    law = pair_law(plan)
    if not isinstance(law, GaussianPairs):
        raise RefusedError("noise levels of noise that is not Gaussian", "Compute a plan per level")
    support = support_of(needs_prior(plan, "a bound over noise levels"), plan.anchors)
    both = [_refined(support, law, levels, form, rtol) for form in ("support", "printed")[: 1 + printed]]
    sums = over_axes(support, law, np.eye(plan.dim), levels, rtol=rtol)
    found = []
    for k, scale in enumerate(levels):
        wwb = both[0][k]
        old = both[1][k] if printed else Best(np.full((1, 1), np.nan), wwb.tests, np.nan)
        roots = [float(np.sqrt(np.trace(b.matrix))) for b in (wwb, old)]
        ezzb = float(np.sqrt(sums.axes_m2[k].sum()))
        length = float(wwb.tests[0, 0])
        found.append(Level(scale, *roots, ezzb, wwb.error, old.error, float(sums.error[k]), length))
    return found


def _refined(support, law, levels: list[float], form: str, rtol: float) -> list[Best]:
    n = NODES
    while True:
        best, _ = equal_lengths(support, law, levels, form=form, n=n)
        if max(b.error for b in best) <= rtol or n > MOST_NODES:
            return best
        n = n + n // 2
