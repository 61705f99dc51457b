"""The keys of a plan file, version 1: the same style, and the same noise tables, as scenario files."""

from typing import Any, Literal

from pydantic import Field, model_validator

from locbounds.io.schema import FORMAT, NlosTable, NoiseTable, OutlierTable, Section, key, needed
from locbounds.io.values import (
    Number,
    Point,
    Positive,
    Spread,
    Text,
    fail,
)

MEASURES = ("toa", "tdoa", "rss", "aoa")
SHAPES = (("outline_m",), ("center_m", "radius_m"), ("low_m", "high_m"))
WAYS = "Give outline_m; or center_m and radius_m; or low_m and high_m"
CORNERS = "corners in order along the edge, [[0, 0], [40, 0], [40, 20]]; the last may repeat the first"


class Shape(Section):
    """A region of the plane: a polygon, a disc or a box."""

    outline_m: list[Point] | None = key(CORNERS)
    holes_m: list[list[Point]] | None = key("outlines of what is cut out of the outline, [[[x, y], ...], ...]")
    center_m: Point | None = key("centre of a disc, [x, y]")
    radius_m: Positive | None = key("radius of the disc, positive")
    low_m: Point | None = key("lower left corner of a box, [x, y] (in 3-D [x, y, z])")
    high_m: Point | None = key("upper right corner of the box")

    def shape(self) -> tuple[str, ...] | None:
        """Which way the region is given; None: none."""
        given = self.given(*dict.fromkeys(name for way in SHAPES for name in way))
        if not given:
            return None
        way = next((way for way in SHAPES if set(way) == set(given)), None)
        if way is None:
            raise fail(f"has {', '.join(given)}", WAYS)
        return way


class AreaSection(Shape):
    """Where the map is drawn."""

    height_m: Any = key("3-D: the height of the map, a number; or [lowest, highest] of the device")

    @model_validator(mode="after")
    def _one_way(self):
        if self.shape() is None:
            raise fail("is empty", WAYS)
        if self.holes_m is not None and self.outline_m is None:
            raise fail("has holes_m without outline_m", "Give outline_m")
        return self


class PriorTable(Shape):
    """What is known of the position before the measurement."""

    position_m: Point | None = key("Gaussian: the mean position")
    position_std_m: Spread | None = key("Gaussian: a number, one per axis, or a covariance matrix in m^2")
    mixture: list["PriorTable"] | None = key("one of several laws, [{ share = 0.8, center_m = .., radius_m = .. }, ..]")
    share: Positive | None = key("share of this law in a mixture")

    @model_validator(mode="after")
    def _one_way(self):
        ways = [self.shape() is not None, bool(self.given("position_m", "position_std_m")), self.mixture is not None]
        if sum(ways) != 1:
            raise fail(
                "has more than one law" if sum(ways) else "is empty",
                f"{WAYS}; or position_m and position_std_m; or mixture",
            )
        if ways[1] and len(self.given("position_m", "position_std_m")) < 2:
            raise fail("has only one of position_m and position_std_m", "Give both")
        if self.holes_m is not None and self.outline_m is None:
            raise fail("has holes_m without outline_m", "Give outline_m")
        if self.mixture is not None and (not self.mixture or any(part.share is None for part in self.mixture)):
            raise fail("has a mixture with a law without share", "Give every law of the mixture its share")
        return self


class PlanLinks(Section):
    """What all links share."""

    measure: Literal["toa", "tdoa", "rss", "aoa"] | None = key(
        'what a link measures: "toa" (range), "tdoa" (range differences), "rss" (strength) or "aoa" (angle)'
    )
    sight: Any = key('"los", "nlos", or the probability of NLOS that no one reports, { nlos = 0.3 }; "los" if left out')
    los: NoiseTable | None = key("error in LOS: { std_m = 3 }, for rss { std_db = 4 }, for aoa { std_deg = 2 }")
    nlos: NlosTable | None = key("error in NLOS, as los; with plus_los the excess on top; left out: it tells nothing")
    outlier: OutlierTable | None = key("rare wide errors in both, for example { share = 0.01, std_m = 200 }")
    exponent: Positive | None = key("path loss exponent of rss, 2 in free space, 2 to 4 in built-up areas")
    near_field_m: Positive | None = key("rss: radius below which strength no longer depends on distance")
    reference: Text | None = key("tdoa: name of the reference anchor (it changes no bound); the first if left out")

    @model_validator(mode="after")
    def _sight(self):
        if self.sight is None or self.sight in ("los", "nlos"):
            return self
        share = self.sight.get("nlos") if isinstance(self.sight, dict) and set(self.sight) == {"nlos"} else None
        if isinstance(share, bool) or not isinstance(share, int | float) or not 0 <= share <= 1:
            raise fail(f"has sight = {self.sight!r}", 'Write "los", "nlos", or { nlos = 0.3 }, a probability')
        return self

    def nlos_probability(self) -> float:
        """0: known LOS; 1: known NLOS."""
        return self.sight["nlos"] if isinstance(self.sight, dict) else float(self.sight == "nlos")


class PlanAnchor(PlanLinks):
    """One anchor: its position, and what differs from [links]."""

    position_m: Point | None = key("position in metres, for example position_m = [30, 20]; three numbers for 3-D")


class PlanFile(Section):
    """A whole plan file."""

    format: Literal[1] = needed(f"version of the file format, format = {FORMAT}")
    title: Text = Field("", description="one line that names the plan")
    anchors_csv: Text | None = key("table of anchors with the columns anchor_id, x_m, y_m and, in 3-D, z_m")
    clock: Literal["known", "unknown"] | None = key('"known" or "unknown": whether toa has a common clock offset')
    clock_std_m: Number | None = key("instead of clock: standard deviation of the clock offset times c, in metres")
    area: AreaSection = needed("a section [area] with outline_m, or center_m and radius_m, or low_m and high_m")
    prior: PriorTable | None = key("a section [prior] with what is known of the position; uniform over the area if not")
    links: PlanLinks = Field(PlanLinks(), description="a section [links] with what all links share")
    anchors: dict[str, PlanAnchor] = Field(
        {}, description="a section [anchors], a line NAME = { position_m = [..] } each"
    )

    @model_validator(mode="after")
    def _clock(self):
        if self.clock is not None and self.clock_std_m is not None:
            raise fail("the file has both clock and clock_std_m", "Keep one of them")
        if self.clock_std_m is not None and self.clock_std_m <= 0:
            raise fail(
                f"the file has clock_std_m = {self.clock_std_m}, which is not positive",
                'Give a positive number, or clock = "known"',
            )
        return self
