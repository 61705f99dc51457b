"""Verdicts: whether a bound may be quoted for a scenario, computed from assumptions that are predicates."""

from collections.abc import Callable
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import LOS, NLOS
from locbounds.precision import double_precision, traced
from locbounds.scenario import Scenario, beyond_separation
from locbounds.sight import DwellSight, KnownSight, MarkovSight

NEARLY_CERTAIN = 1e-3  # a chain that changes (or keeps) its mode less often than this per step is called deterministic
NO_INFORMATION = 1e-3  # an NLOS mode with less than this share of the LOS information carries none


class Status(StrEnum):
    """What a verdict says."""

    VALID = "valid"
    CONDITIONAL = "valid under"
    UNDECIDED = "undecided"
    REFUSED = "refused"


class Assumption(NamedTuple):
    """One assumption of a bound.

    Attributes
    ----------
    text
        What is assumed, in words.
    violated
        Predicate: the reason why a scenario (or a survey) violates it, or None.
    doubtful
        Predicate: the reason why it cannot be decided whether it is violated, or None.
    trusted
        Predicate: what only the user can know and has to vouch for, a condition of the verdict, or None.
    """

    text: str
    violated: Callable[[Any], str | None]
    doubtful: Callable[[Any], str | None] = lambda subject: None
    trusted: Callable[[Any], str | None] = lambda subject: None


class Verdict(NamedTuple):
    """Whether a bound applies, and why.

    Attributes
    ----------
    status
        Valid, valid under conditions, undecided (a number to look at, never one to quote), or refused.
    reasons
        One sentence each: grounds, conditions or violations.
    warnings
        What is legal but dangerous.
    """

    status: Status
    reasons: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        text = f"{self.status} ({'; '.join(self.reasons)})" if self.reasons else str(self.status)
        return text + "".join(f"\nwarning: {warning}" for warning in self.warnings)


def judge(
    assumptions: tuple[Assumption, ...], subject: Any, *, grounds: tuple[str, ...], conditions: tuple[str, ...]
) -> Verdict:
    """Verdict of a method with these assumptions for a scenario, or for anything else that they are predicates on.

    Parameters
    ----------
    assumptions
        Checked in turn; a violation refuses, a doubt leaves the verdict undecided, what is trusted makes it
        conditional.
    grounds
        Why the bound holds when nothing is violated.
    conditions
        What the number depends on beyond the model (for example one measured track).
    """
    violations = tuple(reason for a in assumptions if (reason := a.violated(subject)) is not None)
    if violations:
        return Verdict(Status.REFUSED, violations)
    warnings = dangers(subject) if isinstance(subject, Scenario) else getattr(subject, "dangers", tuple)()
    conditions += tuple(trust for a in assumptions if (trust := a.trusted(subject)) is not None)
    doubts = tuple(doubt for a in assumptions if (doubt := a.doubtful(subject)) is not None)
    if doubts:
        return Verdict(Status.UNDECIDED, doubts + conditions, warnings)
    status = Status.CONDITIONAL if conditions else Status.VALID
    return Verdict(status, conditions or grounds, warnings)


def regular_noise(scenario: Scenario) -> str | None:
    """Why the Fisher information of some noise does not exist, or None."""
    for link in scenario.links:
        for mode, noise in enumerate(link.noises):
            regularity = noise.regularity()
            if regularity.finite is False:
                return (
                    f"the {_sight_name(link.noises, mode)}noise of anchor {link.name} has no finite Fisher "
                    f"information: {regularity.reason}"
                )
    return None


def undecided_noise(scenario: Scenario) -> str | None:
    """Why it is not known whether the Fisher information of some noise exists, or None."""
    for link in scenario.links:
        for mode, noise in enumerate(link.noises):
            regularity = noise.regularity()
            if regularity.finite is None:
                return (
                    f"whether the {_sight_name(link.noises, mode)}noise of anchor {link.name} has a finite Fisher "
                    f"information is not known: {regularity.reason}"
                )
    return None


