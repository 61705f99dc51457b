"""What every noise offers."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.noise.regularity import Regularity, declared
from locbounds.noise.singularity import Pieces, Singularity
from locbounds.precision import double_precision, traced

EVERYWHERE: Pieces = ((-np.inf, np.inf),)
BREAKS = np.array([-40, -20, -10, -8, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6, 8, 10, 20, 40.0])  # in deviations
IN_DOUBLE = {"mean", "variance", "log_prob", "sample", "information", "score", "expect", "cdf", "quantile"}
HALVINGS = 60  # bisections of a bracket of landmarks: below the spacing of doubles
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


class Noise(eqx.Module):
    """Additive noise ``w`` in ``z = h(x) + w``, in metres, with a known density.

    A new noise implements ``mean``, ``variance``, ``log_prob`` and ``sample``. The score comes from autodiff of the
    log-density; distribution function, quantiles and information come from quadrature between ``landmarks``. A density
    that is not smooth on the whole line declares its ``support`` and its ``singularities``; a law that declares
    nothing is examined as a black box (:mod:`locbounds.noise.black_box`).

    ``a + b`` is the law of the sum of two independent noises. What a user asks of a noise is computed in double
    precision, also in classes of one's own.
    """

    mean: eqx.AbstractVar[Scalar]

    def __init_subclass__(cls, **kwargs):
        for name in IN_DOUBLE & vars(cls).keys():
            own = vars(cls)[name]
            if isinstance(own, property) and own.fget:
                setattr(cls, name, property(double_precision(own.fget), doc=own.__doc__))
            elif callable(own):
                setattr(cls, name, double_precision(own))
        super().__init_subclass__(**kwargs)

    @property
    @abstractmethod
    def variance(self) -> Scalar:
        """Variance in square metres."""

    @abstractmethod
    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Log-density at ``w``, elementwise; minus infinity outside the support."""

    @abstractmethod
    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        """Independent draws of the given shape."""

    def support(self) -> Pieces:
        """Open intervals on which the density is positive, in metres; needs numbers, not tracers."""
        return EVERYWHERE

    def singularities(self) -> tuple[Singularity, ...] | None:
        """Where the density is not smooth; None: not declared."""
        return None

    def landmarks(self) -> Float[Array, " k"]:
        """Ordered places that hold practically all mass between them; the density is smooth in between."""
        return self.mean + jnp.sqrt(self.variance) * BREAKS

    def corners(self) -> Float[Array, " k"]:
        """Places where the density of a sum with another law may be less smooth: ends and singularities."""
        places = self.landmarks()
        return jnp.stack([places[0], places[-1]])

    def components(self) -> tuple[Float[Array, " c"], Float[Array, " c"], Float[Array, " c"]]:
        """Weights, means and variances of the Gaussian mixture that a Kalman-type filter uses for this noise.

        Unless a law is a Gaussian mixture itself, this is the Gaussian of the same mean and variance.
        """
        xp = jnp if traced(self) else np
        return xp.ones(1), xp.reshape(xp.asarray(self.mean), (1,)), xp.reshape(xp.asarray(self.variance), (1,))

    def regularity(self) -> Regularity:
        """Whether the Fisher information about a shift exists."""
        if traced(self):
            return Regularity(None, f"{type(self).__name__}: its numbers are being traced by JAX")
        places = self.singularities()
        if places is None:
            from locbounds.noise.black_box import examine

            return examine(self)
        return declared(places, self.support(), type(self).__name__)

    @double_precision
    def information(self) -> Scalar:
        """Intrinsic accuracy ``E[score(w)^2]`` in 1/m^2: the Fisher information about a shift; may be infinite."""
        if not traced(self) and self.regularity().finite is False:
            return np.inf
        return _accuracy(self)

    @double_precision
    def score(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Location score ``-d log p(w) / dw``, elementwise: the derivative of ``log p(z - h)`` with respect to h."""
        w = jnp.asarray(w)
        return -jax.jvp(self.log_prob, (w,), (jnp.ones_like(w),))[1]

    @double_precision
    def expect(self, function: Callable[[Array], Array]) -> Scalar:
        """Mean of a function of the noise, by Gauss-Legendre quadrature between landmarks."""
        places = self.landmarks()
        half = 0.5 * jnp.diff(places)
        w = 0.5 * (places[1:] + places[:-1])[:, None] + half[:, None] * _NODES
        log_p = self.log_prob(w)
        there = log_p > -700.0  # below this the density underflows
        likely = w.ravel()[jnp.argmax(log_p)]
        values = jnp.where(there, function(jnp.where(there, w, likely)), 0.0)
        return jnp.sum(half[:, None] * _WEIGHTS * jnp.where(there, jnp.exp(log_p), 0.0) * values)

    @double_precision
    def cdf(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Distribution function, elementwise."""
        return self._mass_below(jnp.asarray(w))

    @double_precision
    def quantile(self, q: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Inverse of the distribution function, elementwise; bisection between landmarks."""
        q, places = jnp.asarray(q), self.landmarks()
        i = jnp.clip(jnp.searchsorted(self.cdf(places), q), 1, len(places) - 1)
        bracket = places[i - 1], places[i]

        def halve(_: Any, bracket: tuple[Array, Array]) -> tuple[Array, Array]:
            low, high = bracket
            middle = 0.5 * (low + high)
            below = self.cdf(middle) < q
            return jnp.where(below, middle, low), jnp.where(below, high, middle)

        low, high = jax.lax.fori_loop(0, HALVINGS, halve, bracket)
        return 0.5 * (low + high)

    def _mass_below(self, w: Array) -> Array:
        """Masses of whole panels between landmarks, and of the part of the last one."""
        places = self.landmarks()

        def mass(low: Array, high: Array) -> Array:
            half = 0.5 * (high - low)
            x = (0.5 * (high + low))[..., None] + half[..., None] * _NODES
            return half * jnp.sum(_WEIGHTS * jnp.exp(self.log_prob(x)), -1)

        below = jnp.concatenate([jnp.zeros(1), jnp.cumsum(mass(places[:-1], places[1:]))])
        w = jnp.clip(w, places[0], places[-1])
        i = jnp.clip(jnp.searchsorted(places, w, side="right") - 1, 0, len(places) - 2)
        return below[i] + mass(places[i], w)

    def __add__(self, other: Any) -> "Noise":
        from locbounds.noise.sums import add

        return add(self, other)

    def __radd__(self, other: Any) -> "Noise":
        return self + other


@jax.jit
def _accuracy(noise: Noise) -> Scalar:
    return noise.expect(lambda w: noise.score(w) ** 2)


def finite(name: str, value: Any, unit: str = "m") -> None:
    """Raise an InputError unless a parameter is one finite number."""
    if np.shape(value) != ():
        raise InputError(f"noise {name} has shape {np.shape(value)}", "Give one number")
    if not np.isfinite(value):
        raise InputError(f"noise {name} is {value}", f"Give a finite number{' of metres' if unit == 'm' else ''}")


def positive(name: str, value: Any, unit: str = "m") -> None:
    """Raise an InputError unless a parameter is one positive number."""
    finite_or_not = np.shape(value) == ()
    if not finite_or_not:
        raise InputError(f"noise {name} has shape {np.shape(value)}", "Give one number")
    if not (np.isfinite(value) and value > 0):
        raise InputError(
            f"noise {name} is {value}{' m' if unit == 'm' else ''}",
            f"Give a positive number{' of metres' if unit == 'm' else ''}",
        )
