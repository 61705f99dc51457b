"""Jump-Markov models beyond links and sights: a density, a motion or a measurement that nobody foresaw."""

from locbounds.model.channels import AdditiveChannel, Channel, DensityChannel
from locbounds.model.density_motion import DensityMotion
from locbounds.model.from_scenario import jump_markov
from locbounds.model.jump_markov import JumpMarkov

__all__ = ["AdditiveChannel", "Channel", "DensityChannel", "DensityMotion", "JumpMarkov", "jump_markov"]
