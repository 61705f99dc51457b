r"""Radii that a Gaussian error stays within with a given probability, exactly.

With the standard deviations ``s1 >= s2`` along the axes of a two-dimensional error e, polar coordinates of the
whitened error give

    Pr(|e| > r) = (1/2 pi) int_0^{2 pi} exp(-r^2 / (2 (s1^2 cos^2 psi + s2^2 sin^2 psi))) d psi,

a smooth periodic integrand, so that equal angles converge faster than any power. The quantile is ``s1 T(s2 / s1)``,
with T a smooth function of one number: it is solved for once per probability on a fine grid, and interpolated by a
cubic spline to about 1e-12. In three dimensions the mean runs over the directions n of a sphere,

    Pr(|e| > r) = E_n[ Q(r / sqrt(n^T C n)) ],    Q(t) = erfc(t / sqrt 2) + sqrt(2 / pi) t exp(-t^2 / 2).
"""

from functools import lru_cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.errors import InputError

GRID = 2048  # intervals of the table, in the square root of the ratio
NODES = 96  # angles of a quarter turn
NEWTON = 60
SMALLEST, LARGEST = 1e-2, 1 - 1e-9
SPHERE = 24  # nodes along either coordinate of an octant
STEPS_3D = 6
AT_ONCE = 1024  # points with so many directions each


def numeric(x: Any) -> Any:
    """``numpy`` for NumPy arrays and numbers, ``jax.numpy`` for JAX arrays and tracers."""
    return jnp if isinstance(x, jax.Array) else np


class RadiusTable(NamedTuple):
    """The function T for one probability: cubic pieces over the square root of the ratio of deviations."""

    share: float
    coefficients: np.ndarray  # [4, GRID], highest power first

    def __call__(self, ratio: Any) -> Any:
        """Quantile in units of the larger deviation; NumPy in, NumPy out."""
        xp = numeric(ratio)
        t = xp.sqrt(xp.where(ratio > 0, ratio, 1.0)) * (ratio > 0) * GRID
        i = xp.clip(t.astype(int), 0, GRID - 1)
        u = t - i
        c = xp.asarray(self.coefficients)
        return ((c[0, i] * u + c[1, i]) * u + c[2, i]) * u + c[3, i]


def check_share(share: float) -> float:
    """Raise an InputError unless a probability has a radius.

    >>> check_share(0.5)
    0.5
    """
    if np.ndim(share) != 0 or not SMALLEST <= share <= LARGEST:
        raise InputError(
            f"the share of errors is {share}", f"Give a number from {SMALLEST:g} to 1 - {1 - LARGEST:.0e}, such as 0.67"
        )
    return float(share)


def exceedance(r: Any, ratio: Any, nodes: int = NODES) -> tuple[Any, Any]:
    """``Pr(|e| > r)`` for deviations 1 and ``ratio``, and its derivative with respect to r.

    >>> bool(abs(float(exceedance(1.0, 1.0)[0]) - np.exp(-0.5)) < 1e-15)
    True
    """
    psi = (np.arange(nodes) + 0.5) * (np.pi / 2 / nodes)
    variance = np.cos(psi) ** 2 + (np.asarray(ratio)[..., None] * np.sin(psi)) ** 2
    e = np.exp(-(np.asarray(r)[..., None] ** 2) / (2 * variance))
    return e.mean(-1), -np.asarray(r) * (e / variance).mean(-1)


