"""From a scenario to the general model."""

import equinox as eqx

from locbounds.axes import Array, Float, Scalar
from locbounds.measurement import BySight, Measurement
from locbounds.model.channels import AdditiveChannel
from locbounds.model.jump_markov import JumpMarkov
from locbounds.motion import SwitchingMotion
from locbounds.scenario import Scenario
from locbounds.sight import Sight


class LinkFunction(eqx.Module):
    """A link's measurement as a function of position, mode and step."""

    measurement: Measurement | BySight

    def __call__(self, x: Float[Array, " space"], mode: int, k: Array) -> Scalar:
        return self.measurement.under(mode)(x)


def jump_markov(scenario: Scenario) -> JumpMarkov:
    """A scenario as a general model: one channel per link, one chain per name (and per link without one).

    Parameters
    ----------
    scenario
        Any scenario.

    Examples
    --------
    >>> import locbounds as lb
    >>> model = jump_markov(lb.papers.fritsche2013.scenario())
    >>> len(model.channels), len(model.chains), model.switching
    (3, 3, False)
    """
    chains: list[Sight] = []
    named: dict[str, int] = {}

    def number(name: str | None, sight: Sight) -> int:
        if name is not None and name in named:
            return named[name]
        chains.append(sight)
        if name is not None:
            named[name] = len(chains) - 1
        return len(chains) - 1

    channels = [
        AdditiveChannel(
            LinkFunction(link.measurement),
            link.noises,
            chain=number(link.chain, link.sight),
            view=scenario.motion.position_index,
            reports=link.reports,
        )
        for link in scenario.links
    ]
    motion, motion_chain = scenario.motion, 0
    if isinstance(motion, SwitchingMotion):
        motion_chain = number(motion.chain, motion.sight)
        motion = motion.motions
    return JumpMarkov(
        times=scenario.times,
        prior=scenario.prior,
        motion=motion,
        channels=channels,
        chains=chains,
        motion_chain=motion_chain,
        title=scenario.title,
    )
