"""Building footprints from GeoJSON."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import shapely

from locbounds.errors import InputError
from locbounds.propagation.city import DEGREES, GAP_M, Building, City

ID_KEYS = ("building_id", "id", "osm_id", "@id")
HEIGHT_KEYS = ("height_m", "height")
GEOGRAPHIC = ("CRS84", "EPSG::4326", "EPSG:4326", "EPSG::4258", "EPSG:4258")


def read_city(path: str | os.PathLike, *, gap_m: float = GAP_M) -> City:
    r"""The buildings of a GeoJSON file, in metres.

    Parameters
    ----------
    path
        A FeatureCollection, a Feature or a geometry of Polygons and MultiPolygons; courtyards are holes. A building is
        named by its property ``building_id``, ``id`` or ``osm_id``, by the feature's own ``id``, or by its number.
        ``height_m`` is kept. Other geometries (points, lines) are left out and noted.
    gap_m
        Footprints closer than this are one wall.

    Raises
    ------
    InputError
        If the file cannot be read, its coordinates are degrees, or a footprint cannot be used; the message names the
        building and the reason.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "block.geojson"
    >>> _ = path.write_text('{"type": "Polygon", "coordinates": [[[0, 0], [30, 0], [30, 20], [0, 20], [0, 0]]]}')
    >>> read_city(path).obstacles.area
    600.0
    """
    path = Path(path)
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read the buildings from {path}: {reason.lower()}", "Give a GeoJSON file") from error
    if not isinstance(document, dict) or "type" not in document:
        raise InputError(f"{path} is no GeoJSON", "Give a FeatureCollection of Polygons")
    system = str(document.get("crs") or "")
    if any(name in system for name in GEOGRAPHIC):
        raise InputError(f"{path} says that its coordinates are degrees", DEGREES)
    buildings, left_out = [], 0
    for number, feature in enumerate(_features(document, path)):
        name, shape = _name(feature, number), feature.get("geometry")
        if not isinstance(shape, dict) or shape.get("type") not in ("Polygon", "MultiPolygon"):
            left_out += 1
            continue
        buildings.append(Building(name, _polygon(shape, name, path), _height(feature)))
    if not buildings:
        raise InputError(f"{path} has no polygon", "Give a FeatureCollection of Polygons, one per building")
    try:
        city = City(buildings, gap_m=gap_m)
    except InputError as error:
        raise InputError(f"{path.name}: {error.cause}", error.remedy) from error
    if left_out:
        city.notes.append(f"{left_out} features without a polygon left out")
    return city


def _features(document: dict[str, Any], path: Path) -> list[dict[str, Any]]:
    if document["type"] == "FeatureCollection":
        features = document.get("features")
        if not isinstance(features, list) or not all(isinstance(f, dict) for f in features):
            raise InputError(f"{path} has no list of features", "Give a FeatureCollection of Polygons")
        return features
    return [document if document["type"] == "Feature" else {"geometry": document}]


def _name(feature: dict[str, Any], number: int) -> str:
    properties = feature.get("properties") or {}
    known = [properties[key] for key in ID_KEYS if properties.get(key) is not None]
    name = known[0] if known else feature.get("id", number)
    return str(name)


def _height(feature: dict[str, Any]) -> float:
    properties = feature.get("properties") or {}
    for key in HEIGHT_KEYS:
        try:
            return float(properties[key])
        except (KeyError, TypeError, ValueError):
            continue
    return math.nan


def _polygon(shape: dict[str, Any], name: str, path: Path) -> Any:
    """The polygon in the plane; heights of the coordinates are dropped."""
    try:
        return shapely.force_2d(shapely.from_geojson(json.dumps(shape)))
    except shapely.errors.ShapelyError as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            f"{path.name}: the footprint of building {name} is no polygon: {reason}",
            "A ring is a list of at least four [x, y], the last one equal to the first",
        ) from error
