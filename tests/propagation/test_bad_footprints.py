"""Footprints that cannot be used are named, with the reason and a remedy."""

import json

import pytest
import shapely

import locbounds as lb
from datasets import need
from locbounds.io.footprints import read_city
from locbounds.propagation import Building, City, street_links

SQUARE = [[0, 0], [30, 0], [30, 20], [0, 20], [0, 0]]


def write(tmp_path, *rings, **extra):
    features = [
        {"type": "Feature", "properties": {"building_id": 7 + k}, "geometry": {"type": "Polygon", "coordinates": r}}
        for k, r in enumerate(rings)
    ]
    path = tmp_path / "city.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features} | extra))
    return path


def shifted(ring, x, y=0.0):
    return [[a + x, b + y] for a, b in ring]


def test_the_whole_file(tmp_path):
    hole = [[10, 5], [10, 15], [20, 15], [20, 5], [10, 5]]
    city = read_city(write(tmp_path, [SQUARE, hole], [shifted(SQUARE, 100)]))
    assert [b.id for b in city.buildings] == ["7", "8"]
    assert city.obstacles.area == pytest.approx(600 - 100 + 600, abs=0.1)  # niches of the courtyard lose a corner
    assert city.inside([[15.0, 10.0], [5.0, 10.0]]).tolist() == [False, True]
    assert city.notes == []


@pytest.mark.parametrize(
    "rings, cause, remedy",
    [
        ([[[[0, 0], [30, 20], [30, 0], [0, 20], [0, 0]]]], "building 7 is not a polygon: Self-intersection", "cross"),
        ([[[[0, 0], [30, 0], [0, 0], [0, 0]]]], "building 7 is not a polygon", "Redraw"),
        ([[SQUARE, shifted(SQUARE, 20)]], "building 7 is not a polygon", "courtyards lie inside"),
        ([[SQUARE], [shifted(SQUARE, 5)]], "buildings 7 and 8 overlap by 500.0 m^2, 83% of the smaller", "Delete one"),
        ([[SQUARE], [SQUARE]], "buildings 7 and 8 overlap", "Delete one"),
        ([[[[11.57, 48.1], [11.5701, 48.1], [11.5701, 48.1001], [11.57, 48.1]]]], "degrees, not metres", "Project"),
        ([[]], "building 7 is", ""),
        ([[[[0, 0], [1, 1]]]], "building 7 is no polygon", "at least four"),
    ],
)
def test_footprints_are_refused(tmp_path, rings, cause, remedy):
    with pytest.raises(lb.InputError) as caught:
        read_city(write(tmp_path, *rings))
    assert cause in caught.value.cause
    assert remedy in caught.value.remedy


def test_a_stated_geographic_system_is_refused(tmp_path):
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    with pytest.raises(lb.InputError, match="degrees"):
        read_city(write(tmp_path, [SQUARE], crs=crs))


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"type": "FeatureCollection"}', '{"type": "Point", "coordinates": [0, 0]}']
)
def test_files_that_are_no_footprints(tmp_path, text):
    path = tmp_path / "x.geojson"
    path.write_text(text)
    with pytest.raises(lb.InputError, match=r"x\.geojson"):
        read_city(path)
    with pytest.raises(lb.InputError, match="no such file"):
        read_city(tmp_path / "absent.geojson")


def test_what_can_be_repaired_is(tmp_path):
    spike = [[0, 0], [30, 0], [30, 20], [15, 20], [15, 40], [15, 20], [0, 20], [0, 0]]
    city = read_city(write(tmp_path, [spike]))
    assert city.obstacles.area == pytest.approx(600)
    assert "building 7 repaired" in city.notes[0]
    twice = [[0, 0], [30, 0], [30, 0], [30, 20], [0, 20], [0, 0]]
    assert read_city(write(tmp_path, [twice])).obstacles.area == pytest.approx(600)


def test_small_overlaps_and_gaps_are_closed(tmp_path):
    overlapping = read_city(write(tmp_path, [SQUARE], [shifted(SQUARE, 29.5)]))
    assert overlapping.obstacles.area == pytest.approx(59.5 * 20)
    assert "1 pairs of buildings overlap, 10.0 m^2 in all" in overlapping.notes[0]
    across = [[-10.0, 10.0], [70.0, 10.0]], [[30.025, -10.0], [30.025, 30.0]]
    gap = write(tmp_path, [SQUARE], [shifted(SQUARE, 30.05)])
    for gap_m, sight in ((0.0, 0), (0.1, 1)):
        links = street_links(read_city(gap, gap_m=gap_m), across[1][:1], across[1][1:])
        assert links.sight[0, 0] == sight


def test_names_and_numbers_of_buildings():
    box = shapely.box(0, 0, 10, 10)
    with pytest.raises(lb.InputError, match="building a is given twice"):
        City([Building("a", box), Building("a", shapely.box(20, 0, 30, 10))])
    with pytest.raises(lb.InputError, match="no buildings"):
        City([])
    with pytest.raises(lb.InputError, match="gap_m"):
        City([box], gap_m=-1.0)


@pytest.mark.parametrize(
    "anchors, roof, cause, remedy",
    [
        ({"bs": (5.0, 2.0)}, (), "anchor bs at (5.0, 2.0) m is 2.0 m inside building 0", "facade at (5.0, 0.0) m"),
        ({"bs": (50.0, 2.0)}, ["bs"], "said to be on a roof, but no building is there", "Correct"),
        ({"bs": (50.0, 2.0)}, ["b"], "no anchor is called b", "Known: bs"),
        ({"bs": (float("nan"), 2.0)}, (), "anchor bs is at", "finite"),
        ({"bs": (1.0, 2.0, 3.0)}, (), "anchor bs is at", "two"),
        ({}, (), "no anchors", "at least one"),
    ],
)
def test_anchors_are_refused(anchors, roof, cause, remedy):
    with pytest.raises(lb.InputError) as caught:
        street_links(City([shapely.box(0, 0, 10, 10)]), anchors, [[20.0, 0.0]], roof=roof)
    assert cause in caught.value.cause
    assert remedy in caught.value.remedy


def test_an_anchor_just_inside_goes_to_the_wall():
    links = street_links(City([shapely.box(0, 0, 10, 10)]), {"bs": (9.9, 5.0)}, [[20.0, 5.0], [-5.0, 5.0]])
    assert links.anchors.tolist() == [[10.0, 5.0]]
    assert links.sight[:, 0].tolist() == [0, 1]


def test_streets_with_margin_courtyards_and_nothing_left():
    ring = shapely.box(0, 0, 40, 40).difference(shapely.box(10, 10, 30, 30))
    city, area = City([ring], gap_m=0.0), shapely.box(-10, -10, 50, 50)
    assert city.streets(area).area == pytest.approx(60**2 - 40**2)
    assert city.streets(area, courtyards=True).area == pytest.approx(60**2 - 40**2 + 20**2)
    assert city.streets(area, margin_m=2.0).area == pytest.approx(60**2 - 44**2)
    with pytest.raises(lb.InputError, match="no street is left"):
        city.streets()
    with pytest.raises(lb.InputError, match="margin"):
        city.streets(area, margin_m=-1.0)


def test_munich():
    city = read_city(need("city_munich") / "buildings.geojson")
    assert len(city.buildings) == 387
    assert city.notes == ["160 pairs of buildings overlap, 84.9 m^2 in all: merged"]
    assert city.buildings[0].height_m == 15.7
    links = street_links(city, {"square": (300.0, 480.0)}, [[300.0, 490.0]], roof=True)
    assert links.length_m.shape == (1, 1)
