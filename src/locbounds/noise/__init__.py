"""Measurement noise of one link in one sight condition."""

from locbounds.noise.base import Noise, Regularity
from locbounds.noise.gaussian import Gaussian
from locbounds.noise.gaussian_mixture import GaussianMixture

__all__ = ["Gaussian", "GaussianMixture", "Noise", "Regularity"]
