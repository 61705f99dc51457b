"""What is known of the state, or of a static position, before the first measurement."""

from locbounds.priors.density import DensityPrior
from locbounds.priors.gaussian import GaussianPrior
from locbounds.priors.mixture import PriorMixture
from locbounds.priors.polygon import UniformPolygon
from locbounds.priors.position import PositionPrior
from locbounds.priors.prism import Prism
from locbounds.priors.uniform import UniformBox, UniformDisc, UniformPrior

__all__ = [
    "DensityPrior",
    "GaussianPrior",
    "PositionPrior",
    "PriorMixture",
    "Prism",
    "UniformBox",
    "UniformDisc",
    "UniformPolygon",
    "UniformPrior",
]