def _sight_name(noises: tuple, mode: int) -> str:
    return f"{('LOS', 'NLOS')[mode]} " if len(noises) == 2 else ""


def all_sights_known(scenario: Scenario) -> str | None:
    """Which anchor has no known sight schedule, or None."""
    unknown = [link.name for link in scenario.links if not isinstance(link.sight, KnownSight)]
    if unknown:
        return (
            f"the sight of {', '.join(unknown)} is random: give a known schedule (sight = {{ known = ... }}, "
            "Scenario.with_known_sight) or use enumer, which averages over schedules"
        )
    return None


def two_modes(scenario: Scenario) -> str | None:
    """Which anchor has other modes than LOS and NLOS, or None."""
    other = [link.name for link in scenario.links if len(link.noises) != 2]
    return f"anchors {', '.join(other)} do not have exactly the modes LOS and NLOS" if other else None


def not_separable(scenario: Scenario) -> str | None:
    """Why links do not have chains and measurements of their own, or None."""
    why = beyond_separation(scenario)
    return None if why is None else f"{why}: bcrb takes that, this does not"


def two_points(survey: Any) -> str | None:
    """Why a survey tells nothing about accuracy, or None."""
    return None if survey.points > 1 else f"the survey has {survey.points} point"


DETERMINED = Assumption("at least as many measurements as unknowns", lambda plan: plan.too_few())
REGULAR_PLAN = Assumption(
    "every measurement's noise has a finite Fisher information about a shift",
    lambda plan: plan.irregular_noise(),
    lambda plan: plan.irregular_noise(None),
)
SEPARABLE = Assumption("motion without modes, one chain per link, measurements that do not depend on it", not_separable)
SMOOTH_NOISE = Assumption("every noise has a finite Fisher information about a shift", regular_noise, undecided_noise)
KNOWN_SIGHT = Assumption("the sight of every link is known at every step", all_sights_known)
LOS_AND_NLOS = Assumption("every link is either LOS or NLOS", two_modes)
SURVEYED = Assumption("at least two surveyed points", two_points)


@double_precision
def dangers(scenario: Scenario) -> tuple[str, ...]:
    """What is legal but dangerous in a scenario, one sentence each.

    Examples
    --------
    >>> import locbounds as lb
    >>> dangers(lb.papers.fritsche2013.scenario())
    ()
    """
    if traced(scenario):
        return ()
    found: dict[str, list[str]] = {}
    if not np.any(np.asarray(scenario.reports)):
        names = [link.name for link in scenario.links]
        found["no range is ever reported: every number is the prior's prediction"] = names
    intervals = scenario.times.intervals
    for link in scenario.links:
        if isinstance(link.sight, MarkovSight | DwellSight):
            stay = np.asarray(link.sight.transitions(intervals))
            stay = np.diagonal(stay, axis1=1, axis2=2)
            if np.min(np.minimum(stay, 1 - stay)) < NEARLY_CERTAIN and scenario.steps > 1:
                text = (
                    "the chain is nearly deterministic: simulated tracks seldom see the rare change, "
                    "so that standard errors may be too small"
                )
                found.setdefault(text, []).append(link.name)
        if len(link.noises) == 2:
            los, nlos = (float(noise.information()) for noise in link.noises)
            if nlos < NO_INFORMATION * los:
                text = (
                    f"NLOS ranges carry less than {NO_INFORMATION:g} of the information of LOS ranges: accuracy "
                    "comes from the LOS share alone"
                )
                found.setdefault(text, []).append(link.name)
            if los < nlos:
                text = f"mode {NLOS} (NLOS) is more informative than mode {LOS} (LOS): check that they are not swapped"
                found.setdefault(text, []).append(link.name)
        if np.array_equal(link.measurement.anchor, scenario.motion.position(scenario.prior.mean)):
            text = "the prior's mean is exactly at the anchor, where a range has no direction"
            found.setdefault(text, []).append(link.name)
    return tuple(f"anchor {', '.join(names)}: {text}" for text, names in found.items())
