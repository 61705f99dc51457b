"""Gaussian noise."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import ndtr, ndtri

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.noise.base import Noise
from locbounds.noise.regularity import Regularity
from locbounds.noise.singularity import Singularity
from locbounds.precision import float64, traced


class Gaussian(Noise):
    """Gaussian noise.

    Parameters
    ----------
    mean
        Mean in metres.
    std
        Standard deviation in metres, positive.

    Raises
    ------
    InputError
        If the standard deviation is not positive or a number is not finite.

    Examples
    --------
    >>> float(Gaussian(0.0, 150.0).information() * 150.0**2)
    1.0
    """

    mean: Scalar = eqx.field(converter=float64)
    std: Scalar = eqx.field(converter=float64)

    def __check_init__(self):
        if traced(self.mean, self.std):
            return
        if not np.all(np.isfinite(self.mean)):
            raise InputError(f"noise mean is {self.mean}", "Give a finite number of metres")
        if not (np.all(np.isfinite(self.std)) and np.all(self.std > 0)):
            raise InputError(f"noise standard deviation is {self.std} m", "Give a positive number of metres")

    @property
    def variance(self) -> Scalar:
        return self.std**2

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return -0.5 * ((w - self.mean) / self.std) ** 2 - jnp.log(self.std) - 0.5 * jnp.log(2 * jnp.pi)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return self.mean + self.std * jax.random.normal(key, shape)

    def information(self) -> Scalar:
        return 1.0 / self.std**2

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return ndtr((jnp.asarray(w) - self.mean) / self.std)

    def quantile(self, q: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return self.mean + self.std * ndtri(jnp.asarray(q))

    def components(self) -> tuple[Float[Array, " c"], Float[Array, " c"], Float[Array, " c"]]:
        return jnp.ones(1), jnp.reshape(self.mean, 1), jnp.reshape(self.variance, 1)

    def singularities(self) -> tuple[Singularity, ...]:
        return ()

    def regularity(self) -> Regularity:
        return Regularity(True, "Gaussian density: smooth on the whole line")
