"""Student's t noise."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import betainc, gammaln

from locbounds.axes import Array, Float, Scalar
from locbounds.noise.base import Noise, finite, positive
from locbounds.noise.singularity import Singularity
from locbounds.precision import float64, traced

_BREAKS = np.sinh(np.linspace(-60, 60, 97))  # in scales: to 1e26
_UPPER_QUARTILE = 0.6744897501960817  # of the standard normal law


class StudentT(Noise):
    """Symmetric noise with heavy tails.

    Parameters
    ----------
    degrees
        Degrees of freedom, positive: 1 is Cauchy, infinity Gaussian.
    center
        Centre of symmetry in metres.
    scale
        Scale in metres, positive; not the standard deviation, which is ``scale sqrt(degrees/(degrees - 2))``.

    Raises
    ------
    InputError
        If a number is not finite, or degrees or scale not positive.

    Notes
    -----
    The mean exists for more than one degree of freedom, the variance for more than two; elsewhere ``mean`` is the
    centre of symmetry and ``variance`` infinite. Kalman-type filters then see the Gaussian with the same quartiles.

    Examples
    --------
    The information of Cauchy noise is 1/2 although it has no variance:

    >>> float(StudentT(1.0, 0.0, 1.0).information())
    0.5
    """

    degrees: Scalar = eqx.field(converter=float64)
    center: Scalar = eqx.field(converter=float64)
    scale: Scalar = eqx.field(converter=float64)

    def __init__(self, degrees, center, scale):
        self.degrees, self.center, self.scale = degrees, center, scale

    def __check_init__(self):
        if traced(self):
            return
        positive("degrees of freedom", self.degrees, "")
        finite("center", self.center)
        positive("scale", self.scale)

    @property
    def mean(self) -> Scalar:
        return self.center

    @property
    def variance(self) -> Scalar:
        nu = jnp.asarray(self.degrees)
        return jnp.where(nu > 2, self.scale**2 * nu / jnp.where(nu > 2, nu - 2, 1.0), jnp.inf)

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        nu, u = self.degrees, (jnp.asarray(w) - self.center) / self.scale
        constant = gammaln(0.5 * (nu + 1)) - gammaln(0.5 * nu) - 0.5 * jnp.log(nu * jnp.pi) - jnp.log(self.scale)
        return constant - 0.5 * (nu + 1) * jnp.log1p(u**2 / nu)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return self.center + self.scale * jax.random.t(key, self.degrees, shape)

    def landmarks(self) -> Float[Array, " k"]:
        return self.center + self.scale * jnp.asarray(_BREAKS)

    def singularities(self) -> tuple[Singularity, ...]:
        return ()

    def information(self) -> Scalar:
        return (self.degrees + 1) / (self.degrees + 3) / self.scale**2

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        u = (jnp.asarray(w) - self.center) / self.scale
        tail = 0.5 * betainc(0.5 * self.degrees, 0.5, self.degrees / (self.degrees + u**2))
        return jnp.where(u > 0, 1 - tail, tail)

    def components(self) -> tuple[Float[Array, " c"], Float[Array, " c"], Float[Array, " c"]]:
        quartile = self.quantile(jnp.asarray(0.75)) - self.center
        variance = jnp.where(jnp.asarray(self.degrees) > 2, self.variance, (quartile / _UPPER_QUARTILE) ** 2)
        return jnp.ones(1), jnp.reshape(jnp.asarray(self.center), (1,)), jnp.reshape(variance, (1,))
