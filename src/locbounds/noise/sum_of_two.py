r"""Sum of two independent noises, for example measurement noise and a bias.

``p(e) = int p_1(x) p_2(e - x) dx``. The closed forms are exact up to rounding, also next to the ends of the support,
where differences of distribution functions cancel: the length of the interval of integration is computed without
cancellation (:func:`locbounds.noise.special.two_sum`) and the integral over it by
:func:`locbounds.noise.special.log_normal_interval`.
"""

from abc import abstractmethod

import equinox as eqx
import jax
import jax.numpy as jnp

from locbounds.axes import Array, Float, Scalar
from locbounds.noise.base import Noise
from locbounds.noise.regularity import Regularity, declared
from locbounds.noise.singularity import Pieces, Singularity, of_sum, sum_pieces
from locbounds.noise.special import log_normal_density, log_normal_interval, two_sum
from locbounds.noise.truncated_gaussian import TruncatedGaussian
from locbounds.noise.uniform import Uniform
from locbounds.precision import traced


class Sum(Noise):
    """What all sums of two independent noises share: all but the density follows from the parts."""

    first: eqx.AbstractVar[Noise]
    second: eqx.AbstractVar[Noise]

    @property
    def mean(self) -> Scalar:
        return self.first.mean + self.second.mean

    @property
    def variance(self) -> Scalar:
        return self.first.variance + self.second.variance

    @abstractmethod
    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Log-density at ``w``, elementwise."""

    def sample(self, key: Array, shape: tuple[int, ...]) -> Float[Array, "..."]:
        one, two = jax.random.split(key)
        return self.first.sample(one, shape) + self.second.sample(two, shape)

    def support(self) -> Pieces:
        return sum_pieces(self.first.support(), self.second.support())

    def singularities(self) -> tuple[Singularity, ...] | None:
        one, two = self.first.singularities(), self.second.singularities()
        return None if one is None or two is None else of_sum(one, two)

    def corners(self) -> Float[Array, " k"]:
        return jnp.add.outer(jnp.asarray(self.first.corners()), jnp.asarray(self.second.corners())).ravel()

    def landmarks(self) -> Float[Array, " k"]:
        one, two = self.first.landmarks(), self.second.landmarks()
        places = jnp.concatenate([one + self.second.mean, two + self.first.mean, self.corners()])
        return jnp.clip(jnp.sort(places), one[0] + two[0], one[-1] + two[-1])

    def regularity(self) -> Regularity:
        if traced(self):
            return Regularity(None, f"{type(self).__name__}: its numbers are being traced by JAX")
        name = f"sum of {type(self.first).__name__} and {type(self.second).__name__}"
        places = self.singularities()
        if places is not None:
            return declared(places, self.support(), name)
        return at_most_a_part(name, self.first.regularity(), self.second.regularity())


def at_most_a_part(name: str, one: Regularity, two: Regularity) -> Regularity:
    """A sum of independent noises has no more information than either of them (Stam 1959).

    >>> at_most_a_part("a sum", Regularity(None, ""), Regularity(True, "")).status
    'regular'
    """
    if one.finite or two.finite:
        return Regularity(True, f"{name}: it has no more information than its regular part")
    return Regularity(None, f"{name}: neither part is regular, and where one is not smooth is not declared")


def overlap(e: Array, one: tuple[Scalar, Scalar], two: tuple[Scalar, Scalar]) -> tuple[Array, Array, Array]:
    """Interval of x with x in ``one`` and e - x in ``two``, and its length without cancellation next to the ends."""
    (l1, h1), (l2, h2) = one, two
    low_sum, low_lost = two_sum(jnp.asarray(l1), jnp.asarray(l2))
    high_sum, high_lost = two_sum(jnp.asarray(h1), jnp.asarray(h2))
    widths = (h1 - l1, (e - low_sum) - low_lost, (high_sum - e) + high_lost, h2 - l2)
    width = jnp.minimum(jnp.minimum(widths[0], widths[3]), jnp.minimum(widths[1], widths[2]))
    return jnp.maximum(l1, e - h2), jnp.minimum(h1, e - l2), width


class TruncatedGaussianSum(Sum):
    """Sum of two Gaussian noises that are cut to intervals, as for received signal strengths in Prieto et al. (2011).

    ``p(e) = N(e; m_1 + m_2, s_T^2) [Phi((U - mu)/s) - Phi((L - mu)/s)] / (Z_1 Z_2)`` with ``s_T^2 = s_1^2 + s_2^2``,
    ``s = s_1 s_2/s_T``, ``mu = m_1 + (s_1/s_T)^2 (e - m_1 - m_2)`` and [L, U] the x that both supports allow (eq. 5
    there; the two cases of the paper are one formula).

    Parameters
    ----------
    first, second
        The parts; limits may be infinite.

    Examples
    --------
    The density vanishes linearly at both ends, so that it has no finite Fisher information:

    >>> noise = TruncatedGaussian(0.0, 1.6, -3.2, 3.2) + TruncatedGaussian(0.0, 3.0, -6.0, 6.0)
    >>> noise.regularity().reason
    'the density vanishes linearly at -9.2 m, an edge of its support (finite only above t^1); and 1 more such place'
    """

    first: TruncatedGaussian
    second: TruncatedGaussian

    def __init__(self, first: TruncatedGaussian, second: TruncatedGaussian):
        self.first, self.second = first, second

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        a, b, e = self.first, self.second, jnp.asarray(w)
        L, U, width = overlap(e, (a.low, a.high), (b.low, b.high))
        total = jnp.sqrt(a.std**2 + b.std**2)
        s = a.std * b.std / total
        u = (e - a.center - b.center) / total
        mu = a.center + a.std**2 / total * u
        there = width > 0
        inside = log_normal_interval((L - mu) / s, (U - mu) / s, jnp.where(there, width, 1.0) / s)
        log_p = log_normal_density(u) - jnp.log(total) + inside - a._log_mass() - b._log_mass()
        return jnp.where(there, log_p, -jnp.inf)


class UniformSum(Sum):
    """Sum of uniform noise and of Gaussian, truncated Gaussian or uniform noise: times of arrival in Prieto (2011).

    ``p(e) = Pr(e - high < x < e - low) / (high - low)`` for the other part x (eq. 9 there).

    Parameters
    ----------
    first
        Truncated Gaussian (limits may be infinite) or uniform noise.
    second
        Uniform noise.

    Examples
    --------
    >>> noise = TruncatedGaussian(0.0, 3.5, -7.0, 7.0) + Uniform(0.0, 3.0)
    >>> noise.regularity().status
    'irregular'
    """

    first: TruncatedGaussian | Uniform
    second: Uniform

    def __init__(self, first: TruncatedGaussian | Uniform, second: Uniform):
        self.first, self.second = first, second

    def log_prob(self, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
        x, bias, e = self.first, self.second, jnp.asarray(w)
        a, b, width = overlap(e, (x.low, x.high), (bias.low, bias.high))
        return x.log_interval(a, b, width) - jnp.log(bias.high - bias.low)
