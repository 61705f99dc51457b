"""Walls as arrays: directed edges with the building on their left, moved inwards by a micrometre.

A path may run along a wall and around a corner. Moving the walls that block it inwards by EPS, and leaving corners,
anchors and points where they are, turns all these touching cases into clear ones: what is allowed passes at a distance
of EPS, and what cuts through a building crosses a wall. A path that cuts a corner by less than EPS counts as free.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import shapely

from locbounds.axes import Bool, Float, Int, ndarray

EPS = 1e-6  # m
SHARPEST = 0.02  # limit of 1 + cos(turn) at very sharp corners
SHORTEST_M = 1e-5  # shorter walls have no direction
STRAIGHT = 1e-9  # sine of a turn that is no corner


class Walls(NamedTuple):
    """Edges that block, and the corners of the buildings."""

    a: Float[ndarray, "walls 2"]
    b: Float[ndarray, "walls 2"]
    vertex: Float[ndarray, "walls 2"]  # where wall k begins, before it was moved
    before: Float[ndarray, "walls 2"]  # its neighbours along the outline
    after: Float[ndarray, "walls 2"]
    convex: Bool[ndarray, " walls"]
    solid: Any  # the moved outline, prepared

    @classmethod
    def of(cls, obstacles: Any) -> Walls:
        """The walls of a polygonal geometry."""
        whole = shapely.orient_polygons(obstacles)
        rings, polygons = [], []
        for polygon in shapely.get_parts(whole):
            mine = [ring for ring in map(_ring, (polygon.exterior, *polygon.interiors)) if ring is not None]
            if mine:
                rings += mine
                polygons.append(shapely.Polygon(mine[0].moved, [r.moved for r in mine[1:]]))
        solid: Any = shapely.MultiPolygon(polygons) if polygons else shapely.MultiPolygon()
        shapely.prepare(solid)
        if not rings:
            none = np.zeros((0, 2))
            return cls(none, none, none, none, none, np.zeros(0, bool), solid)

        def join(part):
            return np.concatenate([part(r) for r in rings])

        return cls(
            a=join(lambda r: r.moved),
            b=join(lambda r: np.roll(r.moved, -1, axis=0)),
            vertex=join(lambda r: r.at),
            before=join(lambda r: np.roll(r.at, 1, axis=0)),
            after=join(lambda r: np.roll(r.at, -1, axis=0)),
            convex=join(lambda r: r.convex),
            solid=solid,
        )

    def inside(self, points: Float[ndarray, "points 2"]) -> Bool[ndarray, " points"]:
        """Which points lie behind a wall."""
        return shapely.contains_xy(self.solid, points[:, 0], points[:, 1])


class _Ring(NamedTuple):
    at: Float[ndarray, "n 2"]
    moved: Float[ndarray, "n 2"]
    convex: Bool[ndarray, " n"]


def _ring(ring: Any) -> _Ring | None:
    """One outline, the building on its left."""
    at = shapely.get_coordinates(ring)[:-1]
    at = at[np.linalg.norm(at - np.roll(at, 1, axis=0), axis=1) > SHORTEST_M]
    if len(at) < 3:
        return None
    step = np.roll(at, -1, axis=0) - at
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    into = np.stack([-step[:, 1], step[:, 0]], axis=1)  # of the wall that begins here; the one before ends here
    both = into + np.roll(into, 1, axis=0)
    cosine = np.sum(into * np.roll(into, 1, axis=0), axis=1)
    moved = at + EPS * both / np.maximum(1 + cosine, SHARPEST)[:, None]
    turn = cross(np.roll(step, 1, axis=0), step)
    return _Ring(at, moved, turn > STRAIGHT)


def cross(u: Float[ndarray, "*#n 2"], v: Float[ndarray, "*#n 2"]) -> Float[ndarray, "*n"]:
    """Third component of the cross product of vectors in the plane, over leading axes.

    >>> cross(np.array([[1.0, 0.0]]), np.array([[0.0, 2.0]])).tolist()
    [2.0]
    """
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


class Horizon(NamedTuple):
    """What one place sees: from each bearing ``start`` on to the next one, the nearest wall, or -1 for none."""

    source: Float[ndarray, " 2"]
    start: Float[ndarray, " parts"]
    wall: Int[ndarray, " parts"]


def horizon(source: Float[ndarray, " 2"], a: Float[ndarray, "walls 2"], b: Float[ndarray, "walls 2"]) -> Horizon:
    """The nearest wall in every direction from a place outside the buildings.

    Parameters
    ----------
    source
        The place.
    a, b
        Where walls begin and end, the building on their left; walls do not cross each other.

    Notes
    -----
    Between two neighbouring bearings of wall ends the nearest wall is the same in all directions, so one ray through
    the middle finds it. Only walls that face the place count. The cost is that of sorting, plus the number of
    (bearing, wall across it) pairs.

    Examples
    --------
    A wall from (1, 1) to (1, -1), its building to the right of it:

    >>> found = horizon(np.zeros(2), np.array([[1.0, 1.0]]), np.array([[1.0, -1.0]]))
    >>> np.degrees(found.start).round().tolist(), found.wall.tolist()
    ([-180.0, -45.0, 45.0], [-1, 0, -1])
    """
    to_a, to_b = a - source, b - source
    facing = np.flatnonzero(cross(to_b - to_a, to_a) > 0)
    to_a, along = to_a[facing], (b - a)[facing]
    high, low = np.arctan2(to_a[:, 1], to_a[:, 0]), np.arctan2(to_b[facing, 1], to_b[facing, 0])
    wraps = np.flatnonzero(low > high)
    edge = np.concatenate([np.arange(len(facing)), wraps])
    from_, to = np.concatenate([low, np.full(len(wraps), -np.pi)]), np.concatenate([high, high[wraps]])
    to[wraps] = np.pi
    ticks = np.unique(np.concatenate([from_, to, (-np.pi, np.pi)]))
    first, count = np.searchsorted(ticks, from_), np.searchsorted(ticks, to)
    count = count - first
    k = np.repeat(edge, count)
    n = np.arange(count.sum()) + np.repeat(first - np.cumsum(count) + count, count)
    middle = (ticks[:-1] + ticks[1:]) / 2
    slope = np.cos(middle)[n] * along[k, 1] - np.sin(middle)[n] * along[k, 0]
    depth = np.divide(cross(to_a, along)[k], slope, out=np.full(len(k), np.inf), where=slope != 0)
    nearest = np.full(len(middle), np.inf)
    np.minimum.at(nearest, n, depth)
    wall = np.full(len(middle), -1)
    hit = depth == nearest[n]
    wall[n[hit]] = facing[k[hit]]
    new = np.append(True, wall[1:] != wall[:-1])
    return Horizon(source, ticks[:-1][new], wall[new])


def sees(
    view: Horizon, points: Float[ndarray, "points 2"], a: Float[ndarray, "walls 2"], b: Float[ndarray, "walls 2"]
) -> Bool[ndarray, " points"]:
    """Which points are in front of the nearest wall."""
    to = points - view.source
    part = np.searchsorted(view.start, np.arctan2(to[:, 1], to[:, 0]), side="right") - 1
    wall = view.wall[part]
    return (wall < 0) | (cross(b[wall] - a[wall], points - a[wall]) <= 0)
