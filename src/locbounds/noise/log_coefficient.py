r"""Logarithm of the Bhattacharyya coefficient, accurate also for shifts so small that the coefficient is one.

``1 - rho(h) = 1/2 int (sqrt p(w) - sqrt p(w - h))^2 dw`` does not cancel. What is tabulated is ``-log rho(h) / h^2``
over the logarithm of h, smooth for every density: constant (an eighth of the Fisher information) for small h where the
information is finite, growing like ``log 1/h`` next to linear edges and like ``1/h`` next to jumps. Powers ``rho^M``
of many samples then keep their relative accuracy.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, ndarray
from locbounds.errors import RefusedError
from locbounds.noise.base import Noise
from locbounds.noise.shifted_copies import _W, _X, _panels
from locbounds.precision import double_precision

SMALLEST, POINTS = 1e-4, 100  # of the table: in deviations, and how many
LEAST = -80.0  # logarithm of the smallest coefficient that is tabulated
GROWTH = 1.25  # of the shift, while looking for where the coefficient has become negligible
MOST = 1e6  # deviations
KEPT = 32  # tables
AT_ONCE = 160  # shifts
QUARTILES = 1.3489795003921634  # between them lie so many deviations of a normal law


@double_precision
def log_bhattacharyya(noise: Noise, shifts: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """``log rho(h)`` of the Bhattacharyya coefficient, by quadrature; minus infinity where the copies do not meet.

    Parameters
    ----------
    noise
        Any noise.
    shifts
        h in metres (or in whatever the noise is in), of any shape and sign.

    Examples
    --------
    >>> import locbounds as lb
    >>> log_bhattacharyya(lb.Gaussian(0.0, 2.0), np.array([1e-6, 4.0])) * 32
    array([-1.e-12, -1.6e+01])
    """
    shifts = np.asarray(shifts, dtype=float)
    padded = np.zeros(-(-shifts.size // AT_ONCE) * AT_ONCE)  # few shapes, each of which is compiled
    padded[: shifts.size] = shifts.ravel()
    low, high = (np.asarray(x)[: shifts.size] for x in _over(noise, jnp.asarray(padded)))
    with np.errstate(divide="ignore"):
        value = np.where(low < 0.5, np.log1p(-np.minimum(low, 0.5)), np.log(high))
    return value.reshape(shifts.shape)


@jax.jit
def _over(noise: Noise, shifts: Array) -> tuple[Array, Array]:
    """``1 - rho`` and ``rho``."""

    def one(h: Array) -> tuple[Array, Array]:
        low, high = _panels(noise, h)
        half = 0.5 * (high - low)
        w = (0.5 * (low + high))[:, None] + half[:, None] * _X
        a, b = (jnp.exp(0.5 * noise.log_prob(v)) for v in (w, w - h))
        weight = half[:, None] * _W
        return 0.5 * jnp.sum(weight * (a - b) ** 2), jnp.sum(weight * a * b)

    return jax.lax.map(one, shifts, batch_size=8)


def log_coefficient(noise: Noise) -> "LogCoefficient":
    """The table of a noise, made once for equal ones.

    >>> import locbounds as lb
    >>> log_coefficient(lb.Gaussian(0.0, 2.0)) is log_coefficient(lb.Gaussian(0.0, 2.0))
    True
    """
    leaves, tree = jax.tree.flatten(noise)
    key = str(tree), tuple((np.shape(x), np.asarray(x).tobytes()) for x in leaves)
    if key not in _tables:
        _tables[key] = LogCoefficient(noise)
        while len(_tables) > KEPT:
            _tables.pop(next(iter(_tables)))
    return _tables[key]


_tables: dict[Any, "LogCoefficient"] = {}


class LogCoefficient:
    """A table of ``log rho(h)`` of one noise, called with any shifts.

    Parameters
    ----------
    noise
        Any noise.

    Raises
    ------
    RefusedError
        If its law has parts so far apart that the coefficient vanishes and comes back with growing shifts.

    Examples
    --------
    >>> import locbounds as lb
    >>> table = LogCoefficient(lb.Gaussian(0.0, 2.0))
    >>> (32 * table(np.array([-4.0, 0.0, 2e-5]))).round(12) + 0.0
    array([-16.,   0.,   0.])
    """

    def __init__(self, noise: Noise):
        unit = rough_variance(noise) ** 0.5
        ends = [end for piece in noise.support() for end in piece]
        self.width = max(ends) - min(ends)  # beyond it the copies do not meet
        top = min(self.width, MOST * unit)
        means = np.asarray(noise.components()[1])
        between = np.abs(np.subtract.outer(means, means)).ravel()  # where copies of different parts meet
        far = unit * GROWTH ** np.arange(int(np.log(MOST) / np.log(GROWTH)))
        far = np.unique(np.append(far, between[between > unit]))
        logs = log_bhattacharyya(noise, far[far < top])
        enough = np.flatnonzero(~(logs > LEAST))
        if enough.size or len(noise.support()) > 1:
            if len(noise.support()) > 1 or np.any(logs[enough[0] :] > LEAST):
                raise RefusedError(
                    "a noise and its shifted copy part and meet again: its law has parts that lie far apart",
                    "Make the parts modes of their own, or use bcrb",
                )
            top = min(top, float(far[enough[0]]))
        self.low, self.high = SMALLEST * unit, top * (1 - 1e-9)
        # dense towards the end of a bounded support, where the logarithm falls without limit
        x = np.linspace(np.log(self.low), np.log(self.high), POINTS)
        if np.isfinite(self.width) and top == self.width:
            x = np.sort(np.concatenate([x, np.log(top * -np.expm1(np.linspace(-0.1, -20.0, POINTS // 2)))]))
        x = np.unique(x)
        values = log_bhattacharyya(noise, np.exp(x))
        kept = np.isfinite(values)
        x, values = x[kept], values[kept]
        self.high = float(np.exp(x[-1]))
        from scipy.interpolate import CubicSpline

        self.table = CubicSpline(x, np.log(-values) - 2 * x)
        self.slope = float(self.table(x[0], 1))

    def __call__(self, shifts: Any) -> ndarray:
        h = np.abs(np.asarray(shifts, dtype=float))
        x = np.log(np.clip(h, self.low, self.high))
        below = np.minimum(np.log(np.maximum(h, np.finfo(float).tiny)) - np.log(self.low), 0.0)
        value = -np.exp(self.table(x) + self.slope * below) * h**2
        return np.where(h >= self.width, -np.inf, value)


def rough_variance(noise: Noise) -> float:
    """The variance; where it is infinite, that of the normal law with the same quartiles.

    >>> import locbounds as lb
    >>> rough_variance(lb.Gaussian(0.0, 3.0)), round(rough_variance(lb.StudentT(1.0, 0.0, 2.0)), 2)
    (9.0, 8.79)
    """
    variance = float(noise.variance)
    if math.isfinite(variance):
        return variance
    low, high = np.asarray(noise.quantile(np.array([0.25, 0.75])))
    return float((high - low) / QUARTILES) ** 2
