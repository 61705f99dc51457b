"""Links between anchors and street points: sight, length of the shortest path, its corners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import LOS, NLOS, Bool, Float, Int, ndarray
from locbounds.errors import InputError
from locbounds.propagation.city import City, closed
from locbounds.propagation.corners import NONE, CornerGraph
from locbounds.propagation.walls import Walls

UNREACHED = -1
FACADE_M = 0.5  # an anchor this deep in a building is meant to be on its wall
CHUNK = 20_000  # points at a time, which bounds the memory


class Links(NamedTuple):
    """Links of points with anchors, from :func:`street_links`.

    Attributes
    ----------
    points, anchors
        Places in metres, [points, 2] and [anchors, 2]; anchors where they were put on a wall.
    names
        Names of the anchors.
    sight
        0 = LOS, 1 = NLOS, -1 = no path (the point is inside a building or in a closed courtyard), [points, anchors].
    length_m
        Length of the shortest path around the buildings, inf without a path, [points, anchors].
    distance_m
        Straight distance, [points, anchors].
    inside
        Which points lie inside a building, [points].

    Examples
    --------
    >>> import shapely
    >>> links = street_links(City([shapely.box(0, 0, 30, 40)]), {"bs": (0.0, 40.0)}, [[30.0, 0.0]])
    >>> links.blocked.tolist(), links.excess_m.tolist(), links.direction[0, 0].tolist()
    ([[True]], [[20.0]], [0.0, -1.0])
    """

    points: Float[ndarray, "points 2"]
    anchors: Float[ndarray, "anchors 2"]
    names: tuple[str, ...]
    sight: Int[ndarray, "points anchors"]
    length_m: Float[ndarray, "points anchors"]
    distance_m: Float[ndarray, "points anchors"]
    inside: Bool[ndarray, " points"]
    last: Int[ndarray, "points anchors"]  # the last corner, NONE for LOS
    previous: Int[ndarray, "anchors corners"]  # the corner before each corner
    corner: Float[ndarray, "corners 2"]

    @property
    def excess_m(self) -> Float[ndarray, "points anchors"]:
        """How much longer the path is than the straight line, in metres; 0 in LOS."""
        return np.where(self.sight == LOS, 0.0, self.length_m - self.distance_m)

    @property
    def blocked(self) -> Bool[ndarray, "points anchors"]:
        """Which links have no sight."""
        return self.sight != LOS

    @property
    def direction(self) -> Float[ndarray, "points anchors 2"]:
        """Gradient of the length: unit vectors to the point from the last corner, or the anchor; NaN without a path."""
        corners = np.concatenate([self.corner, np.zeros((1, 2))])[self.last]
        away = self.points[:, None] - np.where((self.last == NONE)[..., None], self.anchors, corners)
        size = np.linalg.norm(away, axis=-1, keepdims=True)
        unit = np.divide(away, size, out=np.zeros_like(away), where=size > 0)
        return np.where((self.sight == UNREACHED)[..., None], np.nan, unit)

    def path(self, point: int, anchor: int) -> Float[ndarray, "bends 2"]:
        """The path from an anchor to a point, with the corners in between; empty where there is none."""
        if self.sight[point, anchor] == UNREACHED:
            return np.zeros((0, 2))
        bends, k = [], int(self.last[point, anchor])
        while k != NONE:
            bends.append(self.corner[k])
            k = int(self.previous[anchor, k])
        way = np.array([self.anchors[anchor], *reversed(bends), self.points[point]])
        moves = np.append(np.any(way[1:] != way[:-1], axis=1), True)  # a point may be a corner itself
        return way[moves]

    def nearest(self, count: int) -> Int[ndarray, "points count"]:
        """The nearest anchors of every point by straight distance, nearest first.

        Raises
        ------
        InputError
            If there are fewer anchors.
        """
        if not 1 <= count <= len(self.anchors):
            raise InputError(
                f"the {count} nearest of {len(self.anchors)} anchors are wanted", "Give fewer, or more anchors"
            )
        return np.argsort(self.distance_m, axis=1, kind="stable")[:, :count]

    def refuse_unreached(self) -> None:
        """Raise an InputError if a free point has no path to any anchor."""
        lost = np.flatnonzero(~self.inside & (self.sight == UNREACHED).all(axis=1))
        if lost.size:
            x, y = self.points[lost[0]]
            raise InputError(
                f"no anchor is in reach of the point ({x:.1f}, {y:.1f}) m"
                + (f" and of {lost.size - 1:,} more" if lost.size > 1 else ""),
                "It lies in a courtyard without a way out: leave such points out, or put an anchor there",
            )


class PlacedAnchors(NamedTuple):
    """Anchors in a city: where they are, and the walls that each one looks past."""

    names: tuple[str, ...]
    position: Float[ndarray, "anchors 2"]
    own: tuple[Walls | None, ...]  # of the other buildings, for an anchor on a roof


def place_anchors(city: City, anchors: Any, *, roof: Sequence[str] | bool = ()) -> PlacedAnchors:
    """Check anchors and put those on a facade onto the wall.

    Parameters
    ----------
    city
        The buildings.
    anchors
        Name -> position in metres, or positions [anchors, 2], named 1, 2, ...
    roof
        Names of anchors that stand on the roof of the building around them: that building does not block them, the
        others do. True: every anchor inside a building.

    Raises
    ------
    InputError
        If an anchor is inside a building and not on its roof, or said to be on a roof and there is none.
    """
    if isinstance(anchors, Mapping):
        names, places = tuple(map(str, anchors)), [np.asarray(p, dtype=float) for p in anchors.values()]
    else:
        places = list(np.asarray(anchors, dtype=float).reshape(-1, 2))
        names = tuple(str(k + 1) for k in range(len(places)))
    if not names:
        raise InputError("there are no anchors", "Give at least one")
    strange = [] if roof is True or roof is False else [n for n in roof if n not in names]
    if strange:
        raise InputError(f"no anchor is called {strange[0]}", f"Known: {', '.join(names)}")
    position, own = [], []
    for name, place in zip(names, places, strict=True):
        if place.shape != (2,) or not np.isfinite(place).all():
            raise InputError(f"anchor {name} is at {place.tolist()}", "Give two finite coordinates in metres")
        named = roof is not True and roof is not False and name in roof
        up = named or (roof is True and city.inside(place)[0])
        spot, walls = _on_roof(city, name, place) if up else (_on_wall(city, name, place), None)
        position.append(spot)
        own.append(walls)
    return PlacedAnchors(names, np.array(position), tuple(own))


def _on_wall(city: City, name: str, place: Float[ndarray, " 2"]) -> Float[ndarray, " 2"]:
    if not city.inside(place)[0]:
        return place
    import shapely

    here, outline = shapely.Point(place), shapely.boundary(city.obstacles)
    x, y = shapely.get_coordinates(shapely.shortest_line(here, outline))[1]
    depth = here.distance(outline)
    if depth > FACADE_M:
        building = city.building_at(place)
        raise InputError(
            f"anchor {name} at ({place[0]:.1f}, {place[1]:.1f}) m is {depth:.1f} m inside "
            + (f"building {building.id}" if building else "a gap between buildings that counts as wall"),
            f"Put it on the facade at ({x:.1f}, {y:.1f}) m, or say that it stands on the roof",
        )
    return np.array([x, y])


def _on_roof(city: City, name: str, place: Float[ndarray, " 2"]) -> tuple[Float[ndarray, " 2"], Walls]:
    building = city.building_at(place)
    if building is None:
        raise InputError(
            f"anchor {name} at ({place[0]:.1f}, {place[1]:.1f}) m is said to be on a roof, but no building is there",
            "Correct its position, or take it off the roof",
        )
    others = [b.polygon for b in city.buildings if b.id != building.id]
    return place, Walls.of(closed(others, city.gap_m) if others else _nothing())


def _nothing() -> Any:
    import shapely

    return shapely.MultiPolygon()


def street_links(city: City, anchors: Any, points: Any, *, roof: Sequence[str] | bool = ()) -> Links:
    """Sight and shortest path of every link between anchors and points in a city.

    Buildings are taken as higher than anchors and mobiles. A signal runs straight where nothing is in the way, and
    otherwise along the shortest path in the plane, which bends around corners of buildings (McGuire and Plataniotis
    2009, Fig. 7: its length is d_c + d_r for one corner). An anchor on a roof sends its first straight piece over its
    own building.

    Parameters
    ----------
    city
        The buildings; what the corners see of each other is computed once per city and kept.
    anchors
        Name -> position in metres, or positions [anchors, 2]; up to half a metre inside a building means on its wall.
    points
        Places of the mobile, [points, 2], in metres.
    roof
        Names of anchors on roofs, or True for all that are inside a building.

    Returns
    -------
    Links
        Exact but for paths that cut a corner by less than a micrometre.

    Raises
    ------
    InputError
        If an anchor is inside a building, or a position is no pair of finite numbers.

    Examples
    --------
    >>> import shapely
    >>> city = City([shapely.box(0, 0, 30, 40)])
    >>> links = street_links(city, {"bs": (0.0, 40.0)}, [[30.0, 0.0], [-5.0, 0.0], [10.0, 10.0]])
    >>> links.sight[:, 0].tolist(), links.length_m[:, 0].round(1).tolist(), links.excess_m[0, 0].round(1).tolist()
    ([1, 0, -1], [70.0, 40.3, inf], 20.0)
    >>> links.path(0, 0).tolist()
    [[0.0, 40.0], [30.0, 40.0], [30.0, 0.0]]
    """
    where = np.asarray(points, dtype=float)
    if where.ndim != 2 or where.shape[1] != 2 or not np.isfinite(where).all():
        raise InputError(f"the points have the shape {where.shape}", "Give finite coordinates in metres, [points, 2]")
    placed = place_anchors(city, anchors, roof=roof)
    graph, m = city.graph, len(placed.names)
    views = [graph.view(p, w) for p, w in zip(placed.position, placed.own, strict=True)]
    trees = graph.trees(placed.position, graph.sees(views, graph.corner))
    inside = city.inside(where)
    distance = np.linalg.norm(where[None] - placed.position[:, None], axis=-1)
    direct = graph.sees(views, where) & ~inside
    length, last = np.where(direct, distance, np.inf), np.full((m, len(where)), NONE)
    free = np.flatnonzero(~inside & ~direct.all(axis=0))
    for begin in range(0, len(free), CHUNK):
        part = free[begin : begin + CHUNK]
        _around_corners(graph, trees.length, where[part], part, direct, length, last)
    sight = np.where(direct, LOS, np.where(np.isfinite(length), NLOS, UNREACHED))
    return Links(
        where,
        placed.position,
        placed.names,
        sight.T,
        length.T,
        distance.T,
        inside,
        last.T,
        trees.previous,
        graph.corner,
    )


def _around_corners(
    graph: CornerGraph, tree: ndarray, points: ndarray, part: ndarray, direct: ndarray, length: ndarray, last: ndarray
) -> None:
    """Shorten ``length`` [anchors, points] of the columns ``part`` by way of every corner that they see."""
    blocked = ~direct[:, part]
    best, via = length[:, part], last[:, part]
    for k, index, leg in graph.seen(points):
        index, leg = index[leg > 0], leg[leg > 0]
        if not len(index) or not np.isfinite(tree[:, k]).any():
            continue
        total = tree[:, k, None] + leg
        better = (total < best[:, index]) & blocked[:, index]
        rows, columns = np.nonzero(better)
        best[rows, index[columns]] = total[rows, columns]
        via[rows, index[columns]] = k
    length[:, part], last[:, part] = best, via
