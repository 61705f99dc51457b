r"""How well measurements tell two places apart: the statistics that Weiss-Weinstein and Ziv-Zakai bounds rest on.

``pairs(a, b)`` is what depends on the places alone; the coefficients follow from it for any noise level ``scale``
(relative to the stated one), so that a sweep over noise levels evaluates the measurements once.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from locbounds.axes import Float, ndarray

TABLE = 513  # differences at which the coefficient of a wrapped normal law is tabulated
NARROW = 0.02  # deviation over period below which no table is needed


@runtime_checkable
class PairLaw(Protocol):
    """What a bound asks of a measurement law."""

    def pairs(self, a: Float[ndarray, "n space"], b: Float[ndarray, "n space"]) -> ndarray:
        """Statistics of pairs of places, first axis the pairs."""
        ...

    def log_affinity(self, pairs: ndarray, scale: float) -> Float[ndarray, " n"]:
        """Logarithm of the Bhattacharyya coefficient."""
        ...

    def error(self, pairs: ndarray, scale: float) -> Float[ndarray, " n"]:
        """Least error probability between equally likely places, or a lower bound on it."""
        ...


def gaussian_error(distance: ndarray, log_odds: ndarray) -> ndarray:
    r"""Least error probability between two Gaussian laws of one covariance.

    Parameters
    ----------
    distance
        Mahalanobis distance of the means.
    log_odds
        Log of the ratio of the two prior probabilities.

    Notes
    -----
    ``q Q(d/2 + l/d) + (1 - q) Q(d/2 - l/d)`` with ``l = log q/(1 - q)``; the smaller of q and 1 - q at d = 0.

    >>> float(gaussian_error(np.array(0.0), np.array(0.0))), round(float(gaussian_error(np.array(2.0), np.array(0.0))), 6)
    (0.5, 0.158655)
    """
    from scipy.special import expit, ndtr

    odds = np.abs(log_odds)
    d = np.maximum(distance, 1e-150)
    with np.errstate(over="ignore"):
        more, less = expit(odds), expit(-odds)
        return more * ndtr(-(d / 2 + odds / d)) + less * ndtr(-(d / 2 - odds / d))


class GaussianPairs(NamedTuple):
    """Gaussian noise of one covariance everywhere, periodic channels as wrapped normal laws.

    Attributes
    ----------
    means : callable
        ``[n, space] -> [n, channels]``.
    whitener : array [channels, channels]
        W with ``W^T W`` the inverse covariance.
    period : array [channels]
        Infinite for channels that are not periodic.
    std : array [channels]
        Deviations; periodic channels are independent of all others.
    """

    means: Callable[[ndarray], ndarray]
    whitener: Float[ndarray, "channels channels"]
    period: Float[ndarray, " channels"]
    std: Float[ndarray, " channels"]

    @classmethod
    def of(cls, means: Callable[[ndarray], ndarray], covariance: ndarray, period: ndarray | None = None):
        """From a covariance [channels, channels]."""
        covariance = np.atleast_2d(np.asarray(covariance, float))
        period = np.full(len(covariance), np.inf) if period is None else np.asarray(period, float)
        whitener = np.linalg.inv(np.linalg.cholesky(covariance))
        return cls(means, whitener, period, np.sqrt(np.diagonal(covariance)))

    def pairs(self, a: ndarray, b: ndarray) -> ndarray:
        """Squared Mahalanobis distance; with periodic channels also that of the others, and the wrapped differences."""
        gap = self.means(b) - self.means(a)
        round_ = np.isfinite(self.period)
        if not round_.any():
            return np.square(gap @ self.whitener.T).sum(-1, keepdims=True)
        gap[:, round_] -= self.period[round_] * np.round(gap[:, round_] / self.period[round_])
        white = np.square(gap @ self.whitener.T)
        return np.column_stack([white.sum(-1), white[:, ~round_].sum(-1), gap[:, round_]])

    def log_affinity(self, pairs: ndarray, scale: float) -> ndarray:
        if pairs.shape[1] == 1:
            return pairs[:, 0] / (-8 * scale**2)
        total = pairs[:, 1] / (-8 * scale**2)
        where = np.flatnonzero(np.isfinite(self.period))
        for k, channel in enumerate(where):
            total = total + wrapped_log_affinity(pairs[:, 2 + k], self.std[channel] * scale, self.period[channel])
        return total

    def error(self, pairs: ndarray, scale: float) -> ndarray:
        from scipy.special import ndtr

        return ndtr(np.sqrt(pairs[:, 0]) / (-2 * scale))

    def distance(self, pairs: ndarray, scale: float) -> ndarray:
        """Mahalanobis distance, for error probabilities with unequal priors and exponents other than 1/2."""
        return np.sqrt(pairs[:, 0]) / scale


class Tabulated(NamedTuple):
    """Any law that offers its coefficients for pairs of places (no noise levels but its own)."""

    log_bhattacharyya: Callable[[ndarray, ndarray], ndarray]
    minimum_error: Callable[[ndarray, ndarray], ndarray]

    def pairs(self, a: ndarray, b: ndarray) -> ndarray:
        return np.stack([a, b], axis=1)

    def log_affinity(self, pairs: ndarray, scale: float) -> ndarray:
        return self.log_bhattacharyya(pairs[:, 0], pairs[:, 1])

    def error(self, pairs: ndarray, scale: float) -> ndarray:
        return self.minimum_error(pairs[:, 0], pairs[:, 1])


def wrapped_log_affinity(difference: ndarray, std: float, period: float = 2 * np.pi) -> ndarray:
    """Logarithm of the Bhattacharyya coefficient of two wrapped normal laws.

    Parameters
    ----------
    difference
        Of their centres, within half a period.
    std, period
        In the same unit.

    Notes
    -----
    Trapezoidal rule over the circle (exponentially accurate) at 513 differences, cubic in between.

    >>> small = wrapped_log_affinity(np.array([0.1]), 0.1)
    >>> round(float(small[0]), 9) == -0.125
    True
    >>> float(np.exp(wrapped_log_affinity(np.array([3.0]), 50.0))[0])
    1.0
    """
    if std < NARROW * period:  # mass around the middles of both arcs between the centres, nothing elsewhere
        near, far = np.abs(difference), period - np.abs(difference)
        return np.logaddexp(-(near**2) / (8 * std**2), -(far**2) / (8 * std**2))
    return _wrapped_table(std / period)(np.abs(difference) / period)


@functools.lru_cache(maxsize=128)
def _wrapped_table(std: float) -> Callable[[ndarray], ndarray]:
    """The coefficient for a period of one."""
    from scipy.interpolate import CubicSpline
    from scipy.special import logsumexp

    grid = np.linspace(0.0, 0.5, TABLE)
    x = np.arange(512) / 512
    copies = np.arange(-(int(np.ceil(9 * std)) + 1), int(np.ceil(9 * std)) + 2)

    def log_density(at: ndarray) -> ndarray:
        at = at - np.round(at)
        return logsumexp(-0.5 * ((at[..., None] + copies) / std) ** 2, axis=-1) - np.log(std * np.sqrt(2 * np.pi))

    total = 0.5 * (log_density(x) + log_density(x - grid[:, None]))
    return CubicSpline(grid, logsumexp(total, axis=1) - np.log(512))
