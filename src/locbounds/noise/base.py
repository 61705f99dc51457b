"""What every noise offers."""

from abc import abstractmethod
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from locbounds.axes import Array, Float, Scalar


class Regularity(NamedTuple):
    """Whether the location family of a density has a finite Fisher information, and why."""

    finite: bool
    reason: str


class Noise(eqx.Module):
    """Additive noise ``w`` in ``z = h(x) + w``, in metres, with a known density.

    A new noise implements the abstract members below; the score comes from autodiff of the log-density.
    """

    mean: eqx.AbstractVar[Scalar]

    @property
    @abstractmethod
    def variance(self) -> Scalar:
        """Variance in square metres."""

    @abstractmethod
    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Log-density at ``w``, elementwise."""

    @abstractmethod
    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        """Independent draws of the given shape."""

    @abstractmethod
    def information(self) -> Scalar:
        """Intrinsic accuracy ``E[score(w)^2]`` in 1/m^2: the Fisher information about a shift."""

    @abstractmethod
    def components(self) -> tuple[Float[Array, " c"], Float[Array, " c"], Float[Array, " c"]]:
        """Weights, means and variances of the Gaussian mixture that a Kalman-type filter uses for this noise."""

    @abstractmethod
    def regularity(self) -> Regularity:
        """Whether the Fisher information about a shift exists."""

    def score(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Location score ``-d log p(w) / dw``, elementwise: the derivative of ``log p(z - h)`` with respect to h."""
        w = jnp.asarray(w)
        return -jax.jvp(self.log_prob, (w,), (jnp.ones_like(w),))[1]
