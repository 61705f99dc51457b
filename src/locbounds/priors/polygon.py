"""Uniform law on a polygon, with holes, convex or not."""

from functools import cached_property
from typing import Any

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Bool, Float, ndarray
from locbounds.errors import InputError
from locbounds.priors.position import as_points, legendre, product
from locbounds.priors.uniform import UniformPrior


def outline(corners: Any, name: str = "the outline") -> Float[Array, "corners 2"]:
    """Corners of a ring as float64, without the repeated first one; raises for what is no ring.

    >>> outline([[0, 0], [1, 0], [0, 1], [0, 0]]).tolist()
    [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    """
    ring = np.asarray(corners, dtype=np.float64)
    if ring.size == 0:
        raise InputError(f"{name} has no corners", "Give at least three, [[x, y], ...] in metres")
    if ring.ndim != 2 or ring.shape[1] != 2 or not np.all(np.isfinite(ring)):
        raise InputError(f"{name} has the shape {ring.shape}", "Give corners [[x, y], ...] in metres, finite numbers")
    if len(ring) > 1 and np.array_equal(ring[0], ring[-1]):
        ring = ring[:-1]
    if len(np.unique(ring, axis=0)) < 3:
        raise InputError(f"{name} has {len(np.unique(ring, axis=0))} different corners", "Give at least three")
    return ring


class UniformPolygon(UniformPrior):
    """Uniform law on a polygon.

    Parameters
    ----------
    corners
        Outline [corners, 2] in metres, in either sense; the last corner may repeat the first.
    holes
        Outlines of what is cut out.

    Raises
    ------
    InputError
        If an outline crosses itself, encloses nothing, or a hole is not inside.

    Examples
    --------
    >>> yard = UniformPolygon([[0, 0], [10, 0], [10, 10], [0, 10]], holes=[[[4, 4], [6, 4], [6, 6], [4, 6]]])
    >>> float(yard.area), yard.inside(np.array([[5.0, 5.0], [1.0, 1.0]])).tolist()
    (96.0, [False, True])
    """

    corners: Float[Array, "corners 2"] = eqx.field(converter=outline)
    holes: tuple[Float[Array, "corners 2"], ...] = eqx.field(
        converter=lambda holes: tuple(outline(h, "the outline of a hole") for h in holes), default=()
    )

    def __check_init__(self):
        import shapely

        ring = shapely.Polygon(self.corners)
        if not ring.is_valid:
            why = shapely.is_valid_reason(ring)
            raise InputError(f"the outline crosses itself: {why}", "List the corners in order along the edge")
        if not ring.area > 0:
            raise InputError("the outline encloses nothing", "Give corners that are not on one line")
        if self.holes:
            whole = shapely.Polygon(self.corners, self.holes)
            if not whole.is_valid or not whole.area > 0:
                why = shapely.is_valid_reason(whole)
                raise InputError(
                    f"the holes do not fit into the outline: {why}",
                    "Give holes that are inside it and do not meet each other",
                )

    @cached_property
    def shape(self) -> Any:
        """The Shapely polygon."""
        import shapely

        shape = shapely.Polygon(self.corners, self.holes)
        shapely.prepare(shape)
        return shape

    @cached_property
    def triangles(self) -> Float[ndarray, "triangles 3 2"]:
        """Triangles that cover the polygon without overlap."""
        import shapely

        parts = shapely.constrained_delaunay_triangles(self.shape).geoms
        return np.stack([np.asarray(t.exterior.coords)[:3] for t in parts])

    @property
    def area(self) -> float:
        """In square metres."""
        return float(self.shape.area)

    @cached_property
    def _sizes(self) -> np.ndarray:
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        u, v = b - a, c - a
        return 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])

    @property
    def mean(self) -> Float[Array, " 2"]:
        points, weights = self.nodes(2)
        return weights @ points

    @property
    def covariance(self) -> Float[Array, "2 2"]:
        points, weights = self.nodes(2)
        d = points - weights @ points
        return (weights[:, None] * d).T @ d

    @property
    def dim(self) -> int:
        return 2

    def inside(self, points: Float[Array, "points space"]) -> Bool[Array, " points"]:
        import shapely

        x, y = as_points(points, 2).T
        return np.asarray(shapely.intersects_xy(self.shape, x, y))

    def log_density(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        return np.where(self.inside(points), -np.log(self.area), -np.inf)

    def nodes(self, n: int) -> tuple[Float[Array, "nodes space"], Float[Array, " nodes"]]:
        """Gauss-Legendre rules on collapsed squares, one per triangle: n x n nodes each."""
        x, w = legendre(n)
        square, weights = product((x, 2 * w * (1 - x)), (x, w))
        u, v = square[:, 0], (1 - square[:, 0]) * square[:, 1]
        a, b, c = (self.triangles[:, i, None, :] for i in range(3))
        points = a + (b - a) * u[:, None] + (c - a) * v[:, None]
        shares = self._sizes / self._sizes.sum()
        return points.reshape(-1, 2), (shares[:, None] * weights).ravel()

    def bounds(self) -> tuple[Float[Array, " space"], Float[Array, " space"]]:
        return self.corners.min(axis=0), self.corners.max(axis=0)

    def sample(self, n: int, *, seed: int = 0) -> Float[Array, "n space"]:
        rng = np.random.default_rng(seed)
        a, b, c = np.moveaxis(self.triangles[rng.choice(len(self._sizes), n, p=self._sizes / self._sizes.sum())], 1, 0)
        u, v = rng.random((2, n, 1))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        return a + (b - a) * u + (c - a) * v
