"""Chains, motion, noise and densities of a scenario or a model: which violates what is assumed, and why."""

import numpy as np

from locbounds.errors import InputError
from locbounds.linalg import is_positive_semidefinite
from locbounds.model import AdditiveChannel, DensityMotion, JumpMarkov
from locbounds.model.linear import no_linear_channel, no_linear_motion
from locbounds.motion import SwitchingMotion
from locbounds.precision import double_precision, traced
from locbounds.priors import DensityPrior
from locbounds.scenario import Scenario
from locbounds.sight.base import check_probabilities
from locbounds.verdict import SMOOTH_NOISE, Assumption


@double_precision
def no_chain(subject: Scenario | JumpMarkov) -> str | None:
    """Which link's sight (or which chain of a model) is no Markov chain, or None."""
    if traced(subject):
        return None
    if isinstance(subject, Scenario):
        chains = [(f"the sight of anchor {link.name}", link.sight) for link in subject.links]
    else:
        chains = [(f"chain {c}", chain) for c, chain in enumerate(subject.chains)]
    for name, chain in chains:
        transitions = np.asarray(chain.transitions(subject.times.intervals))  # raises if the times do not suit
        try:
            check_probabilities(np.asarray(chain.start), "its start")
            check_probabilities(transitions, "its transition")
        except InputError as error:
            return f"{name} is no Markov chain: {error.cause}"
    return None


@double_precision
def no_gaussian_motion(subject: Scenario | JumpMarkov) -> str | None:
    """Why F and Q do not describe linear Gaussian motion, or None; a density is another matter."""
    if traced(subject) or isinstance(subject.motion, DensityMotion):
        return None
    motion, intervals = subject.motion, np.asarray(subject.times.intervals)
    motions = motion.motions if isinstance(motion, SwitchingMotion) else motion
    for one in motions if isinstance(motions, tuple) else (motions,):
        F, Q = np.asarray(one.transitions(intervals)), np.asarray(one.covariances(intervals))
        if not (np.all(np.isfinite(F)) and np.all(np.isfinite(Q))):
            return "the motion has numbers that are not finite"
        for first in np.unique(Q, axis=0, return_index=True)[1]:
            if not is_positive_semidefinite(Q[first]):
                dt = intervals[first]
                return f"the motion's Q has a negative variance in some direction, for an interval of {dt:.4g} s"
    return None


def _irregular(model: JumpMarkov, finite: bool | None) -> str | None:
    for c, channel in enumerate(model.channels):
        for noise in channel.noises if isinstance(channel, AdditiveChannel) else ():
            regularity = noise.regularity()
            if regularity.finite is finite:
                what = "has no finite" if finite is False else "is not known to have a finite"
                return f"the noise of channel {c} {what} Fisher information: {regularity.reason}"
    return None


def irregular_channel(model: JumpMarkov) -> str | None:
    """Why the Fisher information of some channel's noise does not exist, or None."""
    return _irregular(model, False)


def undecided_channel(model: JumpMarkov) -> str | None:
    """Why it cannot be decided whether the Fisher information of some channel's noise exists, or None."""
    return _irregular(model, None)


def declared(model: JumpMarkov) -> str | None:
    """What the user's own densities have to fulfil, and nobody can see from outside, or None."""
    own = [f"channel {c}" for c, channel in enumerate(model.channels) if not isinstance(channel, AdditiveChannel)]
    own += ["the motion"] * isinstance(model.motion, DensityMotion)
    own += ["the prior"] * isinstance(model.prior, DensityPrior)
    if not own:
        return None
    return (
        f"declared by the user, not decided: the log-density of {', '.join(own)} is normalised, smooth, vanishes where "
        "it ends, and is the law that is sampled"
    )


MARKOV_CHAINS = Assumption("the sight of every link is a Markov chain of its own", no_chain)
GAUSSIAN_MOTION = Assumption("the motion is linear with Gaussian noise, Q positive semidefinite", no_gaussian_motion)
LINEAR_MOTION = Assumption("motion and prior are linear Gaussian without modes", no_linear_motion)
LINEAR_CHANNELS = Assumption(
    "what is measured is linear in the state, plus noise that may depend on modes", no_linear_channel
)
SMOOTH_CHANNELS = Assumption(SMOOTH_NOISE.text, irregular_channel, undecided_channel)
OWN_DENSITIES = Assumption(
    "log-densities of the user's own are normalised, smooth, and those of their samplers",
    lambda model: None,
    trusted=declared,
)
