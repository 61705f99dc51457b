"""Exponential excess."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.noise.base import Noise, finite, positive
from locbounds.noise.singularity import Pieces, Singularity
from locbounds.precision import float64, traced

REACH = np.array([0, 0.5, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 128, 256, 512, 700.0])


class Exponential(Noise):
    """One-sided excess with an exponential tail; it jumps at its start, so that its Fisher information is infinite.

    Parameters
    ----------
    scale
        Mean excess over ``start`` in metres, positive.
    start
        Smallest value in metres.

    Raises
    ------
    InputError
        If a number is not finite or the scale is not positive.

    Examples
    --------
    On top of Gaussian noise it is regular:

    >>> import locbounds as lb
    >>> (lb.Gaussian(0.0, 1.0) + Exponential(5.0)).regularity().status
    'regular'
    """

    scale: Scalar = eqx.field(converter=float64)
    start: Scalar = eqx.field(converter=float64)

    def __init__(self, scale, start=0.0):
        self.scale, self.start = scale, start

    def __check_init__(self):
        if traced(self):
            return
        positive("scale", self.scale)
        finite("start", self.start)

    @property
    def mean(self) -> Scalar:
        return self.start + self.scale

    @property
    def variance(self) -> Scalar:
        return self.scale**2

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        t = (jnp.asarray(w) - self.start) / self.scale
        return jnp.where(t >= 0, -t - jnp.log(self.scale), -jnp.inf)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return self.start + self.scale * jax.random.exponential(key, shape)

    def landmarks(self) -> Float[Array, " k"]:
        return self.start + self.scale * jnp.asarray(REACH)

    def support(self) -> Pieces:
        return ((float(self.start), np.inf),)

    def singularities(self) -> tuple[Singularity, ...]:
        return (Singularity(float(self.start), 0.0, 0.0, 1 / float(self.scale)),)

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return -jnp.expm1(-jnp.maximum((jnp.asarray(w) - self.start) / self.scale, 0.0))

    def quantile(self, q: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return self.start - self.scale * jnp.log1p(-jnp.asarray(q))

    def information(self) -> Scalar:
        return np.inf
