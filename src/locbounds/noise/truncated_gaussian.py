"""Gaussian noise cut to an interval."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import log_ndtr, ndtri

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.noise.base import BREAKS, Noise, finite, positive
from locbounds.noise.singularity import Pieces, Singularity
from locbounds.noise.special import log_normal_density, log_normal_interval
from locbounds.precision import float64, traced

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
LEAST_MASS = -600.0  # logarithm: below it the truncation leaves nothing that double precision can hold


class TruncatedGaussian(Noise):
    """Gaussian noise given that it lies between two limits.

    The density jumps at every finite limit: its Fisher information is infinite.

    Parameters
    ----------
    center, std
        Mean and standard deviation in metres of the Gaussian before it is cut.
    low, high
        Limits in metres; one of them may be infinite.

    Raises
    ------
    InputError
        If a number makes no sense or the limits leave no mass.

    Examples
    --------
    Cut at two deviations, as in Prieto et al. (2011), eq. 3:

    >>> noise = TruncatedGaussian(0.0, 1.6, -3.2, 3.2)
    >>> noise.regularity().status
    'irregular'
    """

    center: Scalar = eqx.field(converter=float64)
    std: Scalar = eqx.field(converter=float64)
    low: Scalar = eqx.field(converter=float64)
    high: Scalar = eqx.field(converter=float64)

    def __init__(self, center, std, low=-np.inf, high=np.inf):
        self.center, self.std, self.low, self.high = center, std, low, high

    def __check_init__(self):
        if traced(self):
            return
        finite("center", self.center)
        positive("standard deviation", self.std)
        if np.shape(self.low) or np.shape(self.high) or not self.low < self.high:
            raise InputError(f"truncation limits are {self.low} and {self.high} m", "Give low < high, in metres")
        if self._log_mass() < LEAST_MASS:
            raise InputError(
                f"the limits {self.low} to {self.high} m leave no mass of a Gaussian at {self.center} m with deviation "
                f"{self.std} m",
                "Move the limits towards the center",
            )

    def _log_mass(self) -> Scalar:
        return log_normal_interval((self.low - self.center) / self.std, (self.high - self.center) / self.std)

    @property
    def mean(self) -> Scalar:
        return self._moments()[0]

    @property
    def variance(self) -> Scalar:
        return self._moments()[1]

    def _moments(self) -> tuple[Scalar, Scalar]:
        """By quadrature from the mode, as the closed forms cancel in the tails and in short intervals."""
        xp = jnp if traced(self) else np
        places = self._places(xp)
        half = 0.5 * xp.diff(places)
        w = 0.5 * (places[1:] + places[:-1])[:, None] + half[:, None] * _NODES
        u = (w - self.center) / self.std
        p = half[:, None] * _WEIGHTS * xp.exp(-0.5 * u**2 + 0.5 * xp.min(u**2))
        mode = self._mode(xp)
        offset = xp.sum(p * (w - mode)) / xp.sum(p)
        return mode + offset, xp.sum(p * (w - mode - offset) ** 2) / xp.sum(p)

    def _mode(self, xp: Any) -> Scalar:
        return xp.clip(xp.asarray(self.center), self.low, self.high)

    def _places(self, xp: Any) -> Float[Array, " k"]:
        mode = self._mode(xp)
        steep = xp.maximum(1.0, xp.abs(mode - self.center) / self.std)  # far in a tail the law is exponential
        return xp.clip(mode + self.std / steep * BREAKS, self.low, self.high)

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        log_p = log_normal_density((w - self.center) / self.std) - jnp.log(self.std) - self._log_mass()
        return jnp.where((w >= self.low) & (w <= self.high), log_p, -jnp.inf)

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        return self.quantile(jax.random.uniform(key, shape))

    def landmarks(self) -> Float[Array, " k"]:
        return self._places(jnp)

    def support(self) -> Pieces:
        return ((float(self.low), float(self.high)),)

    def singularities(self) -> tuple[Singularity, ...]:
        mass = self._log_mass()

        def height(end: Any) -> float:
            return float(np.exp(log_normal_density((end - self.center) / self.std) - mass) / self.std)

        found = []
        if np.isfinite(self.low):
            found.append(Singularity(float(self.low), 0.0, 0.0, height(self.low)))
        if np.isfinite(self.high):
            found.append(Singularity(float(self.high), 0.0, height(self.high), 0.0))
        return tuple(found)

    def log_interval(self, a: Array, b: Array, width: Array | None = None) -> Array:
        """``log Pr(a < w < b)``, tail-safe; ``width`` is ``b - a`` within the limits, where the caller knows it."""
        a, b = jnp.maximum(a, self.low), jnp.minimum(b, self.high)
        there = b > a if width is None else width > 0
        d = jnp.where(there, b - a if width is None else width, 1.0) / self.std
        inside = log_normal_interval((a - self.center) / self.std, (b - self.center) / self.std, d)
        return jnp.where(there, inside - self._log_mass(), -jnp.inf)

    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        return jnp.exp(self.log_interval(jnp.full(jnp.shape(w), self.low), jnp.asarray(w)))

    def quantile(self, q: Float[Array, "*n"]) -> Float[Array, "*n"]:
        a, b = (self.low - self.center) / self.std, (self.high - self.center) / self.std
        upper = a + b > 0
        q = jnp.where(upper, 1 - jnp.asarray(q), jnp.asarray(q))
        a, b = jnp.where(upper, -b, a), jnp.where(upper, -a, b)
        below, total = jnp.exp(log_ndtr(a)), jnp.exp(log_ndtr(b))
        u = jnp.where(upper, -1.0, 1.0) * ndtri(below + q * (total - below))
        return jnp.clip(self.center + self.std * u, self.low, self.high)
