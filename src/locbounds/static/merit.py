r"""Figures of merit of a position error: from its covariance, or from samples of it.

A covariance, for example the Cramér-Rao bound, stands for a Gaussian error with mean zero. Then

=========================  ============================================================================
MSE, RMSE                  ``trace C`` and its root
MDE                        mean length: ``s1 sqrt(2 / pi) E(1 - s2^2 / s1^2)`` in 2-D (complete elliptic
                           integral); ``sqrt(8 / pi) R_G(variances)`` in 3-D (Carlson's integral)
CEP, any quantile          radius that the error stays within with the given probability (exact,
                           :mod:`locbounds.static.radius`)
error ellipse              the smallest region with the given probability: ``e^T C^-1 e <= chi^2 quantile``
=========================  ============================================================================

RMSE >= MDE always; with equality only for an error of fixed length.
"""

from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import Array, Bool, Float
from locbounds.errors import InputError
from locbounds.precision import double_precision, traced
from locbounds.static.radius import check_share, numeric, radius_3d, radius_table

ROUNDING = 1e-9  # of the largest eigenvalue: a covariance from rounded numbers may have one as far below zero


def _square(covariance: Any) -> Any:
    """A covariance, or many, as an array; raises for what is none. Infinite ones stand for "no bound" and pass."""
    covariance = covariance if traced(covariance) else np.asarray(covariance, dtype=float)
    if covariance.ndim < 2 or covariance.shape[-1] != covariance.shape[-2] or covariance.shape[-1] not in (1, 2, 3):
        raise InputError(
            f"the covariance of a position error has shape {covariance.shape}", "Give [..., space, space], 2-D or 3-D"
        )
    if not traced(covariance):
        for wrong, why in (
            (np.isnan(covariance).any((-2, -1)), "holds NaN"),
            (_indefinite(covariance), "has a negative variance"),
        ):
            if wrong.any():
                raise InputError(
                    f"the covariance {covariance[wrong][0].tolist()} of a position error {why}",
                    "Give a positive semidefinite matrix, infinite where there is no bound",
                )
    return covariance


def _indefinite(C: Float[np.ndarray, "*n space space"]) -> Bool[np.ndarray, "*n"]:
    """Whether the variance along some direction is negative by more than rounding."""
    C = np.where(np.isfinite(C).all((-2, -1), keepdims=True), C, 0.0)
    if C.shape[-1] == 2:
        middle = 0.5 * (C[..., 0, 0] + C[..., 1, 1])
        gap = np.hypot(0.5 * (C[..., 0, 0] - C[..., 1, 1]), C[..., 0, 1])
        low, high = middle - gap, middle + gap
    else:
        values = np.linalg.eigvalsh(C)
        low, high = values[..., 0], values[..., -1]
    return np.asarray(low < -ROUNDING * np.abs(high))


def mse(covariance: Float[Array, "*n space space"]) -> Float[Array, "*n"]:
    """Mean square error: the trace.

    >>> float(mse(np.diag([9.0, 16.0])))
    25.0
    """
    C = _square(covariance)
    return numeric(C).asarray(C.trace(axis1=-2, axis2=-1))


def rmse(covariance: Float[Array, "*n space space"]) -> Float[Array, "*n"]:
    """Root mean square error.

    >>> float(rmse(np.diag([9.0, 16.0])))
    5.0
    """
    square = mse(covariance)
    return numeric(square).asarray(numeric(square).sqrt(square))


def mde(covariance: Float[Array, "*n space space"]) -> Float[Array, "*n"]:
    """Mean distance error of a Gaussian error; infinite where the covariance is.

    >>> bool(abs(float(mde(np.eye(2))) - np.sqrt(np.pi / 2)) < 1e-12)
    True
    """
    from scipy.special import ellipe, elliprg

    C = _square(covariance)
    finite = np.all(np.isfinite(C), axis=(-2, -1))
    v = np.maximum(np.linalg.eigvalsh(np.where(finite[..., None, None], C, np.eye(C.shape[-1]))), 0.0)
    if C.shape[-1] == 1:
        mean = np.sqrt(2 / np.pi * v[..., 0])
    elif C.shape[-1] == 2:
        top = np.where(v[..., 1] > 0, v[..., 1], 1.0)
        mean = np.sqrt(2 / np.pi * v[..., 1]) * ellipe(1 - v[..., 0] / top)
    else:
        mean = np.sqrt(8 / np.pi) * elliprg(v[..., 0], v[..., 1], v[..., 2])
    return np.where(finite, mean, np.inf)


@double_precision
def error_quantile(covariance: Float[Array, "*n space space"], share: float = 0.5) -> Float[Array, "*n"]:
    """Radius in metres that a Gaussian position error stays within with probability ``share``.

    Parameters
    ----------
    covariance
        [..., space, space] in m^2, 1-D to 3-D; positive semidefinite.
    share
        Between 0 and 1: 0.5 for the circular error probable, 0.67 or 0.95 for the E911 figures.

    Returns
    -------
    array
        Metres, infinite where the covariance is; exact to about 1e-11 in 2-D, to 1e-7 in 3-D.

    Raises
    ------
    InputError
        If the share is no probability, or the matrix no covariance: its shape, NaN, a negative variance.

    Notes
    -----
    Can be differentiated and compiled by JAX.

    Examples
    --------
    >>> error_quantile(np.array([np.eye(2), np.diag([4.0, 1.0])]), 0.5)
    array([1.17741, 1.740835])
    """
    C, share = _square(covariance), check_share(share)
    xp = numeric(C)
    finite = xp.all(xp.isfinite(C), axis=(-2, -1))
    C = xp.where(finite[..., None, None], C, xp.eye(C.shape[-1]))
    if C.shape[-1] == 1:
        from scipy.special import ndtri

        radius = -float(ndtri(0.5 * (1 - share))) * xp.sqrt(C[..., 0, 0])
    elif C.shape[-1] == 2:
        radius = radius_2d(*principal_variances(C[..., 0, 0], C[..., 0, 1], C[..., 1, 1]), share)
    else:
        radius = radius_3d(xp.maximum(xp.linalg.eigvalsh(C), 0.0), share)
    return xp.where(finite, radius, np.inf)


