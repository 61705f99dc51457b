"""Buildings seen from above: checked footprints, and what they leave free."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely

from locbounds.axes import Bool, Float, ndarray
from locbounds.errors import InputError

if TYPE_CHECKING:
    from locbounds.propagation.corners import CornerGraph

GAP_M = 0.1  # footprints closer than this are one wall: gaps of mapping are no streets
REPAIR = 0.01  # share of a footprint's area that a repair may change
OVERLAP = 0.1  # share of the smaller footprint that two of them may have in common
SMALLEST_M2 = 1.0  # where every footprint is smaller, the coordinates are no metres
LONGEST_MITRE = 20.0  # corners sharper than 6 degrees are cut off when gaps are closed

DEGREES = "Project them to metres first (east, north), for example with pyproj or: ogr2ogr -t_srs EPSG:25832"


class Building(NamedTuple):
    """One footprint: its name, its polygon in metres, its height in metres or NaN.

    Examples
    --------
    >>> Building("town hall", shapely.box(0, 0, 30, 20)).polygon.area
    600.0
    """

    id: str
    polygon: shapely.Polygon | shapely.MultiPolygon
    height_m: float = math.nan


class City:
    """Buildings that block the sight; between them signals run straight and bend around corners.

    Parameters
    ----------
    buildings
        Footprints as Shapely polygons (courtyards are their holes), or :class:`Building` with names; in metres.
    gap_m
        Footprints closer than this are one wall. 0 takes them as they are; what touches in a single point may then
        count as open or as closed.

    Attributes
    ----------
    buildings
        The footprints, repaired where that was possible.
    obstacles
        Their union, a Shapely geometry.
    notes
        What was repaired, one line each.

    Raises
    ------
    InputError
        If a footprint cannot be repaired without changing its area, footprints overlap by more than a tenth of the
        smaller one, names repeat, there is none, or all are so small that the coordinates must be degrees. The message
        names the building.

    Examples
    --------
    >>> city = City([shapely.box(0, 0, 300, 300), shapely.box(320, 0, 620, 300)])
    >>> len(city.buildings), city.inside([[10.0, 10.0], [310.0, 10.0]]).tolist()
    (2, [True, False])
    >>> City([shapely.box(11.57, 48.13, 11.5702, 48.1301)])
    Traceback (most recent call last):
    ...
    locbounds.errors.InputError: the largest footprint has 2e-08 square units: these are degrees, not metres. ...
    """

    def __init__(self, buildings: Sequence[Building | shapely.Polygon | shapely.MultiPolygon], *, gap_m: float = GAP_M):
        if not math.isfinite(gap_m) or gap_m < 0:
            raise InputError(f"gap_m is {gap_m}", "Give metres, 0 or more")
        named = [b if isinstance(b, Building) else Building(str(k), b) for k, b in enumerate(buildings)]
        if not named:
            raise InputError("there are no buildings", "Give at least one footprint")
        names = [b.id for b in named]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"the building {twice} is given twice", "Give every building its own id")
        self.notes: list[str] = []
        self.buildings = tuple(self._repaired(b) for b in named)
        largest = max(b.polygon.area for b in self.buildings)
        if largest < SMALLEST_M2:
            cause = f"the largest footprint has {largest:.2g} square units: these are degrees, not metres"
            raise InputError(cause, DEGREES)
        self._refuse_overlaps()
        self.gap_m = gap_m
        self.obstacles = closed([b.polygon for b in self.buildings], gap_m)

    def _repaired(self, b: Building) -> Building:
        polygon = b.polygon
        if polygon.is_empty or not np.isfinite(shapely.get_coordinates(polygon)).all():
            what = "empty" if polygon.is_empty else "not finite"
            raise InputError(f"the footprint of building {b.id} is {what}", "Correct it or leave it out")
        if polygon.is_valid and polygon.area > 0:
            return b
        reason = shapely.is_valid_reason(polygon) if not polygon.is_valid else "no area"
        mended = shapely.make_valid(polygon)
        parts = [p for p in shapely.get_parts(mended) if p.geom_type in ("Polygon", "MultiPolygon")]
        whole: Any = shapely.union_all(parts) if parts else shapely.Polygon()
        hull = shapely.union_all([shapely.make_valid(shapely.Polygon(p.exterior)) for p in shapely.get_parts(polygon)])
        if whole.area == 0 or abs(whole.area - polygon.area) > REPAIR * hull.area:
            raise InputError(
                f"the footprint of building {b.id} is not a polygon: {reason}",
                "Redraw it so that its outline does not cross itself and courtyards lie inside, or leave it out",
            )
        self.notes.append(f"building {b.id} repaired: {reason}")
        return b._replace(polygon=whole)

    def _refuse_overlaps(self) -> None:
        polygons = np.array([b.polygon for b in self.buildings], dtype=object)
        i, j = shapely.STRtree(polygons).query(polygons, predicate="intersects")
        i, j = i[i < j], j[i < j]
        common = shapely.area(shapely.intersection(polygons[i], polygons[j]))
        share = common / np.minimum(shapely.area(polygons[i]), shapely.area(polygons[j]))
        if (share > OVERLAP).any():
            k = int(np.argmax(share))
            a, b = self.buildings[i[k]].id, self.buildings[j[k]].id
            more = int((share > OVERLAP).sum()) - 1
            raise InputError(
                f"buildings {a} and {b} overlap by {common[k]:.1f} m^2, {share[k]:.0%} of the smaller one"
                + (f" (and {more} more pairs overlap)" if more else ""),
                "Delete one of them, or merge them into one footprint",
            )
        if common.sum() > 0:
            self.notes.append(f"{(common > 0).sum()} pairs of buildings overlap, {common.sum():.1f} m^2 in all: merged")

    @property
    def bounds(self) -> Float[ndarray, " 4"]:
        """Smallest x, y and largest x, y of the footprints."""
        return np.array(self.obstacles.bounds)

    @cached_property
    def graph(self) -> CornerGraph:
        """Corners around which signals bend and which of them see each other; made once."""
        from locbounds.propagation.corners import CornerGraph

        return CornerGraph(self.obstacles)

    def inside(self, points: Any) -> Bool[ndarray, " points"]:
        """Which points lie inside a building; its walls do not count."""
        return self.graph.walls.inside(np.asarray(points, dtype=float).reshape(-1, 2))

    def building_at(self, point: Any) -> Building | None:
        """The building around a point, the nearest one if several touch it."""
        here = shapely.Point(point)
        around = [b for b in self.buildings if b.polygon.covers(here)]
        return around[0] if around else None

    def streets(
        self, area: shapely.Polygon | None = None, *, margin_m: float = 0.0, courtyards: bool = False
    ) -> shapely.Polygon | shapely.MultiPolygon:
        """What is free of buildings.

        Parameters
        ----------
        area
            The part of the plane that is meant; by default the rectangle around all buildings.
        margin_m
            Distance from the walls at which streets begin.
        courtyards
            Whether courtyards without a way out count.

        Raises
        ------
        InputError
            If nothing is left.

        Examples
        --------
        >>> city = City([shapely.box(0, 0, 10, 10), shapely.box(14, 0, 24, 10)])
        >>> city.streets().area, city.streets(margin_m=1.0).area
        (40.0, 20.0)
        """
        if not math.isfinite(margin_m) or margin_m < 0:
            raise InputError(f"the margin of the streets is {margin_m} m", "Give metres, 0 or more")
        area = shapely.box(*self.obstacles.bounds) if area is None else area
        solid = self.obstacles
        if not courtyards:
            solid = shapely.union_all([shapely.Polygon(p.exterior) for p in shapely.get_parts(solid)])
        if margin_m > 0:
            solid = shapely.buffer(solid, margin_m, join_style="mitre")
        free = shapely.difference(area, solid)
        parts = [p for p in shapely.get_parts(free) if p.geom_type == "Polygon" and p.area > 0]
        if not parts:
            raise InputError(
                f"no street is left: the buildings and a margin of {margin_m:g} m cover the whole area",
                "Choose a larger area or a smaller margin",
            )
        return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)


def closed(polygons: Sequence[Any], gap_m: float) -> Any:
    """The union of polygons, with gaps narrower than ``gap_m`` filled.

    The union grows and shrinks again by half the gap. Corners that signals bend around stay sharp and in place (mitred
    while growing); niches lose their innermost corner (cut while shrinking), and with it what joins two buildings that
    touch in a single point remains.
    """
    union = shapely.union_all(list(polygons))
    if gap_m > 0:
        grown = shapely.buffer(union, gap_m / 2, join_style="mitre", mitre_limit=LONGEST_MITRE)
        union = shapely.buffer(grown, -gap_m / 2, join_style="bevel")
    return union
