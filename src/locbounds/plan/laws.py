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

WRAPS_FROM_RAD = 0.2  # below this deviation both ways round the circle never meet: exp(-pi^2 / (8 std^2)) < 1e-13
ON_CIRCLE = 1024  # nodes on the circle; exact to rounding for smooth densities
SHIFTS = 1025  # nodes of a table
NEGLIGIBLE = 1e-15


class Table(NamedTuple):
    """Bhattacharyya coefficient and minimum error over the square roots of equally spaced shifts, with slopes."""

    reach: float
    coefficient: np.ndarray
    error: np.ndarray

    def look_up(self, values: np.ndarray, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Monotone cubic interpolation at shifts d, even in d; the last value beyond the reach."""
        y, slope = values
        t = jnp.sqrt(jnp.minimum(jnp.abs(d) / self.reach, 1.0)) * (len(y) - 1)
        i = jnp.clip(t.astype(int), 0, len(y) - 2)
        u = t - i
        y, slope = jnp.asarray(y), jnp.asarray(slope)
        a, b, c, e = y[i], y[i + 1], slope[i], slope[i + 1]
        return a + u * (c + u * (3 * (b - a) - 2 * c - e + u * (2 * (a - b) + c + e)))

    def rho(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Bhattacharyya coefficient."""
        return self.look_up(self.coefficient, d)

    def p_min(self, d: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Minimum error probability of two equally probable values."""
        return self.look_up(self.error, d)


def table(noise: Noise, periodic: bool) -> Table:
    """The table of one noise; of its wrapped density for an angle.

    Examples
    --------
    >>> import locbounds as lb
    >>> from locbounds.precision import double_precision
    >>> look = double_precision(lambda d: table(lb.Gaussian(0.0, 2.0), False).rho(d))
    >>> float(look(np.array([3.0]))[0] - np.exp(-9 / 32)) < 1e-8
    True
    """
    from scipy.interpolate import PchipInterpolator

    reach = np.pi if periodic else _reach(noise)
    n = SHIFTS // 2 + 1 if periodic else SHIFTS
    d = reach * np.linspace(0.0, 1.0, n) ** 2
    pair = _wrapped(noise, d) if periodic else (bhattacharyya(noise, d), minimum_error(noise, d))
    steps = np.arange(n, dtype=float)
    return Table(
        reach, *(np.stack([y, PchipInterpolator(steps, y).derivative()(steps)]) for y in map(np.asarray, pair))
    )


def _reach(noise: Noise) -> float:
    """A shift at which the two copies hardly overlap, at most the span of the noise's landmarks."""
    places = np.asarray(noise.landmarks())
    reach = float(places[-1] - places[0])
    shifts = reach * 0.5 ** np.arange(10)
    small = np.asarray(bhattacharyya(noise, shifts)) < NEGLIGIBLE
    return float(shifts[np.flatnonzero(small)[-1]]) if small[0] else reach


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
    return difference - 2 * np.pi * jnp.floor(difference / (2 * np.pi) + 0.5)