@lru_cache(maxsize=64)
def radius_table(share: float) -> RadiusTable:
    """T for one probability.

    >>> bool(abs(float(radius_table(0.5)(np.array(1.0))) ** 2 - 2 * np.log(2)) < 1e-12)
    True
    """
    from scipy.interpolate import CubicSpline
    from scipy.special import ndtri

    ratio = np.linspace(0.0, 1.0, GRID + 1) ** 2
    narrow, round_ = -ndtri(0.5 * (1 - share)), np.sqrt(-2 * np.log1p(-share))
    nodes = int(min(2048, max(NODES, 64 / narrow)))
    r = np.sqrt(narrow**2 + (round_**2 - narrow**2) * ratio)
    aim = np.log1p(-share)
    for _ in range(NEWTON):
        p, slope = exceedance(r, ratio, nodes)
        step = (np.log(p) - aim) * p / slope
        new = np.clip(r - step, narrow, round_)
        if np.max(np.abs(new - r)) < 1e-14 * round_:
            break
        r = new
    r[0], r[-1] = narrow, round_
    return RadiusTable(share, CubicSpline(np.arange(GRID + 1), r).c)


def radius_3d(variances: Any, share: float) -> Any:
    """Quantile of the length of an error with these variances along its axes.

    Gauss-Legendre in the cosine to the longest axis, equal angles around it; Newton's method, whose last step carries
    the derivative if JAX asks for one.

    >>> from scipy.stats import chi2
    >>> bool(abs(float(radius_3d(np.ones(3), 0.5)) ** 2 - chi2.ppf(0.5, 3)) < 1e-10)
    True
    """
    from scipy.special import ndtri

    xp = numeric(variances)
    if xp is np and variances.size > 3 * AT_ONCE:
        flat = np.asarray(variances).reshape(-1, 3)
        parts = [radius_3d(flat[i : i + AT_ONCE], share) for i in range(0, len(flat), AT_ONCE)]
        return np.concatenate(parts).reshape(variances.shape[:-1])
    v = xp.sort(variances, axis=-1)
    top = xp.where(v[..., 2] > 0, v[..., 2], 1.0)
    v = v / top[..., None]
    fixed = v if xp is np else jax.lax.stop_gradient(v)
    # the chi-square law of equal mean and variance, cubed (Wilson and Hilferty), starts close by
    m, s = fixed.sum(-1), (fixed**2).sum(-1)
    k = 2 * s / (9 * xp.where(m > 0, m, 1.0) ** 2)
    r = xp.sqrt(m * xp.maximum(1 - k + float(ndtri(share)) * xp.sqrt(k), 0.05) ** 3)
    aim, slope = np.log1p(-share), 1.0
    for _ in range(STEPS_3D):
        value, slope = _log_excess(r, fixed)
        r = xp.clip(r - (value - aim) / slope, 0.5 * r, 2 * r)
    if xp is jnp:
        r = r - (_log_excess(r, v)[0] - aim) / slope
    return xp.sqrt(top) * xp.where(m > 0, r, 0.0)


def _sphere() -> tuple[np.ndarray, np.ndarray]:
    """Squares of the coordinates of directions [3, nodes] (longest axis last), and their weights."""
    x, w = np.polynomial.legendre.leggauss(SPHERE)
    psi = (np.arange(SPHERE) + 0.5) * (np.pi / 2 / SPHERE)
    u, psi = (a.ravel() for a in np.meshgrid(0.5 * (x + 1), psi, indexing="ij"))
    squares = np.stack([(1 - u**2) * np.sin(psi) ** 2, (1 - u**2) * np.cos(psi) ** 2, u**2])
    return squares, np.repeat(0.5 * w, SPHERE) / SPHERE


def _log_excess(r: Any, v: Any) -> tuple[Any, Any]:
    """``log Pr(|e| > r)`` and its derivative with respect to r."""
    xp = numeric(v)
    if xp is np:
        from scipy.special import erfc
    else:
        from jax.scipy.special import erfc
    squares, weights = _sphere()
    g = v @ squares
    g = xp.where(g > 0, g, 1e-300)
    t2 = r[..., None] ** 2 / g
    t, e = xp.sqrt(t2), xp.exp(-0.5 * t2)
    p = (erfc(t / np.sqrt(2)) + np.sqrt(2 / np.pi) * t * e) @ weights
    p = xp.where(p > 0, p, 1e-300)
    return xp.log(p), -np.sqrt(2 / np.pi) * ((t2 * e / xp.sqrt(g)) @ weights) / p
