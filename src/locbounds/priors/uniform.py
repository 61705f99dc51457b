"""Uniform laws on a disc and on a box, and what all uniform laws share."""

from abc import abstractmethod
from functools import cached_property
from typing import Any

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Bool, Float, Scalar
from locbounds.errors import InputError
from locbounds.precision import float64
from locbounds.priors.position import PositionPrior, as_points, legendre, product

EDGE = "the density of a uniform law jumps at the edge of its support"


class UniformPrior(PositionPrior):
    """Uniform law on a region."""

    @property
    @abstractmethod
    def shape(self) -> Any:
        """The region in the plane as a Shapely polygon, seen from above where it has heights."""

    def irregular(self) -> str:
        return EDGE


class UniformDisc(UniformPrior):
    """Uniform law on a disc, in two dimensions.

    Parameters
    ----------
    center
        [2], in metres.
    radius
        In metres.

    Raises
    ------
    InputError
        If the centre is not two finite numbers or the radius not positive.

    Examples
    --------
    >>> disc = UniformDisc([0.0, 0.0], 15.0)
    >>> points, weights = disc.nodes(20)
    >>> float(weights @ np.sum(points**2, axis=1))  # 15^2 / 2
    112.5
    """

    center: Float[Array, " 2"] = eqx.field(converter=float64)
    radius: Scalar = eqx.field(converter=float64)

    def __check_init__(self):
        if self.center.shape != (2,) or not np.all(np.isfinite(self.center)):
            raise InputError(f"the centre of a disc is {self.center}", "Give 2 finite coordinates in metres")
        if not (np.shape(self.radius) == () and np.isfinite(self.radius) and self.radius > 0):
            raise InputError(f"the radius of a disc is {self.radius} m", "Give a positive number of metres")

    @property
    def mean(self) -> Float[Array, " 2"]:
        return self.center

    @property
    def covariance(self) -> Float[Array, "2 2"]:
        return np.eye(2) * self.radius**2 / 4

    def inside(self, points: Float[Array, "points space"]) -> Bool[Array, " points"]:
        return np.sum((as_points(points, 2) - self.center) ** 2, axis=1) <= self.radius**2

    def log_density(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        return np.where(self.inside(points), -np.log(np.pi * self.radius**2), -np.inf)

    def nodes(self, n: int) -> tuple[Float[Array, "nodes space"], Float[Array, " nodes"]]:
        """Gauss-Legendre along the radius (weight r), 2 n equal angles."""
        r, w = legendre(n)
        angles = (np.arange(2 * n) + 0.5) * np.pi / n
        polar, weights = product((r, 2 * w * r), (angles, np.full(2 * n, 0.5 / n)))
        radii = self.radius * polar[:, :1]
        return self.center + radii * np.stack([np.cos(polar[:, 1]), np.sin(polar[:, 1])], axis=1), weights

    @cached_property
    def shape(self) -> Any:
        """A polygon of 128 corners on the circle."""
        import shapely

        return shapely.Point(*self.center).buffer(float(self.radius), quad_segs=32)

    def bounds(self) -> tuple[Float[Array, " space"], Float[Array, " space"]]:
        return self.center - self.radius, self.center + self.radius

    def sample(self, n: int, *, seed: int = 0) -> Float[Array, "n space"]:
        rng = np.random.default_rng(seed)
        r, angle = self.radius * np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
        return self.center + np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)


class UniformBox(UniformPrior):
    """Uniform law on a box with sides along the axes.

    Parameters
    ----------
    low, high
        Lower and upper corner, [space] with 1, 2 or 3 coordinates, in metres.

    Raises
    ------
    InputError
        If the corners do not match, are not finite, or the box is empty.

    Examples
    --------
    >>> box = UniformBox([0.0, 0.0], [10.0, 4.0])
    >>> box.inside(np.array([[5.0, 2.0], [5.0, 5.0]])).tolist()
    [True, False]
    """

    low: Float[Array, " space"] = eqx.field(converter=float64)
    high: Float[Array, " space"] = eqx.field(converter=float64)

    def __check_init__(self):
        if self.low.shape != self.high.shape or self.low.shape not in ((1,), (2,), (3,)):
            raise InputError(f"the corners of a box are {self.low} and {self.high}", "Give 2 or 3 coordinates for both")
        if not (np.all(np.isfinite(self.low)) and np.all(np.isfinite(self.high)) and np.all(self.low < self.high)):
            raise InputError(
                f"the box from {self.low.tolist()} to {self.high.tolist()} is empty",
                "Give a lower corner that is below the upper corner in every coordinate",
            )

    @property
    def mean(self) -> Float[Array, " space"]:
        return 0.5 * (self.low + self.high)

    @property
    def covariance(self) -> Float[Array, "space space"]:
        return np.diag((self.high - self.low) ** 2 / 12)

    def inside(self, points: Float[Array, "points space"]) -> Bool[Array, " points"]:
        points = as_points(points, self.dim)
        return np.all((points >= self.low) & (points <= self.high), axis=1)

    def log_density(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        return np.where(self.inside(points), -np.sum(np.log(self.high - self.low)), -np.inf)

    def nodes(self, n: int) -> tuple[Float[Array, "nodes space"], Float[Array, " nodes"]]:
        """Gauss-Legendre along every axis."""
        return product(*(legendre(n, a, b) for a, b in zip(self.low, self.high, strict=True)))

    @cached_property
    def shape(self) -> Any:
        """The rectangle of the first two coordinates."""
        import shapely

        if self.dim < 2:
            raise InputError("a box of one coordinate has no outline in the plane", "Give corners of two or three")
        return shapely.box(*self.low[:2], *self.high[:2])

    def bounds(self) -> tuple[Float[Array, " space"], Float[Array, " space"]]:
        return self.low, self.high

    def sample(self, n: int, *, seed: int = 0) -> Float[Array, "n space"]:
        return self.low + (self.high - self.low) * np.random.default_rng(seed).random((n, self.dim))
