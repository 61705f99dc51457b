"""A prior as the bounds of a plan see it: density, extent, and quadrature over overlaps of its shifted copies."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.static.overlap import (
    NO_MARKS,
    Rule,
    box_overlap,
    disc_overlap,
    gaussian_overlap,
)

KEPT = 4096  # rules of discs kept in memory: some 20 kB each
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


def disc(centre: Any, radius: float, marks: ndarray = NO_MARKS) -> Support:
    """Uniform on a disc."""
    centre, radius = np.asarray(centre, float), float(radius)
    level = -np.log(np.pi * radius**2)
    where = (centre.tobytes(), radius, np.asarray(marks, float).tobytes())
    return Support(
        2,
        lambda points: np.full(len(points), level),
        lambda shifts, n, rough=None: _disc_rule(
            *where, np.asarray(shifts, float).tobytes(), n, b"" if rough is None else np.asarray(rough, float).tobytes()
        ),
        lambda a: 2 * radius,
        True,
        False,
        np.eye(2) * radius**2 / 4,
    )


@functools.lru_cache(maxsize=KEPT)
def _disc_rule(centre: bytes, radius: float, marks: bytes, shifts: bytes, n: int, rough: bytes) -> Rule:
    """Rules depend on the prior and the anchors' places, not on what is measured: plans and noise levels share them."""
    c, m, u, r = (np.frombuffer(b).reshape(-1, 2) for b in (centre, marks, shifts, rough))
    return disc_overlap(c[0], radius, u, n, m, r if len(r) else None)


def box(low: Any, high: Any, marks: ndarray = NO_MARKS) -> Support:
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


def gaussian(mean: Any, covariance: Any) -> Support:
    """Gaussian."""
    mean, covariance = np.asarray(mean, float), np.asarray(covariance, float)
    root = np.linalg.cholesky(covariance)
    inverse = np.linalg.inv(root)
    constant = -np.sum(np.log(np.diagonal(root))) - 0.5 * len(mean) * np.log(2 * np.pi)

    def log_density(points: ndarray) -> ndarray:
        return constant - 0.5 * np.square(inverse @ (points - mean).T).sum(0)

    return Support(
        len(mean),
        log_density,
        lambda shifts, n, rough=None: gaussian_overlap(mean, root, shifts, n),
        lambda a: REACH / float(np.linalg.norm(np.linalg.solve(root, a))),
        False,
        True,
        covariance,
    )
