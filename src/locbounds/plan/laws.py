r"""How well one channel tells two values apart, tabulated; angles live on the circle.

For additive noise of density p the Bhattacharyya coefficient ``rho(d)`` and the minimum error probability ``P(d)``
depend on the difference d of the noise-free values only. The density of a wrapped angle is
``sum_k p(w + 2 pi k)``.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.noise import Noise, bhattacharyya, minimum_error
from locbounds.noise.log_coefficient import rough_variance
from locbounds.precision import traced

WRAPS_FROM_RAD = 0.2  # below this deviation both ways round the circle never meet: exp(-pi^2 / (8 std^2)) < 1e-13
ON_CIRCLE = 1024  # nodes on the circle; exact to rounding for smooth densities
SHIFTS = 513  # nodes of a table
CORE = 1e-3  # deviations up to which they are equally spaced
MOST = 1e5  # deviations of the longest shift
NEGLIGIBLE = 1e-15
BEYOND = 1e-9  # relative: shifts closer than this to the reach of a table are within it


class Table(NamedTuple):
    """Bhattacharyya coefficient and minimum error over shifts ``unit * sinh(rate * k)``, k = 0, 1, .., with slopes.

    The nodes are dense near zero and in a constant ratio far out, so that tails as heavy as Cauchy's fit.
    """

    unit: float
    rate: float
    coefficient: np.ndarray
    error: np.ndarray

    def look_up(self, values: np.ndarray, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Monotone cubic interpolation at shifts d, even in d; the last value beyond the reach."""
        xp = jnp if traced(d) else np
        y, slope = (xp.asarray(v) for v in values)
        t = xp.minimum(xp.arcsinh(xp.abs(d) / self.unit) / self.rate, len(y) - 1.0)
        i = xp.clip(t.astype(int), 0, len(y) - 2)
        u = t - i
        a, b, c, e = y[i], y[i + 1], slope[i], slope[i + 1]
        return a + u * (c + u * (3 * (b - a) - 2 * c - e + u * (2 * (a - b) + c + e)))

    def rho(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Bhattacharyya coefficient."""
        return self.look_up(self.coefficient, d)

    def p_min(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Minimum error probability of two equally probable values; zero beyond the reach, which is never too large.

        The Ziv-Zakai integral grows with it, so that the last value, too large further out, would not be safe.
        """
        xp = jnp if traced(d) else np
        reach = self.unit * np.sinh(self.rate * (len(self.error[0]) - 1))
        return xp.where(xp.abs(d) > (1 + BEYOND) * reach, 0.0, self.look_up(self.error, d))


def table(noise: Noise, periodic: bool) -> Table:
    """The table of one noise; of its wrapped density for an angle.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.precision import double_precision
    >>> look = double_precision(lambda d: table(lb.Gaussian(0.0, 2.0), False).rho(d))
    >>> bool(abs(look(np.array([3.0]))[0] - np.exp(-9 / 32)) < 1e-6)
    True
    """
    from scipy.interpolate import PchipInterpolator

    n = SHIFTS // 2 + 1 if periodic else SHIFTS
    reach = np.pi if periodic else _reach(noise)
    unit = CORE * min(rough_variance(noise) ** 0.5, reach)
    rate = np.arcsinh(reach / unit) / (n - 1)
    d = unit * np.sinh(rate * np.arange(n))
    pair = _wrapped(noise, d) if periodic else (bhattacharyya(noise, d), minimum_error(noise, d))
    steps = np.arange(n, dtype=float)
    return Table(
        unit, rate, *(np.stack([y, PchipInterpolator(steps, y).derivative()(steps)]) for y in map(np.asarray, pair))
    )


def _reach(noise: Noise) -> float:
    """A shift at which the two copies hardly overlap, at most the span of the noise's landmarks."""
    places = np.asarray(noise.landmarks())
    span, core = float(places[-1] - places[0]), rough_variance(noise) ** 0.5
    shifts = np.geomspace(min(span, MOST * core), core, SHIFTS)  # the table's shape: compiled once
    small = np.asarray(bhattacharyya(noise, shifts)) < NEGLIGIBLE
    return float(shifts[max(np.argmin(small) - 1, 0)])


def wrapped_density(noise: Noise, w: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Density of a noise on the circle."""
    turns = int(np.ceil(10 * float(np.sqrt(noise.variance)) / (2 * np.pi))) + 1
    return jnp.sum(jnp.stack([jnp.exp(noise.log_prob(w + 2 * np.pi * k)) for k in range(-turns, turns + 1)]), axis=0)


def _wrapped(noise: Noise, shifts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both coefficients of the wrapped density, by trapezoids over the circle."""
    w = -np.pi + 2 * np.pi * np.arange(ON_CIRCLE) / ON_CIRCLE
    one, two = (np.asarray(wrapped_density(noise, w + sign * shifts[:, None] / 2)) for sign in (-1, 1))
    step = 2 * np.pi / ON_CIRCLE
    return np.sum(np.sqrt(one * two), axis=1) * step, 0.5 * np.sum(np.minimum(one, two), axis=1) * step


def wrapped_information(noise: Noise) -> float:
    """Fisher information of a wrapped density about a shift.

    >>> import locbounds as lb
    >>> from locbounds.precision import double_precision
    >>> round(double_precision(wrapped_information)(lb.Gaussian(0.0, 0.3)) * 0.3**2, 9)
    1.0
    """
    w = -np.pi + 2 * np.pi * np.arange(ON_CIRCLE) / ON_CIRCLE
    p, slope = jax.jvp(lambda w: wrapped_density(noise, w), (jnp.asarray(w),), (jnp.ones(ON_CIRCLE),))
    there = np.asarray(p) > 0
    return float(np.sum(np.asarray(slope)[there] ** 2 / np.asarray(p)[there]) * 2 * np.pi / ON_CIRCLE)


def wrap(difference: Any) -> Any:
    """Angles into [-pi, pi).

    >>> float(wrap(jnp.array(3 * np.pi / 2)) / np.pi)
    -0.5
    """
    xp = jnp if traced(difference) else np
    return difference - 2 * np.pi * xp.floor(difference / (2 * np.pi) + 0.5)
