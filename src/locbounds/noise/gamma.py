"""Gamma excess."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import gammainc, gammaln

from locbounds.axes import Array, Float, Scalar
from locbounds.noise.base import Noise, finite, positive
from locbounds.noise.singularity import Pieces, Singularity
from locbounds.precision import float64, traced

_EDGE = 2.0 ** -np.arange(60, 0, -1.0)
_BODY = np.linspace(1, 40, 79)


class Gamma(Noise):
    """One-sided skewed excess, ``p(start + t) ~ t^(shape-1) exp(-t/scale)``.

    Its Fisher information is ``1/(scale^2 (shape - 2))`` for a shape above 2 and infinite otherwise: the density then
    vanishes at its start like t or more slowly, jumps (shape 1) or is unbounded.

    Parameters
    ----------
    shape
        Shape, positive; 1 is exponential.
    scale
        Scale in metres, positive; the mean excess is ``shape * scale``.
    start
        Smallest value in metres.

    Raises
    ------
    InputError
        If a number is not finite, or shape or scale not positive.

    Examples
    --------
    >>> [Gamma(shape, 1.0).regularity().status for shape in (0.5, 1.0, 2.0, 2.1)]
    ['irregular', 'irregular', 'irregular', 'regular']
    """

    shape: Scalar = eqx.field(converter=float64)
    scale: Scalar = eqx.field(converter=float64)
    start: Scalar = eqx.field(converter=float64)

    def __init__(self, shape, scale, start=0.0):
        self.shape, self.scale, self.start = shape, scale, start

    def __check_init__(self):
        if traced(self):
            return
        positive("shape", self.shape, "")
        positive("scale", self.scale)
        finite("start", self.start)

    @property
    def mean(self) -> Scalar:
        return self.start + self.shape * self.scale

    @property
    def variance(self) -> Scalar:
        return self.shape * self.scale**2

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        t = (jnp.asarray(w) - self.start) / self.scale
        safe = jnp.where(t > 0, t, 1.0)
        log_p = (self.shape - 1) * jnp.log(safe) - safe - gammaln(self.shape) - jnp.log(self.scale)
        return jnp.where(t > 0, log_p, -jnp.inf)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return self.start + self.scale * jax.random.gamma(key, self.shape, shape)

    def landmarks(self) -> Float[Array, " k"]:
        reach = self.shape + 2 * jnp.sqrt(self.shape) + 1.0
        return self.start + self.scale * reach * jnp.concatenate([jnp.zeros(1), _EDGE, _BODY])

    def support(self) -> Pieces:
        return ((float(self.start), np.inf),)

    def singularities(self) -> tuple[Singularity, ...]:
        k, scale = float(self.shape), float(self.scale)
        height = np.exp(-_log_gamma(k) - k * np.log(scale))
        return (Singularity(float(self.start), k - 1, 0.0, float(height)),)

    def information(self) -> Scalar:
        k = jnp.asarray(self.shape)
        return jnp.where(k > 2, 1 / jnp.where(k > 2, k - 2, 1.0), jnp.inf) / self.scale**2

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return gammainc(self.shape, jnp.maximum((jnp.asarray(w) - self.start) / self.scale, 0.0))


def _log_gamma(k: float) -> float:
    from math import lgamma

    return lgamma(k)
