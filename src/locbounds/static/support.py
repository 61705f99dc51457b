"""A prior as the bounds of a plan see it: density, extent, and quadrature over overlaps of its shifted copies."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.static.overlap import (
    NO_MARKS,
    Rule,
    box_overlap,
    disc_overlap,
    distinct,
    empty,
    gaussian_overlap,
    legendre,
)

REACH = 16.0  # deviations: two Gaussians so far apart have exp(-32) in common


class Kept:
    """Rules kept in memory, the least recently used ones dropped beyond so many bytes.

    Rules depend on the prior and the anchors' places, not on what is measured: plans and noise levels share them.

    >>> kept = Kept(most_bytes=100.0)
    >>> rules = [kept(n, lambda: Rule(np.zeros((n, 2)), np.zeros(n))) for n in (1, 2, 1, 4)]
    >>> rules[0] is rules[2], kept.bytes
    (True, 96)
    """

    def __init__(self, most_bytes: float):
        self.most_bytes, self.bytes = most_bytes, 0
        self.rules: OrderedDict[Any, Rule] = OrderedDict()
        self.lock = Lock()

    def __call__(self, key: Any, make: Callable[[], Rule]) -> Rule:
        with self.lock:
            if key in self.rules:
                self.rules.move_to_end(key)
                return self.rules[key]
        rule = make()
        with self.lock:
            self.bytes -= _size(self.rules.pop(key, None))
            self.rules[key] = rule
            self.bytes += _size(rule)
            while self.bytes > self.most_bytes:
                self.bytes -= _size(self.rules.popitem(last=False)[1])
        return rule


def _size(rule: Rule | None) -> int:
    return 0 if rule is None else rule.points.nbytes + rule.weights.nbytes


_kept = Kept(most_bytes=1.5e8)


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
    marks = np.asarray(marks, float)

    def overlap(shifts: ndarray, n: int, rough: ndarray | None = None) -> Rule:
        shifts = np.asarray(shifts, float)
        rough = None if rough is None else np.asarray(rough, float)
        key = (
            centre.tobytes(),
            radius,
            marks.tobytes(),
            shifts.tobytes(),
            n,
            None if rough is None else rough.tobytes(),
        )
        return _kept(key, lambda: disc_overlap(centre, radius, shifts, n, marks, rough))

    return Support(
        2,
        lambda points: np.full(len(points), level),
        overlap,
        lambda a: 2 * radius,
        True,
        False,
        np.eye(2) * radius**2 / 4,
    )


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


def prism(base: Support, low: float, high: float) -> Support:
    """A law of the plane with heights that are independent of it, uniform between two."""

    def overlap(shifts: ndarray, n: int, rough: ndarray | None = None) -> Rule:
        shifts = np.asarray(shifts, float)
        bottom, top = low - shifts[:, 2].min(), high - shifts[:, 2].max()
        if top <= bottom:
            return empty(3)
        flat = base.overlap(
            distinct(shifts[:, :2]), n, None if rough is None else distinct(np.asarray(rough, float)[:, :2])
        )
        t, w = legendre(n)
        z, w = bottom + (top - bottom) * t, (top - bottom) * w
        points = np.column_stack([np.repeat(flat.points, n, axis=0), np.tile(z, len(flat.points))])
        return Rule(points, np.outer(flat.weights, w).ravel())

    def reach(a: ndarray) -> float:
        flat, up = float(np.linalg.norm(a[:2])), abs(float(a[2]))
        longest = base.reach(a[:2] / flat) / flat if flat > 0 else np.inf
        return min(longest, (high - low) / up) if up > 0 else longest

    covariance = np.zeros((3, 3))
    covariance[:2, :2], covariance[2, 2] = base.covariance, (high - low) ** 2 / 12
    return Support(
        3,
        lambda points: base.log_density(points[:, :2]) - np.log(high - low),
        overlap,
        reach,
        base.uniform,
        False,
        covariance,
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
