"""A law of the plane times a range of heights."""

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Bool, Float, Scalar
from locbounds.errors import InputError
from locbounds.precision import float64
from locbounds.priors.position import PositionPrior, as_points, legendre
from locbounds.priors.uniform import EDGE


class Prism(PositionPrior):
    """A law of two coordinates, and an independent height that is uniform between two values.

    Parameters
    ----------
    base
        Law of x and y.
    low, high
        Heights in metres.

    Raises
    ------
    InputError
        If the base is not two-dimensional or the heights are no interval.

    Examples
    --------
    >>> from locbounds.priors import UniformDisc
    >>> Prism(UniformDisc([0.0, 0.0], 5.0), 0.0, 2.0).mean.tolist()
    [0.0, 0.0, 1.0]
    """

    base: PositionPrior
    low: Scalar = eqx.field(converter=float64)
    high: Scalar = eqx.field(converter=float64)

    def __check_init__(self):
        if self.base.dim != 2:
            raise InputError(f"the base of a prism has {self.base.dim} coordinates", "Give a law of the plane")
        if not (np.isfinite(self.low) and np.isfinite(self.high) and self.low < self.high):
            raise InputError(
                f"the heights {self.low} to {self.high} m are no interval", "Give the lowest and the highest, in metres"
            )

    @property
    def mean(self) -> Float[Array, " 3"]:
        return np.append(self.base.mean, 0.5 * (self.low + self.high))

    @property
    def covariance(self) -> Float[Array, "3 3"]:
        out = np.zeros((3, 3))
        out[:2, :2], out[2, 2] = self.base.covariance, (self.high - self.low) ** 2 / 12
        return out

    def inside(self, points: Float[Array, "points space"]) -> Bool[Array, " points"]:
        points = as_points(points, 3)
        return self.base.inside(points[:, :2]) & (points[:, 2] >= self.low) & (points[:, 2] <= self.high)

    def log_density(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        points = as_points(points, 3)
        flat = self.base.log_density(points[:, :2]) - np.log(self.high - self.low)
        return np.where((points[:, 2] >= self.low) & (points[:, 2] <= self.high), flat, -np.inf)

    def nodes(self, n: int) -> tuple[Float[Array, "nodes space"], Float[Array, " nodes"]]:
        """The base's nodes times Gauss-Legendre heights."""
        points, weights = self.base.nodes(n)
        z, w = legendre(n, self.low, self.high)
        every = np.column_stack([np.repeat(points, n, axis=0), np.tile(z, len(points))])
        return every, np.outer(weights, w).ravel()

    def bounds(self) -> tuple[Float[Array, " space"], Float[Array, " space"]]:
        low, high = self.base.bounds()
        return np.append(low, self.low), np.append(high, self.high)

    def sample(self, n: int, *, seed: int = 0) -> Float[Array, "n space"]:
        z = self.low + (self.high - self.low) * np.random.default_rng(seed + 104729).random(n)
        return np.column_stack([self.base.sample(n, seed=seed), z])

    def irregular(self) -> str:
        return EDGE
