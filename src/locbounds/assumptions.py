"""Assumptions that every bound of this library makes, as predicates: which scenario violates them, and why."""

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.errors import InputError
from locbounds.linalg import is_positive_semidefinite
from locbounds.measurement import BySight, Range
from locbounds.model.linear import no_linear_channel, no_linear_motion
from locbounds.motion import SwitchingMotion
from locbounds.precision import double_precision, traced
from locbounds.scenario import Scenario
from locbounds.sight.base import check_probabilities
from locbounds.verdict import Assumption

NEAR_M = (1e-2, 1e-5)  # distances to an anchor at which the steepness of a measurement is compared
STEEPER = 100.0  # a gradient that grows more than this from the first to the second has no finite mean square


@double_precision
def no_chain(scenario: Scenario) -> str | None:
    """Which link's sight is no Markov chain, or None."""
    if traced(scenario):
        return None
    for link in scenario.links:
        transitions = np.asarray(link.sight.transitions(scenario.times.intervals))  # raises if the times do not suit
        try:
            check_probabilities(np.asarray(link.sight.start), "its start")
            check_probabilities(transitions, "its transition")
        except InputError as error:
            return f"the sight of anchor {link.name} is no Markov chain: {error.cause}"
    return None


@double_precision
def no_gaussian_motion(scenario: Scenario) -> str | None:
    """Why F and Q do not describe linear Gaussian motion, or None."""
    if traced(scenario):
        return None
    motion, intervals = scenario.motion, np.asarray(scenario.times.intervals)
    for one in motion.motions if isinstance(motion, SwitchingMotion) else (motion,):
        F, Q = np.asarray(one.transitions(intervals)), np.asarray(one.covariances(intervals))
        if not (np.all(np.isfinite(F)) and np.all(np.isfinite(Q))):
            return "the motion has numbers that are not finite"
        for first in np.unique(Q, axis=0, return_index=True)[1]:
            if not is_positive_semidefinite(Q[first]):
                dt = intervals[first]
                return f"the motion's Q has a negative variance in some direction, for an interval of {dt:.4g} s"
    return None


@double_precision
def infinite_information(scenario: Scenario) -> str | None:
    """Which measurement is so steep at its anchor that the expected information is infinite, or None.

    A gradient that grows like ``1/r`` has no finite mean square over a density that is positive at the anchor, in two
    dimensions (in three it has).
    """
    if traced(scenario) or scenario.dim > 2:
        return None
    directions = np.stack([np.cos(a := np.arange(8) * np.pi / 4 + 0.1), np.sin(a)], axis=-1)
    each = [
        (link, h)
        for link in scenario.links
        for h in (link.measurement.measurements if isinstance(link.measurement, BySight) else (link.measurement,))
        if type(h) is not Range  # whose gradient has length one everywhere
    ]
    for link, h in each:
        anchor = np.asarray(h.anchor)
        far, near = (
            np.linalg.norm(np.asarray(jax.vmap(jax.grad(h))(jnp.asarray(anchor + r * directions))), axis=1)
            for r in NEAR_M
        )
        if np.any(near > STEEPER * far):
            return (
                f"the measurement of anchor {link.name} grows infinitely steep at the anchor: its expected information "
                "is infinite where the mobile may come there; the model needs a radius within which it stays finite"
            )
    return None


MARKOV_CHAINS = Assumption("the sight of every link is a Markov chain of its own", no_chain)
GAUSSIAN_MOTION = Assumption("the motion is linear with Gaussian noise, Q positive semidefinite", no_gaussian_motion)
FINITE_GEOMETRY = Assumption("no measurement is infinitely steep at its anchor", infinite_information)
COMMON = (GAUSSIAN_MOTION, MARKOV_CHAINS, FINITE_GEOMETRY)
LINEAR_MOTION = Assumption("motion and prior are linear Gaussian without modes", no_linear_motion)
LINEAR_CHANNELS = Assumption(
    "what is measured is linear in the state, plus noise that may depend on modes", no_linear_channel
)
