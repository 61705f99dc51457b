r"""Tail-safe pieces of the normal law, for densities that are differences of distribution functions.

``Phi(b) - Phi(a)`` loses all its digits where a and b are close or both far out in one tail. Here it is the integral
over [a, b] by Gauss-Legendre quadrature where the interval is short, and a difference of lower tails elsewhere.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.precision import traced

HALF_LOG_2PI = 0.5 * np.log(2 * np.pi)
SHORT = 1.0  # deviations: below this the integral, above it the difference
FAR = 1e3  # deviations between a finite end and what stands for infinity
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
_T, _W = 0.5 * (_NODES + 1), 0.5 * _WEIGHTS


def log_normal_density(u: Float[Array, "*n"] | float) -> Float[Array, "*n"] | float:
    """Log-density of the standard normal law."""
    return -0.5 * u**2 - HALF_LOG_2PI


def two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """``a + b`` rounded, and what rounding lost (Knuth's TwoSum); zero where the sum is infinite."""
    total = a + b
    back = total - a
    lost = (a - (total - back)) + (b - back)
    return total, jnp.where(jnp.isfinite(total), lost, 0.0)


def log_normal_interval(
    a: Float[Array, "*n"] | float, b: Float[Array, "*n"] | float, width: Float[Array, "*n"] | float | None = None
) -> Float[Array, "*n"] | float:
    """``log(Phi(b) - Phi(a))`` for a < b, to about 13 digits everywhere.

    Parameters
    ----------
    a, b
        Ends in deviations; may be infinite.
    width
        ``b - a`` where the caller knows it better than the subtraction does.

    Notes
    -----
    NumPy arrays are served by NumPy and SciPy, which compile nothing.

    Examples
    --------
    Far out in the tail, where both distribution functions are 1 in double precision:

    >>> float(log_normal_interval(np.array(30.0), np.array(31.0)))
    -454.3212
    """
    if not traced(a, b, width) and not any(hasattr(x, "devices") for x in (a, b, width)):
        from scipy.special import log_ndtr

        with np.errstate(all="ignore"):
            return _log_normal_interval(np.asarray(a), np.asarray(b), width, np, log_ndtr)
    from jax.scipy.special import log_ndtr

    return _log_normal_interval(jnp.asarray(a), jnp.asarray(b), width, jnp, log_ndtr)


def _log_normal_interval(a: Array, b: Array, width: Any, xp: Any, log_ndtr: Any) -> Array:
    width = b - a if width is None else width
    b_finite = xp.where(xp.isinf(b), xp.where(xp.isinf(a), FAR, a + FAR), b)
    a = xp.where(xp.isinf(a), b_finite - 2 * FAR, a)
    b = b_finite
    width = xp.where(xp.isinf(width), b - a, width)
    upper = a + b > 0
    high = xp.where(upper, -a, b)  # the end nearer to the middle, in the lower half
    short = width < SHORT
    d = xp.where(short, width, 0.5)
    top = xp.where(short, xp.minimum(high, 0.0), 0.0)
    x = xp.where(short, high, 0.0)[..., None] - d[..., None] * _T
    scaled = xp.sum(_W * xp.exp(0.5 * (top[..., None] - x) * (top[..., None] + x)), -1)
    narrow = xp.log(xp.where(d > 0, d, 1.0)) - HALF_LOG_2PI - 0.5 * top**2 + xp.log(scaled)
    narrow = xp.where(d > 0, narrow, -xp.inf)
    h = xp.where(short, 0.0, high)
    low = h - xp.where(short, 1.0, width)
    wide = log_ndtr(h) + xp.log1p(-xp.exp(log_ndtr(low) - log_ndtr(h)))
    return xp.where(short, narrow, wide)
