"""A prior as the bounds of a plan see it: density, extent, and quadrature over overlaps of its shifted copies."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.static.overlap import (
    NO_MARKS,
    Rule,
    box_overlap,
    disc_overlap,
    gaussian_overlap,
    polygon_overlap,
    shared_nodes,
)

REACH = 16.0  # deviations: two Gaussians so far apart have exp(-32) in common


class Support(NamedTuple):
    """What a bound needs to know of a prior.

    Attributes
    ----------
    space : int
        Number of coordinates.
    log_density : callable
        ``[n, space] -> [n]``.
    overlap : callable
        ``(shifts [k, space], n, rough=None) -> Rule`` over the places whose shifted copies all have a positive density;
        ``rough`` are the copies that the integrand is evaluated at (by default all).
    reach : callable
        Unit vector -> longest shift along it with any overlap (or with any that counts), m.
    uniform : bool
        The density has one value on the support.
    whole : bool
        The density is positive everywhere.
    covariance : array [space, space]
    """

    space: int
    log_density: Callable[[ndarray], ndarray]
    overlap: Callable[..., Rule]
    reach: Callable[[ndarray], float]
    uniform: bool
    whole: bool
    covariance: Float[ndarray, "space space"]


def disc(centre: ndarray, radius: float, marks: ndarray = NO_MARKS) -> Support:
    """Uniform on a disc."""
    centre, radius = np.asarray(centre, float), float(radius)
    level = -np.log(np.pi * radius**2)
    return Support(
        2,
        lambda points: np.full(len(points), level),
        lambda shifts, n, rough=None: disc_overlap(centre, radius, shifts, n, marks, rough),
        lambda a: 2 * radius,
        True,
        False,
        np.eye(2) * radius**2 / 4,
    )


def box(low: ndarray, high: ndarray, marks: ndarray = NO_MARKS) -> Support:
    """Uniform on a box."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    level = -np.sum(np.log(high - low))

    def reach(a: ndarray) -> float:
        with np.errstate(divide="ignore"):
            return float(np.min((high - low) / np.abs(a)))

    return Support(
        len(low),
        lambda points: np.full(len(points), level),
        lambda shifts, n, rough=None: box_overlap(low, high, shifts, n, marks, rough),
        reach,
        True,
        False,
        np.diag((high - low) ** 2 / 12),
    )


def gaussian(mean: ndarray, covariance: ndarray) -> Support:
    """Gaussian."""
    mean, covariance = np.asarray(mean, float), np.asarray(covariance, float)
    root = np.linalg.cholesky(covariance)
    constant = -np.sum(np.log(np.diagonal(root))) - 0.5 * len(mean) * np.log(2 * np.pi)

    def log_density(points: ndarray) -> ndarray:
        return constant - 0.5 * np.square(np.linalg.solve(root, (points - mean).T)).sum(0)

    return Support(
        len(mean),
        log_density,
        lambda shifts, n, rough=None: gaussian_overlap(mean, root, shifts, n),
        lambda a: REACH / float(np.linalg.norm(np.linalg.solve(root, a))),
        False,
        True,
        covariance,
    )
