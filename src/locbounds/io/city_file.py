"""The keys of a city file: buildings, anchors, what is measured, where to draw the map."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal, NamedTuple

from pydantic import ValidationError, model_validator

from locbounds.errors import InputError
from locbounds.io.anchors_csv import anchor_positions, hoisted
from locbounds.io.build import at
from locbounds.io.complain import complain
from locbounds.io.footprints import read_city
from locbounds.io.link_table import read_links
from locbounds.io.schema import Section, key, needed
from locbounds.io.toml import read_toml
from locbounds.io.values import Numbers, Point, Positive, Text, Whole, fail
from locbounds.propagation import City, LinkTable
from locbounds.propagation.city import GAP_M

STEP_M, BOUND_STEP_M = 5.0, 3.0


class CitySection(Section):
    """The buildings and the streets between them."""

    buildings: Text | None = key('GeoJSON file of the footprints in metres, buildings = "buildings.geojson"')
    links_csv: Text | None = key("instead: a ray tracer's links, x_m, y_m, anchor_id, sight, bias_m, deviation_m")
    gap_m: float = key("footprints closer than this are one wall", GAP_M)
    margin_m: float = key("distance from the walls at which streets begin", 0.0)
    courtyards: bool = key("whether courtyards without a way out count as streets", False)
    area_m: Numbers | None = key("rectangle of the map, [smallest x, smallest y, largest x, largest y]")
    step_m: Positive = key("side of the cells of the map", STEP_M)
    bound_step_m: Positive = key("side of the cells on which wwb, ezzb and the least error are summed", BOUND_STEP_M)

    @model_validator(mode="after")
    def _one_source(self):
        if len(given := self.given("buildings", "links_csv")) != 1:
            raise fail(
                f"has {' and '.join(given) or 'neither buildings nor links_csv'}",
                'Give one of them: buildings = "buildings.geojson", or links_csv = "links.csv"',
            )
        return self

    @model_validator(mode="after")
    def _rectangle(self):
        a = self.area_m
        if a is not None and (len(a) != 4 or not (a[0] < a[2] and a[1] < a[3])):
            raise fail(f"has area_m = {list(a)}", "Give four numbers, [smallest x, smallest y, largest x, largest y]")
        return self


class MeasureSection(Section):
    """What the anchors measure."""

    kinds: tuple[Literal["toa", "tdoa"], ...] = key(
        'times of arrival, their differences, or both: ["toa", "tdoa"]', ("toa",)
    )
    std_m: Positive | None = key("standard deviation of a time of arrival in metres, std_m = 5; in links_csv per link")
    nearest: Whole = key("how many nearest anchors measure the mobile", 3)


class CityAnchor(Section):
    """One anchor."""

    position_m: Point | None = key("position in metres, position_m = [120, 340]")
    roof: bool = key("true: on the roof of the building around it, which then does not block it", False)


class CityFileKeys(Section):
    """A whole city file."""

    format: Literal[1] = needed("version of the file format, format = 1")
    title: Text = key("one line that names the city", "")
    city: CitySection = needed('a section [city] with buildings = "buildings.geojson"')
    measure: MeasureSection = needed("a section [measure] with std_m")
    anchors_csv: Text | None = key("table of anchors with the columns anchor_id, x_m, y_m")
    anchors: dict[str, CityAnchor] = key("a section [anchors], a line NAME = { position_m = [..] } each", {})


class CityFile(NamedTuple):
    """A city file with everything that it names."""

    keys: CityFileKeys
    city: City | None
    table: LinkTable | None
    anchors: dict[str, tuple[float, ...]]
    roof: tuple[str, ...]

    @property
    def bounds(self) -> tuple[float, ...]:
        """The rectangle of the map."""
        bounds = self.keys.city.area_m or (() if self.city is None else self.city.bounds)
        return tuple(float(v) for v in bounds)


def load_city(path: str | os.PathLike) -> CityFile:
    """Read a city file, its footprints and its anchors.

    Parameters
    ----------
    path
        The TOML file; other files that it names are relative to it.

    Raises
    ------
    InputError
        If the file cannot be read, a key is unknown or missing, or a value cannot be used.

    Examples
    --------
    >>> load_city("absent.toml")
    Traceback (most recent call last):
    ...
    locbounds.errors.InputError: cannot read absent.toml: no such file or directory. Give a TOML file ...
    """
    path = Path(path)
    found = read_toml(path, "Give a TOML file with a section [city]")
    try:
        keys = CityFileKeys.model_validate(hoisted(found))
    except ValidationError as error:
        raise complain(error, path.name, CityFileKeys) from None
    for name, anchor in keys.anchors.items():
        if len(anchor.position_m or "xy") != 2:
            raise InputError(
                f"{path.name}: anchors.{name}.position_m has {len(anchor.position_m or ())} numbers", "Give x and y"
            )
    with at(path.name):
        places = {name: p[:2] for name, p in anchor_positions(keys.anchors, keys.anchors_csv, path.parent).items()}
    least = 2 if "tdoa" in keys.measure.kinds else 1
    if not least <= keys.measure.nearest <= len(places):
        few = len(places) < least
        raise InputError(
            f"{path.name}: measure.nearest is {keys.measure.nearest}, and there "
            + ("is 1 anchor" if len(places) == 1 else f"are {len(places)} anchors")
            + (": a difference needs 2" if least == 2 and min(keys.measure.nearest, len(places)) < 2 else ""),
            "Add anchors" if few else f"Add anchors, or give measure.nearest a number from {least} to {len(places)}",
        )
    roofs = tuple(name for name, anchor in keys.anchors.items() if anchor.roof)
    if keys.city.links_csv is not None:
        return CityFile(keys, None, read_links(path.parent / keys.city.links_csv, places), places, roofs)
    assert keys.city.buildings is not None
    if keys.measure.std_m is None:
        raise InputError(
            f"{path.name}: measure.std_m is missing", "Add std_m: deviation of a time of arrival in metres"
        )
    city = read_city(path.parent / keys.city.buildings, gap_m=keys.city.gap_m)
    return CityFile(keys, city, None, places, roofs)
