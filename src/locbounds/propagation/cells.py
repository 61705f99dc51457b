"""Which anchors serve which part of the streets: the prior that the choice of the nearest anchors implies."""

from typing import Any, NamedTuple

import numpy as np
import shapely

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.priors import PositionPrior, PriorMixture, UniformPolygon

SMALLEST = 1e-9  # share of the area below which a part is rounding


class StreetCell(NamedTuple):
    """The part of the streets that one set of anchors serves.

    Attributes
    ----------
    nearest
        Indices of the anchors in use; the first one is the nearest, the others follow in the anchors' order.
    share
        Probability of the cell for a mobile that is anywhere on the streets with equal probability.
    region
        A Shapely polygon or several.

    Examples
    --------
    >>> import locbounds as lb
    >>> cells = lb.street_cells(shapely.box(0, 0, 100, 10), [[0.0, 5.0], [100.0, 5.0]], count=1)
    >>> [(cell.nearest, cell.share, cell.prior.area) for cell in cells]
    [((0,), 0.5, 500.0), ((1,), 0.5, 500.0)]
    """

    nearest: tuple[int, ...]
    share: float
    region: Any

    @property
    def prior(self) -> PositionPrior:
        """Uniform law on the cell."""
        return uniform_on(self.region)


def uniform_on(region: Any) -> PositionPrior:
    """Uniform law on a Shapely polygon, with courtyards, or on several disjoint ones.

    Examples
    --------
    >>> prior = uniform_on(shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 5, 1)]))
    >>> np.exp(prior.log_density(np.array([[0.5, 0.5], [1.5, 0.5]]))).round(3).tolist()
    [0.25, 0.0]
    """
    parts = [p for p in shapely.get_parts(shapely.remove_repeated_points(region, 1e-9)) if p.area > 0]
    if not parts:
        raise InputError("the street region is empty", "Choose a larger area, or a smaller margin from the walls")
    laws = [UniformPolygon(_ring(p.exterior), [_ring(hole) for hole in p.interiors]) for p in parts]
    areas = np.array([p.area for p in parts])
    return laws[0] if len(laws) == 1 else PriorMixture(areas / areas.sum(), laws)


def _ring(ring: Any) -> Float[ndarray, "corners 2"]:
    return shapely.get_coordinates(ring)


def street_cells(streets: Any, anchors: Any, *, count: int) -> list[StreetCell]:
    """Split streets by the nearest anchor and the set of the ``count`` nearest ones.

    A mobile is measured by its nearest anchors, so that the choice of these anchors tells where it can be. The split
    is exact: cells of a Voronoi diagram of higher order, cut out of the streets.

    Parameters
    ----------
    streets
        A Shapely polygon or several, for example :meth:`City.streets`.
    anchors
        Positions [anchors, 2] in metres.
    count
        How many anchors are in use.

    Returns
    -------
    list of StreetCell
        In the order of the nearest anchor; their shares sum to one.

    Raises
    ------
    InputError
        If there are fewer anchors, or no street.

    Examples
    --------
    >>> import locbounds as lb
    >>> [cell.nearest for cell in lb.street_cells(shapely.box(0, 0, 9, 1), [[0, 0], [4, 0], [9, 0]], count=2)]
    [(0, 1), (1, 0), (1, 2), (2, 1)]
    """
    places = np.asarray(anchors, dtype=float)
    if not 1 <= count <= len(places):
        raise InputError(f"the {count} nearest of {len(places)} anchors are wanted", "Give fewer, or more anchors")
    if streets.is_empty or not streets.area > 0:
        raise InputError("the street region is empty", "Choose a larger area, or a smaller margin from the walls")
    xmin, ymin, xmax, ymax = streets.bounds
    frame = np.array([[xmin, ymin], [xmax, ymin], [xmax, ymax], [xmin, ymax]])
    shapely.prepare(streets)
    found: dict[tuple[int, ...], list[Any]] = {}

    def split(cell: Float[ndarray, "corners 2"], chosen: tuple[int, ...]) -> None:
        if len(chosen) == count:
            part = shapely.intersection(shapely.Polygon(cell), streets)
            if part.area > SMALLEST * streets.area:
                found.setdefault((chosen[0], *sorted(chosen[1:])), []).append(part)
            return
        rest = [k for k in range(len(places)) if k not in chosen]
        for k in rest:
            mine = cell
            for other in rest:
                if other != k and len(mine):
                    mine = nearer(mine, places[k], places[other])
            if len(mine) and _area(mine) > SMALLEST * streets.area:
                split(mine, (*chosen, k))

    split(frame, ())
    whole = streets.area
    cells = []
    for nearest, parts in sorted(found.items()):
        region = shapely.union_all(parts)
        cells.append(StreetCell(nearest, region.area / whole, _polygons(region)))
    return cells


def nearer(
    cell: Float[ndarray, "corners 2"], to: Float[ndarray, " 2"], than: Float[ndarray, " 2"]
) -> Float[ndarray, "cut 2"]:
    """The part of a convex polygon that is nearer to one place than to another (Sutherland and Hodgman).

    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    >>> nearer(square, np.array([0.0, 1.0]), np.array([2.0, 1.0])).tolist()
    [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]]
    """
    side = (cell - (to + than) / 2) @ (to - than)
    out = []
    for k in range(len(cell)):
        after = (k + 1) % len(cell)
        if side[k] >= 0:
            out.append(cell[k])
        if side[k] * side[after] < 0:
            out.append(cell[k] + (cell[after] - cell[k]) * side[k] / (side[k] - side[after]))
    return np.array(out).reshape(-1, 2)


def _area(cell: Float[ndarray, "corners 2"]) -> float:
    after = np.roll(cell, -1, axis=0)
    return 0.5 * abs(float(np.sum(cell[:, 0] * after[:, 1] - cell[:, 1] * after[:, 0])))


def _polygons(region: Any) -> Any:
    parts = [p for p in shapely.get_parts(region) if p.geom_type == "Polygon" and p.area > 0]
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)