def principal_variances(a: Any, b: Any, d: Any) -> tuple[Any, Any]:
    """Larger and smaller eigenvalue of [[a, b], [b, d]]; derivatives free of NaN for circles.

    >>> [float(v) for v in principal_variances(np.array(2.0), np.array(1.0), np.array(2.0))]
    [3.0, 1.0]
    """
    xp = numeric(a)
    square = 0.25 * (a - d) ** 2 + b**2
    gap = xp.where(square > 0, xp.sqrt(xp.where(square > 0, square, 1.0)), 0.0)
    top = 0.5 * (a + d) + gap
    det = xp.maximum(a * d - b**2, 0.0)
    return top, xp.minimum(det / xp.where(top > 0, top, 1.0), top)


def radius_2d(v1: Any, v2: Any, share: float) -> Any:
    """Quantile of the length of a 2-D error with variances v1 >= v2.

    >>> float(radius_2d(np.array(1.0), np.array(0.0), 0.5))  # the quartile of a normal law
    0.67448975
    """
    xp = numeric(v1)
    safe = xp.where(v1 > 0, v1, 1.0)
    square = v2 / safe
    ratio = xp.where(square > 0, xp.sqrt(xp.where(square > 0, square, 1.0)), 0.0)
    return xp.where(v1 > 0, xp.sqrt(safe), 0.0) * radius_table(share)(ratio)


def cep(covariance: Float[Array, "*n space space"]) -> Float[Array, "*n"]:
    """Circular (in 3-D spherical) error probable: the median length of a Gaussian error.

    >>> float(cep(np.eye(2)))
    1.17741
    """
    return error_quantile(covariance, 0.5)


class Ellipse(NamedTuple):
    """Error ellipses: semi-axes [..., space] in metres, longest first, and their directions.

    Attributes
    ----------
    semi_axes_m
        [..., space], infinite where the covariance is.
    directions
        [..., space, space]; column i is the unit vector of semi-axis i.
    """

    semi_axes_m: np.ndarray
    directions: np.ndarray

    @property
    def angle_rad(self) -> np.ndarray:
        """Angle of the longest axis from the x-axis, in (-pi/2, pi/2]; 2-D."""
        x, y = self.directions[..., 0, 0], self.directions[..., 1, 0]
        return np.asarray(np.arctan2(np.where(x < 0, -y, y), np.abs(x)))


def error_ellipse(covariance: Float[Array, "*n space space"], share: float = 0.95) -> Ellipse:
    """The smallest ellipse (3-D: ellipsoid) that holds a Gaussian error with probability ``share``.

    Examples
    --------
    >>> error_ellipse(np.diag([1.0, 4.0]), 0.95).semi_axes_m / np.sqrt(-2 * np.log(0.05))
    array([2., 1.])
    """
    from scipy.special import gammaincinv

    C = _square(covariance)
    n = C.shape[-1]
    finite = np.all(np.isfinite(C), axis=(-2, -1))
    values, vectors = np.linalg.eigh(np.where(finite[..., None, None], C, np.eye(n)))
    scale = np.sqrt(2 * gammaincinv(n / 2, check_share(share)))
    semi = scale * np.sqrt(np.maximum(values[..., ::-1], 0.0))
    return Ellipse(np.where(finite[..., None], semi, np.inf), vectors[..., ::-1])


class SampleQuantile(NamedTuple):
    """A quantile of samples and its confidence interval, in metres; few samples: an end may be infinite."""

    value: float
    low: float
    high: float


def sample_quantile(errors: Float[Array, " n"], share: float = 0.5, *, confidence: float = 0.95) -> SampleQuantile:
    """Quantile of measured or simulated error lengths, with an interval that holds for every law of the error.

    The interval is between order statistics: the number of independent errors below the true quantile is binomial
    (:func:`scipy.stats.quantile_test`).

    Parameters
    ----------
    errors
        Lengths of independent errors in metres, [n].
    share
        Between 0 and 1.
    confidence
        Of the interval.

    Raises
    ------
    InputError
        If there are no errors, one is not finite, or a probability is none.

    Examples
    --------
    >>> sample_quantile(np.arange(1.0, 101.0), 0.5)
    SampleQuantile(value=50.5, low=40.0, high=61.0)
    """
    from scipy.stats import quantile_test

    e = np.asarray(errors, dtype=float).ravel()
    if not len(e) or not np.all(np.isfinite(e)):
        raise InputError(f"there are {len(e)} errors, not all finite", "Give the lengths of errors in metres")
    for name, p in (("share", share), ("confidence", confidence)):
        if not 0 < p < 1:
            raise InputError(f"the {name} is {p}", "Give a number between 0 and 1")
    low, high = quantile_test(e, p=share).confidence_interval(confidence)
    return SampleQuantile(
        float(np.quantile(e, share)),
        0.0 if np.isnan(low) else float(low),  # lengths are positive
        float("inf") if np.isnan(high) else float(high),
    )
