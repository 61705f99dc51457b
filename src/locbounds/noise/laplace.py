"""Laplace noise."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.noise.base import Noise, finite, positive
from locbounds.noise.exponential import REACH
from locbounds.noise.singularity import Singularity
from locbounds.precision import float64, traced

_BREAKS = np.concatenate([-REACH[:0:-1], REACH])


class Laplace(Noise):
    """Symmetric noise with exponential tails and a kink in the middle: regular, see ``regularity``.

    Parameters
    ----------
    center
        Centre of symmetry in metres.
    scale
        Mean absolute deviation in metres, positive.

    Raises
    ------
    InputError
        If a number is not finite or the scale is not positive.

    Examples
    --------
    >>> print(Laplace(0.0, 1.0).regularity())
    regular: Laplace: a kink at 0 m, exponent 1: finite there, but only as E[score^2], not as -E[d score]
    """

    center: Scalar = eqx.field(converter=float64)
    scale: Scalar = eqx.field(converter=float64)

    def __init__(self, center, scale):
        self.center, self.scale = center, scale

    def __check_init__(self):
        if traced(self):
            return
        finite("center", self.center)
        positive("scale", self.scale)

    @property
    def mean(self) -> Scalar:
        return self.center

    @property
    def variance(self) -> Scalar:
        return 2 * self.scale**2

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return -jnp.abs(jnp.asarray(w) - self.center) / self.scale - jnp.log(2 * self.scale)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return self.center + self.scale * jax.random.laplace(key, shape)

    def landmarks(self) -> Float[Array, " k"]:
        return self.center + self.scale * jnp.asarray(_BREAKS)

    def corners(self) -> Float[Array, " k"]:
        return jnp.reshape(jnp.asarray(self.center), (1,))

    def singularities(self) -> tuple[Singularity, ...]:
        change = -0.5 / float(self.scale) ** 2
        return (Singularity(float(self.center), 1.0, change, change),)

    def information(self) -> Scalar:
        return 1 / self.scale**2

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        t = (jnp.asarray(w) - self.center) / self.scale
        tail = 0.5 * jnp.exp(-jnp.abs(t))
        return jnp.where(t > 0, 1 - tail, tail)

    def quantile(self, q: Float[Array, "*n"]) -> Float[Array, "*n"]:
        q = jnp.asarray(q)
        tail = jnp.minimum(q, 1 - q)
        return self.center + self.scale * jnp.sign(q - 0.5) * -jnp.log(2 * tail)
