"""Log-normal excess."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import ndtr, ndtri

from locbounds.axes import Array, Float, Scalar
from locbounds.noise.base import Noise, finite, positive
from locbounds.noise.singularity import Pieces, Singularity
from locbounds.noise.special import log_normal_density
from locbounds.precision import float64, traced

_BREAKS = np.linspace(-40, 40, 161)


class LogNormal(Noise):
    """One-sided skewed excess whose logarithm is Gaussian.

    All derivatives of the density vanish at its start: it is smooth, and its information
    ``exp(2 s^2 - 2 m) (1 + 1/s^2)``, with m the logarithm of the median and s ``log_std``, is finite, if often huge.

    Parameters
    ----------
    median
        Median excess over ``start`` in metres, positive.
    log_std
        Standard deviation of the natural logarithm of the excess, positive.
    start
        Smallest value in metres.

    Raises
    ------
    InputError
        If a number is not finite, or median or log_std not positive.

    Examples
    --------
    >>> float(LogNormal(1.0, 1.0).information())
    14.778112
    """

    median: Scalar = eqx.field(converter=float64)
    log_std: Scalar = eqx.field(converter=float64)
    start: Scalar = eqx.field(converter=float64)

    def __init__(self, median, log_std, start=0.0):
        self.median, self.log_std, self.start = median, log_std, start

    def __check_init__(self):
        if traced(self):
            return
        positive("median", self.median)
        positive("log_std", self.log_std, "")
        finite("start", self.start)

    @property
    def mean(self) -> Scalar:
        return self.start + self.median * jnp.exp(0.5 * self.log_std**2)

    @property
    def variance(self) -> Scalar:
        return self.median**2 * jnp.exp(self.log_std**2) * jnp.expm1(self.log_std**2)

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        t = (jnp.asarray(w) - self.start) / self.median
        log_t = jnp.log(jnp.where(t > 0, t, 1.0))
        log_p = log_normal_density(log_t / self.log_std) - log_t - jnp.log(self.log_std * self.median)
        return jnp.where(t > 0, log_p, -jnp.inf)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return self.start + self.median * jnp.exp(self.log_std * jax.random.normal(key, shape))

    def landmarks(self) -> Float[Array, " k"]:
        u = jnp.exp(jnp.clip(self.log_std * _BREAKS, -600.0, 600.0))
        return self.start + self.median * jnp.concatenate([jnp.zeros(1), u])

    def support(self) -> Pieces:
        return ((float(self.start), np.inf),)

    def singularities(self) -> tuple[Singularity, ...]:
        return ()

    def information(self) -> Scalar:
        return jnp.exp(2 * self.log_std**2) * (1 + 1 / self.log_std**2) / self.median**2

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        t = (jnp.asarray(w) - self.start) / self.median
        return jnp.where(t > 0, ndtr(jnp.log(jnp.where(t > 0, t, 1.0)) / self.log_std), 0.0)

    def quantile(self, q: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return self.start + self.median * jnp.exp(self.log_std * ndtri(jnp.asarray(q)))
