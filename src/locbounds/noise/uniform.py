"""Uniform noise."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.noise.base import Noise, finite
from locbounds.noise.singularity import Pieces, Singularity
from locbounds.precision import float64, traced


class Uniform(Noise):
    """Noise with equal density between two limits; it jumps at both, so that its Fisher information is infinite.

    Parameters
    ----------
    low, high
        Limits in metres.

    Raises
    ------
    InputError
        If the limits are not finite or not in order.

    Examples
    --------
    >>> Uniform(0.0, 3.0).regularity().reason
    'the density jumps at 0 m; and 1 more such place'
    """

    low: Scalar = eqx.field(converter=float64)
    high: Scalar = eqx.field(converter=float64)

    def __init__(self, low, high):
        self.low, self.high = low, high

    def __check_init__(self):
        if traced(self):
            return
        finite("low", self.low)
        finite("high", self.high)
        if not self.low < self.high:
            raise InputError(f"uniform noise from {self.low} to {self.high} m", "Give low < high, in metres")

    @property
    def mean(self) -> Scalar:
        return 0.5 * (self.low + self.high)

    @property
    def variance(self) -> Scalar:
        return (self.high - self.low) ** 2 / 12

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return jnp.where((w >= self.low) & (w <= self.high), -jnp.log(self.high - self.low), -jnp.inf)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return self.quantile(jax.random.uniform(key, shape))

    def landmarks(self) -> Float[Array, " k"]:
        return jnp.linspace(self.low, self.high, 5)

    def support(self) -> Pieces:
        return ((float(self.low), float(self.high)),)

    def singularities(self) -> tuple[Singularity, ...]:
        height = 1 / float(self.high - self.low)
        return Singularity(float(self.low), 0.0, 0.0, height), Singularity(float(self.high), 0.0, height, 0.0)

    def log_interval(self, a: Array, b: Array, width: Array | None = None) -> Array:
        """``log Pr(a < w < b)``; ``width`` is ``b - a`` within the limits, where the caller knows it."""
        inside = jnp.minimum(b, self.high) - jnp.maximum(a, self.low) if width is None else width
        safe = jnp.where(inside > 0, inside, 1.0)
        return jnp.where(inside > 0, jnp.log(safe) - jnp.log(self.high - self.low), -jnp.inf)

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return jnp.clip((jnp.asarray(w) - self.low) / (self.high - self.low), 0.0, 1.0)

    def quantile(self, q: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return self.low + jnp.asarray(q) * (self.high - self.low)

    def information(self) -> Scalar:
        return np.inf
