"""Whether the bound of a general model may be quoted: what is checked, and what only the user can know."""

from locbounds.model import AdditiveChannel, DensityMotion, JumpMarkov
from locbounds.priors import DensityPrior
from locbounds.verdict import Status, Verdict


def irregular_noise(model: JumpMarkov) -> str | None:
    """Why the Fisher information of some noise does not exist, or None."""
    for c, channel in enumerate(model.channels):
        for noise in channel.noises if isinstance(channel, AdditiveChannel) else ():
            regularity = noise.regularity()
            if regularity.finite is False:
                return f"the noise of channel {c} has no finite Fisher information: {regularity.reason}"
    return None


def undecided_noise(model: JumpMarkov) -> str | None:
    """Why it cannot be decided whether the Fisher information of some noise exists, or None."""
    for c, channel in enumerate(model.channels):
        for noise in channel.noises if isinstance(channel, AdditiveChannel) else ():
            regularity = noise.regularity()
            if regularity.finite is None:
                return f"channel {c}: {regularity.reason}"
    return None


def declared(model: JumpMarkov) -> tuple[str, ...]:
    """What the user's own densities have to fulfil, and nobody can see from outside."""
    own = [f"channel {c}" for c, channel in enumerate(model.channels) if not isinstance(channel, AdditiveChannel)]
    own += ["the motion"] * isinstance(model.motion, DensityMotion) + ["the prior"] * isinstance(
        model.prior, DensityPrior
    )
    if not own:
        return ()
    return (
        f"declared by the user, not decided: the log-density of {', '.join(own)} is normalised, smooth, vanishes where "
        "it ends, and is the law that is sampled",
    )


def model_verdict(model: JumpMarkov) -> Verdict:
    """Verdict of the BCRB for a general model.

    >>> import locbounds as lb
    >>> from locbounds.model import jump_markov
    >>> print(model_verdict(jump_markov(lb.papers.fritsche2013.scenario())))
    valid (Gaussian prior and motion; smooth noise)
    """
    violated = irregular_noise(model)
    if violated is not None:
        return Verdict(Status.REFUSED, (violated,))
    doubt = undecided_noise(model)
    if doubt is not None:
        return Verdict(Status.UNDECIDED, (doubt, *declared(model)))
    conditions = declared(model)
    if conditions:
        return Verdict(Status.CONDITIONAL, conditions)
    return Verdict(Status.VALID, ("Gaussian prior and motion", "smooth noise"))
