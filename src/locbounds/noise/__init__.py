"""Measurement noise of one link in one sight condition."""

from locbounds.noise.base import Noise
from locbounds.noise.convolution import Convolution
from locbounds.noise.epoch import Epoch
from locbounds.noise.exponential import Exponential
from locbounds.noise.exponentially_modified import ExponentiallyModifiedGaussian
from locbounds.noise.from_log_density import FromLogDensity, FromNumPyro
from locbounds.noise.gamma import Gamma
from locbounds.noise.gaussian import Gaussian
from locbounds.noise.gaussian_mixture import GaussianMixture
from locbounds.noise.laplace import Laplace
from locbounds.noise.log_normal import LogNormal
from locbounds.noise.mixture import Mixture
from locbounds.noise.regularity import Regularity
from locbounds.noise.shifted_copies import bhattacharyya, minimum_error
from locbounds.noise.singularity import Finding, Singularity
from locbounds.noise.student_t import StudentT
from locbounds.noise.sum_of_two import Sum, TruncatedGaussianSum, UniformSum
from locbounds.noise.truncated_gaussian import TruncatedGaussian
from locbounds.noise.uniform import Uniform

__all__ = [
    "Convolution",
    "Epoch",
    "Exponential",
    "ExponentiallyModifiedGaussian",
    "Finding",
    "FromLogDensity",
    "FromNumPyro",
    "Gamma",
    "Gaussian",
    "GaussianMixture",
    "Laplace",
    "LogNormal",
    "Mixture",
    "Noise",
    "Regularity",
    "Singularity",
    "StudentT",
    "Sum",
    "TruncatedGaussian",
    "TruncatedGaussianSum",
    "Uniform",
    "UniformSum",
    "bhattacharyya",
    "minimum_error",
]
