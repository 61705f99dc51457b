"""Links from a ray tracer, or from measurements, in place of the geometry."""

from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import LOS, NLOS, Float, Int, ndarray
from locbounds.errors import InputError
from locbounds.propagation.corners import NONE
from locbounds.propagation.links import UNREACHED, Links

RASTER = 1e-3  # share of the step by which points may be off a raster


class LinkTable(NamedTuple):
    """Sight, bias and deviation of the range at every point, for every anchor.

    Attributes
    ----------
    points
        [points, 2] in metres.
    anchors
        Positions [anchors, 2] in metres.
    names
        Names of the anchors.
    sight
        0 = LOS, 1 = NLOS, -1 = no link, [points, anchors].
    bias_m
        How much longer the range is than the straight distance, in metres; NaN without a link.
    deviation_m
        Standard deviation of the range, in metres; NaN without a link.

    Examples
    --------
    >>> table = LinkTable.of([[3.0, 4.0]], {"bs": (0.0, 0.0)}, [[1]], [[2.0]], [[0.5]])
    >>> table.links.length_m.tolist(), table.links.excess_m.tolist()
    ([[7.0]], [[2.0]])
    """

    points: Float[ndarray, "points 2"]
    anchors: Float[ndarray, "anchors 2"]
    names: tuple[str, ...]
    sight: Int[ndarray, "points anchors"]
    bias_m: Float[ndarray, "points anchors"]
    deviation_m: Float[ndarray, "points anchors"]

    @classmethod
    def of(cls, points: Any, anchors: dict[str, Any], sight: Any, bias_m: Any, deviation_m: Any) -> "LinkTable":
        """From arrays, checked.

        Raises
        ------
        InputError
            If shapes differ, a number of a link is missing, or a deviation is not positive.
        """
        where = np.asarray(points, dtype=float).reshape(-1, 2)
        places = np.array([np.asarray(p, dtype=float)[:2] for p in anchors.values()]).reshape(-1, 2)
        shape = (len(where), len(places))
        sight, bias, deviation = np.asarray(sight), np.asarray(bias_m, float), np.asarray(deviation_m, float)
        for name, values in (("sight", sight), ("bias", bias), ("deviation", deviation)):
            if values.shape != shape:
                raise InputError(f"the {name} has the shape {values.shape}", f"Give [points, anchors], {shape}")
        there = sight != UNREACHED
        if not np.isin(sight, (LOS, NLOS, UNREACHED)).all():
            raise InputError("a sight is none of 0 (LOS), 1 (NLOS), -1 (no link)", "Correct the table")
        if not (
            np.isfinite(bias[there]).all() and (deviation[there] > 0).all() and np.isfinite(deviation[there]).all()
        ):
            raise InputError("a link has no bias, or no positive deviation", "Give both, in metres, for every link")
        bias, deviation = np.where(there, bias, np.nan), np.where(there, deviation, np.nan)
        return cls(where, places, tuple(map(str, anchors)), sight, bias, deviation)

    @property
    def links(self) -> Links:
        """The same as :func:`street_links` returns, with straight paths: what bends them is not in the table."""
        distance = np.linalg.norm(self.points[:, None] - self.anchors, axis=-1)
        length = np.where(self.sight == UNREACHED, np.inf, distance + self.bias_m)
        none = np.full(self.sight.shape, NONE)
        nothing = np.zeros((len(self.anchors), 0), int), np.zeros((0, 2))
        outside = np.zeros(len(self.points), bool)
        places = self.points, self.anchors, self.names
        return Links(*places, self.sight, length, distance, outside, none, *nothing)

    @property
    def step_m(self) -> float:
        """Distance of neighbouring points of the raster that the points lie on.

        Raises
        ------
        InputError
            If they lie on none.
        """
        steps = np.array([s for axis in self.points.T for s in np.diff(np.unique(axis)) if s > RASTER])
        step = float(steps.min()) if steps.size else 1.0
        off = (self.points - self.points[0]) / step
        if np.abs(off - np.round(off)).max() > RASTER:
            raise InputError(
                f"the points of the table are on no raster: the smallest step is {step:g} m, and not all others are "
                "multiples of it",
                "Give points on a square raster, as a ray tracer's coverage map has",
            )
        return step
