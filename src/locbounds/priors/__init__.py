"""What is known of the state before the first measurement."""

from locbounds.priors.density import DensityPrior
from locbounds.priors.gaussian import GaussianPrior

__all__ = ["DensityPrior", "GaussianPrior"]
