"""Assumptions of bounds on the position of a plan, as predicates: which plan violates them, and why."""

from typing import Any

import numpy as np

from locbounds.measurement import pole
from locbounds.plan import Plan
from locbounds.plan.jumps import black_box_jump, black_box_steepness
from locbounds.probes import Steep, once
from locbounds.verdict import REGULAR_PLAN, Assumption


def no_prior(plan: Plan) -> str | None:
    """That the plan has no prior, or None."""
    return "the plan has no prior: nothing is averaged over" if plan.prior is None else None


def mixed_units(plan: Plan) -> str | None:
    """Which units the plan mixes, or None."""
    units = dict.fromkeys(unit or "unknown" for unit in plan.units)
    return f"squares of {', '.join(units)} cannot be summed without weights" if len(units) > 1 else None


def irregular_prior(plan: Plan) -> str | None:
    """Why the prior has no finite information, or None."""
    if plan.prior is None:
        return None
    why = plan.prior.irregular()
    return None if why is None else f"{why}: the prior has no finite information"


def discontinuous(plan: Plan) -> str | None:
    """Which measurement jumps from one place to the next, or None."""
    for m, name in _measurements(plan):
        if not getattr(m, "continuous", True):
            return f"the measurement of {name} jumps where the line of sight is lost"
    return jumping_function(plan)


@once
def jumping_function(plan: Plan) -> str | None:
    """Which function jumps, and where, or None."""
    jump = black_box_jump(plan)
    if jump is None:
        return None
    place = ", ".join(f"{x:.4g}" for x in np.round(jump.place, 9) + 0.0)
    return f"the function of channel {plan.channel_names[jump.channel]} jumps by {jump.size:.3g} at ({place})"


def unresolved_jump(plan: Plan) -> str | None:
    """Why short test vectors pass a jump by, or None."""
    why = jumping_function(plan)
    if why is None:
        return None
    return (
        f"{why}: nodes of the quadrature step over it, and short test vectors do not see it; take ezzb, or cells "
        "that do not straddle it (street_raster, raster_wwb)"
    )


def diverging_information(plan: Plan) -> str | None:
    """Which measurement is so steep near its anchor that the expected information is infinite, or None.

    A gradient that grows like 1/r has no finite mean square over a density that is positive at the anchor of a plane,
    or anywhere on the vertical through it (bearings).
    """
    if plan.prior is None:
        return None
    for m, name in _measurements(plan):
        steep = pole(m)
        if steep is None or (plan.dim > 2 and not steep.vertical):
            continue
        if _comes_to(plan.prior, steep.place, vertical=steep.vertical):
            return (
                f"the {steep.what} of {name} changes like 1/r near the anchor, where the prior's density is positive: "
                "its expected information is infinite, the bound zero, and a Monte Carlo value drifts with the draws"
                + (" (a near-field radius, near_field_m, makes it finite)" if steep.what == "strength" else "")
            )
    infinite, why = steep_function(plan)
    return why if infinite else None


def perhaps_diverging(plan: Plan) -> str | None:
    """What has to be taken on trust of a function that is very steep somewhere, or None."""
    infinite, why = steep_function(plan)
    return None if infinite else why


@once
def steep_function(plan: Plan) -> tuple[bool, str | None]:
    """Whether the expected information of a function is infinite, and why it is or may be."""
    found = black_box_steepness(plan)
    if found is None:
        return False, None
    channel, steep = found
    return bool(steep.infinite), steep_words(f"the function of channel {plan.channel_names[channel]}", steep)


def steep_words(what: str, steep: Steep) -> str:
    """What a steep place means, in one sentence.

    >>> steep_words("h", Steep(np.zeros(1), 0.4, 1, None))
    'h continuous, E|grad h|^2 finite: the slope of h grows like r^-0.40 towards (0), too close to infinite to tell'
    """
    place = ", ".join(f"{x:.4g}" for x in np.round(steep.place, 9) + 0.0)
    grows = f"the slope of {what} grows like r^-{steep.exponent:.2f} towards ({place})"
    if steep.infinite:
        return f"{grows}, where the density is positive: its expected information is infinite, the bound zero"
    return f"h continuous, E|grad h|^2 finite: {grows}, too close to infinite to tell"


def _measurements(plan: Plan) -> list[tuple[Any, str]]:
    return [pair for group in plan.groups for pair in zip(group.measurements, group.names, strict=True)]


def _comes_to(prior: Any, anchor: np.ndarray, *, vertical: bool) -> bool:
    """Whether the anchor (or the vertical through it) is in the support or on its edge."""
    low, high = prior.bounds()
    size = 1e-9 * np.linalg.norm(high - low)
    angles = np.arange(8) * np.pi / 4
    around = np.zeros((9, len(anchor)))
    around[1:, :2] = size * np.stack([np.cos(angles), np.sin(angles)], -1)
    points = anchor + around
    if vertical and len(anchor) == 3:
        heights = np.linspace(low[2], high[2], 65)
        points = np.concatenate([np.column_stack([points[:, :2], np.full(9, z)]) for z in heights])
    return bool(np.any(prior.inside(points)))


WITH_PRIOR = Assumption("the plan has a prior", no_prior)
ONE_UNIT = Assumption("all measurements have the same unit", mixed_units)
REGULAR_PRIOR = Assumption("the prior's density vanishes smoothly where it ends", irregular_prior)
CONTINUOUS = Assumption("every measurement is continuous over the places that the prior allows", discontinuous)
RESOLVED = Assumption("no function jumps: integrals over short test vectors miss it", unresolved_jump)
FINITE_EXPECTATION = Assumption("the expected information is finite", diverging_information, trusted=perhaps_diverging)
BAYESIAN_PLAN = (WITH_PRIOR, REGULAR_PRIOR, REGULAR_PLAN, CONTINUOUS, FINITE_EXPECTATION)
