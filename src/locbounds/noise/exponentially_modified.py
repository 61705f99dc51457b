"""Gaussian noise with an exponential excess."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import log_ndtr, ndtr

from locbounds.axes import Array, Float, Scalar
from locbounds.noise.base import BREAKS, Noise, finite, positive
from locbounds.noise.exponential import REACH
from locbounds.noise.singularity import Singularity
from locbounds.noise.special import log_normal_density
from locbounds.precision import float64, traced

FAR_OUT = 30.0
SERIES = np.append(np.cumprod(-np.arange(1.0, 16.0, 2.0))[::-1], 0.0)  # -1, 3, -15, ... of 1/x^2, highest first


def log_tail(x: Array) -> Array:
    """``log(Phi(-x) / phi(x))``, the logarithm of the Mills ratio, without cancellation in either tail.

    Far out by its asymptotic series ``(1 - 1/x^2 + 3/x^4 - 15/x^6 ...) / x``: JAX's ``erfcx`` is zero near 26.6.
    """
    from jax.scipy.special import erfcx

    middle = jnp.where((x > 0) & (x <= FAR_OUT), x, 1.0)
    middle = jnp.log(erfcx(middle / jnp.sqrt(2.0))) + 0.5 * jnp.log(jnp.pi / 2)
    far = jnp.where(x > FAR_OUT, x, FAR_OUT)
    far = jnp.log1p(jnp.polyval(SERIES, 1 / far**2)) - jnp.log(far)
    small = jnp.where(x > 0, 0.0, x)
    below = log_ndtr(-small) - log_normal_density(small)
    return jnp.where(x > FAR_OUT, far, jnp.where(x > 0, middle, below))


class ExponentiallyModifiedGaussian(Noise):
    r"""Sum of Gaussian noise and an independent exponential excess.

    ``log p(w) = -log(scale) + log phi(u) + log M(std/scale - u)`` with ``u = (w - center)/std``, phi the standard
    normal density and M(x) = (1 - Phi(x))/phi(x) the Mills ratio: nothing cancels in the tails.

    Parameters
    ----------
    center, std
        Mean and standard deviation of the Gaussian part in metres.
    scale
        Mean of the exponential part in metres.

    Raises
    ------
    InputError
        If a number is not finite, or std or scale not positive.

    Examples
    --------
    >>> noise = ExponentiallyModifiedGaussian(0.0, 1.0, 5.0)
    >>> float(noise.mean), float(noise.variance)
    (5.0, 26.0)
    """

    center: Scalar = eqx.field(converter=float64)
    std: Scalar = eqx.field(converter=float64)
    scale: Scalar = eqx.field(converter=float64)

    def __init__(self, center, std, scale):
        self.center, self.std, self.scale = center, std, scale

    def __check_init__(self):
        if traced(self):
            return
        finite("center", self.center)
        positive("standard deviation", self.std)
        positive("scale", self.scale)

    @property
    def mean(self) -> Scalar:
        return self.center + self.scale

    @property
    def variance(self) -> Scalar:
        return self.std**2 + self.scale**2

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        u = (jnp.asarray(w) - self.center) / self.std
        return log_normal_density(u) + log_tail(self.std / self.scale - u) - jnp.log(self.scale)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        normal, excess = jax.random.split(key)
        w = self.center + self.std * jax.random.normal(normal, shape)
        return w + self.scale * jax.random.exponential(excess, shape)

    def landmarks(self) -> Float[Array, " k"]:
        return jnp.sort(
            jnp.concatenate([self.center + self.std * jnp.asarray(BREAKS), self.center + self.scale * REACH])
        )

    def singularities(self) -> tuple[Singularity, ...]:
        return ()

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        u = (jnp.asarray(w) - self.center) / self.std
        return ndtr(u) - jnp.exp(log_normal_density(u) + log_tail(self.std / self.scale - u))
