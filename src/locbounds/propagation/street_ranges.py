"""Path lengths around buildings as a measurement of a plan: compiled, batched, differentiable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Int, Scalar
from locbounds.errors import InputError
from locbounds.measurement.base import Measurement, distance
from locbounds.precision import float64
from locbounds.propagation.city import City
from locbounds.propagation.corners import View
from locbounds.propagation.links import place_anchors


class Views(NamedTuple):
    """Horizons of several places as arrays of one width, or one row of them.

    Bearings beyond a place's last part are infinite; a part without a wall has a wall whose ends coincide.
    """

    place: Float[Array, "*places 2"]
    start: Float[Array, "*places parts"]
    a: Float[Array, "*places parts 2"]
    b: Float[Array, "*places parts 2"]

    @classmethod
    def of(cls, views: Sequence[View]) -> Views:
        """From horizons."""
        width = max((len(view.horizon.start) for view in views), default=1)
        place, start = np.zeros((len(views), 2)), np.full((len(views), width), np.inf)
        a, b = np.zeros((2, len(views), width, 2))
        for k, (view, from_, to) in enumerate(views):
            n, there = len(view.start), view.wall >= 0
            place[k], start[k, :n] = view.source, view.start
            a[k, :n][there], b[k, :n][there] = from_[view.wall[there]], to[view.wall[there]]
        return cls(place, start, a, b)

    def see(self, point: Float[Array, " 2"]) -> Any:
        """Whether the place sees a point; for one place, a row of all fields."""
        to = point - self.place
        part = jnp.searchsorted(self.start, jnp.arctan2(to[1], to[0]), side="right") - 1
        wall, to = self.b[part] - self.a[part], point - self.a[part]
        return wall[0] * to[1] - wall[1] * to[0] <= 0


class StreetRanges(Measurement):
    """Lengths of the shortest paths from anchors around the corners of a city's buildings, one value per anchor.

    The same lengths as :func:`~locbounds.street_links`, for plans and their bounds. The gradient is the unit vector
    from the last corner. Where two paths tie, it is the mean of both; without a path the value is infinite.

    Parameters
    ----------
    city
        The buildings.
    anchors
        Name -> position in metres, or positions [anchors, 2].
    roof
        Names of anchors on roofs, or True for all that are inside a building.
    difference_to
        Index of an anchor: the values are differences to its path (times of arrival without a common clock).
    nlos_bias_m
        Added to every path without sight.

    Raises
    ------
    InputError
        If an anchor cannot be there, or there are too few for differences.

    Notes
    -----
    The value is continuous in the position, unless ``nlos_bias_m`` makes it jump at the sight boundaries; the gradient
    jumps where the shortest path changes sides of a building.

    Examples
    --------
    >>> import shapely
    >>> ranges = StreetRanges(City([shapely.box(0, 0, 30, 40)]), {"bs": (0.0, 40.0)})
    >>> [round(float(r), 3) for r in (ranges(np.array([30.0, 0.0])), ranges(np.array([-3.0, 36.0])))]
    [70.0, 5.0]
    """

    corners: Views
    anchors: Views
    lengths: Float[Array, "anchors corners"]
    origin: Float[Array, " 2"]
    others: Int[Array, " values"]
    nlos_bias_m: Scalar = eqx.field(converter=float64)
    difference_to: int | None = eqx.field(static=True)
    unit: str = eqx.field(static=True, default="m")
    dim: int | None = eqx.field(static=True, default=2)

    def __init__(
        self,
        city: City,
        anchors: Any,
        *,
        roof: Any = (),
        difference_to: int | None = None,
        nlos_bias_m: float = 0.0,
    ):
        graph, placed = city.graph, place_anchors(city, anchors, roof=roof)
        count = len(placed.names)
        if difference_to is not None and (count < 2 or difference_to not in range(count)):
            raise InputError(
                f"differences to anchor number {difference_to} of {count}", "Give at least two anchors, counted from 0"
            )
        if not np.isfinite(nlos_bias_m):
            raise InputError(f"the bias of links without sight is {nlos_bias_m} m", "Give a finite number of metres")
        self.corners = Views.of(graph.all_views())
        found = [graph.view(place, walls) for place, walls in zip(placed.position, placed.own, strict=True)]
        self.anchors = Views.of(found)
        self.lengths = graph.trees(placed.position, graph.sees(found, graph.corner)).length
        self.origin = graph.origin
        self.others = np.array([k for k in range(count) if k != difference_to])
        self.nlos_bias_m = nlos_bias_m
        self.difference_to = difference_to
        self.unit, self.dim = "m", 2

    @property
    def size(self) -> int:
        return len(self.others)

    @property
    def clocked(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.difference_to is None

    @property
    def continuous(self) -> bool:
        """Whether no path jumps where the line of sight is lost."""
        return not np.any(self.nlos_bias_m)

    @property
    def places(self) -> Float[Array, "anchors 2"]:
        """Positions of the anchors."""
        return self.anchors.place + self.origin

    def __call__(self, position: Float[Array, " space"]) -> Any:
        point = jnp.asarray(position) - self.origin
        fixed = jax.lax.stop_gradient(point)
        corners, anchors, lengths = jax.tree.map(jnp.asarray, (self.corners, self.anchors, self.lengths.T))

        def around(best: Array, corner: Any) -> tuple[Array, None]:
            view, before = corner  # Views of one corner, the lengths to it
            leg = jnp.where(view.see(fixed), distance(point, view.place), jnp.inf)
            return jnp.minimum(best, before + leg), None

        bent = jax.lax.scan(around, jnp.full(len(anchors.place), jnp.inf), (corners, lengths))[0]
        free = jax.vmap(lambda view: view.see(fixed))(anchors)
        value = jnp.where(free, distance(anchors.place, point), bent + self.nlos_bias_m)
        value = value if self.difference_to is None else value[self.others] - value[self.difference_to]
        return value.reshape(()) if self.size == 1 else value

    def singular(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        points = np.asarray(points, dtype=float)
        return np.linalg.norm(points[:, None] - self.places, axis=-1).min(axis=1)
