"""Bounds over streets: rasters against integrals done otherwise, maps against plans, city files."""

import json

import numpy as np
import pytest
import shapely
from scipy.special import erfc
from typer.testing import CliRunner

import locbounds as lb
from locbounds.cli.app import app
from locbounds.io.city_file import load_city
from locbounds.propagation import City, LinkTable
from locbounds.static.street_map import cell_bounds, street_crlb, street_map
from locbounds.static.street_raster import raster_ezzb, raster_mmse, raster_wwb, street_raster
from refusals import refused

HALVED = 4.0  # the error of the midpoint rule falls by four when the step is halved


def grid(step, region):
    xmin, ymin, xmax, ymax = region.bounds
    x, y = np.arange(xmin + step / 2, xmax, step), np.arange(ymin + step / 2, ymax, step)
    p = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    return p[shapely.contains_xy(region, *p.T)]


def line(sigma, step=1.0, length=100.0):
    x = np.arange(step / 2, length, step)
    return street_raster(np.stack([x, np.full(len(x), step / 2)], 1), x[:, None], [[sigma**2]], step_m=step)


def test_ziv_zakai_on_a_line_in_closed_form():
    sigma, length = 7.0, 100.0
    h = np.linspace(0, length, 200_001)
    exact = np.trapezoid(h * (1 - h / length) * 0.5 * erfc(h / (2 * np.sqrt(2) * sigma)), h)
    found = [raster_ezzb(line(sigma, step))[1][0] ** 2 for step in (1.0, 0.5)]
    assert found[1] == pytest.approx(exact, rel=2e-3)
    assert abs(found[1] - exact) < 1.5 * abs(found[0] - exact) / HALVED


def test_weiss_weinstein_on_a_line_in_closed_form():
    sigma, length = 7.0, 100.0
    h = np.arange(1.0, 71.0)
    rho, mu = 1 - h / length, np.exp(-(h**2) / (8 * sigma**2))
    inner = np.maximum(1 - 2 * h / length, 0) * np.exp(-((2 * h) ** 2) / (8 * sigma**2))
    by_hand = h**2 * (rho * mu) ** 2 / (2 * (np.maximum(1 - h / length, 0) - inner))
    # T(h, h) + T(-h, -h) = 2 (1 - h/L), and T(h, -h) needs theta + h and theta - h on the line
    assert raster_wwb(line(sigma))[0] ** 2 == pytest.approx(by_hand.max(), rel=1e-9)


def test_without_information_the_prior_is_left():
    box = street_raster(grid(1.0, shapely.box(0, 0, 40, 20)), np.zeros((800, 1)), [[1.0]], step_m=1.0)
    variance = (40**2 + 20**2) / 12
    assert raster_mmse(box, draws=50)[0] ** 2 == pytest.approx(variance, rel=1e-12)
    assert raster_ezzb(box)[0] ** 2 == pytest.approx(variance, rel=4e-3)  # discrete sums: (n^2 - 1) / 12


def test_not_convex_regions_by_brute_force():
    """An L: Weiss-Weinstein terms only where the middle place is a street too."""
    region = shapely.union_all([shapely.box(0, 0, 30, 6), shapely.box(0, 0, 6, 20)])
    p, sigma = grid(1.0, region), 4.0
    m = np.linalg.norm(p[:, None] - np.array([[40.0, 3.0], [3.0, 40.0]]), axis=-1)
    raster = street_raster(p, m, sigma**2 * np.eye(2), step_m=1.0)
    value, h = raster_wwb(raster)
    where = {tuple(q): k for k, q in enumerate(p.tolist())}

    def term(u, v):
        total = 0.0
        for q in p:
            i, j = where.get(tuple(q + u)), where.get(tuple(q + v))
            if i is not None and j is not None:
                total += np.exp(-np.sum((m[i] - m[j]) ** 2) / (8 * sigma**2))
        return total / len(p)

    steps = np.diag(h)
    mu = np.array([term(np.zeros(2), u) for u in steps])
    q = np.array([[term(u, v) + term(-u, -v) - term(u, -v) - term(-u, v) for v in steps] for u in steps])
    moved = steps.T * mu
    assert value**2 == pytest.approx(np.trace(moved @ np.linalg.inv(q) @ moved.T), rel=1e-9)
    least = raster_mmse(raster, draws=3000, seed=1)
    assert max(value, raster_ezzb(raster)[0]) < least[0] + 3 * least[1]


def test_deviations_that_differ_from_place_to_place():
    p = grid(1.0, shapely.box(0, 0, 12, 5))
    m = np.linalg.norm(p[:, None] - np.array([[30.0, 0.0], [0.0, 30.0]]), axis=-1)
    same = street_raster(p, m, 4.0 * np.eye(2), step_m=1.0)
    each = street_raster(p, m, np.broadcast_to(4.0 * np.eye(2), (len(p), 2, 2)), step_m=1.0)
    assert raster_wwb(each)[0] == pytest.approx(raster_wwb(same)[0], rel=1e-9)
    assert raster_mmse(each, seed=3)[0] == pytest.approx(raster_mmse(same, seed=3)[0], rel=1e-9)
    assert raster_ezzb(each)[0] < raster_ezzb(same)[0]  # only a bound of the error probability is known
    std = 1.0 + 2.0 * (p[:, 0] > 6)
    varied = street_raster(p, m, std[:, None, None] ** 2 * np.eye(2), step_m=1.0)
    least = raster_mmse(varied, draws=4000)
    assert max(raster_wwb(varied)[0], raster_ezzb(varied)[0]) < least[0] + 3 * least[1]


@pytest.mark.parametrize("measure", ["toa", "tdoa"])
def test_the_crlb_is_that_of_a_plan(measure):
    anchors = {"a": (-20.0, 10.0), "b": (50.0, 60.0), "c": (60.0, -30.0)}
    city, points = City([shapely.box(0, 0, 30, 20)]), np.array([[-5.0, 30.0], [40.0, 7.0], [15.0, -12.0]])
    links = lb.street_links(city, anchors, points)
    used = np.tile(np.arange(3), (3, 1))
    ranges = lb.StreetRanges(city, anchors, difference_to=None if measure == "toa" else 0)
    covariance = 4.0 * (np.eye(3) if measure == "toa" else np.eye(2) + 1)
    J = lb.Plan([lb.Observations([ranges], covariance)]).information(points)
    expected = np.sqrt(np.trace(np.linalg.inv(J), axis1=1, axis2=2))
    np.testing.assert_allclose(street_crlb(links, used, 2.0, measure), expected, rtol=1e-9)


def test_no_crlb_at_sight_boundaries():
    city, anchors = City([shapely.box(0, 0, 10, 10)]), [[-10.0, 0.0], [30.0, 30.0], [30.0, -30.0]]
    found = street_map(city, anchors, [[20.0, 0.2], [20.0, 5.0], [5.0, 5.0]], std_m=1.0)
    assert found.status == ["boundary", "", "building"]
    assert np.isnan(found.rmse_m["toa"][[0, 2]]).all()
    assert "refused at 1 of 2 street points (50%)" in found.verdict


def test_status_and_verdict_per_measure():
    """On the line through all anchors, beyond them: differences tell nothing, times the distance only."""
    places, points = [[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]], [[25.0, 0.0], [25.0, 9.0], [-9.0, 4.0], [35.0, 35.0]]
    found = street_map(City([shapely.box(30, 30, 40, 40)]), places, points, std_m=1.0, within_m=0.01)
    assert found.status_of("toa") == found.status_of("tdoa") == ["singular", "", "", "building"]
    assert "infinite for toa at 1 (33%)" in found.verdict
    corner = City([shapely.box(0, 0, 10, 10), shapely.box(0, 12, 10, 30)])
    places = [[-5.0, -20.0], [-6.0, -20.0], [20.0, 5.0]]  # two of them around one corner
    found = street_map(corner, places, [[9.0, 40.0]], std_m=1.0, within_m=0.01)
    told = [np.isfinite(found.rmse_m[m][0]) for m in ("toa", "tdoa")]
    assert told == [True, False]
    assert (found.status_of("toa"), found.status_of("tdoa"), found.status) == ([""], ["singular"], [""])
    assert "infinite for tdoa at 1 (100%)" in found.verdict
    assert "infinite for toa" not in found.verdict


@pytest.mark.parametrize("measure", ["toa", "tdoa"])
def test_a_table_of_links_is_as_good_as_the_geometry(measure):
    region, anchors = shapely.box(0, 0, 40, 8), np.array([[-10.0, 4.0], [20.0, 30.0], [60.0, -20.0]])
    city, p = City([shapely.box(0, 10, 40, 20)]), grid(1.0, region)
    links = lb.street_links(city, anchors, p)
    names = dict(zip("abc", anchors, strict=True))
    table = LinkTable.of(p, names, links.sight, links.excess_m, np.full(links.sight.shape, 2.0))
    cells = {c.nearest: c for c in lb.street_cells(region, anchors, count=3)}
    found = lb.table_bounds(table, measure=measure)
    assert sum(b.share for b in found) == pytest.approx(1.0)
    for bounds in found:
        same = cell_bounds(city, anchors, cells[bounds.nearest], std_m=2.0, measure=measure, step_m=1.0)
        assert same is not None
        assert bounds[3:] == pytest.approx(same[3:], rel=1e-9)


def test_tables_with_too_few_links():
    p = grid(1.0, shapely.box(0, 0, 5, 5))
    sight = np.zeros((25, 2), int)
    sight[3, 1] = -1
    table = LinkTable.of(p, {"a": (9.0, 9.0), "b": (-9.0, 9.0)}, sight, np.zeros((25, 2)), np.ones((25, 2)))
    with pytest.raises(lb.InputError, match=r"the point \(0.5, 3.5\) m receives 1 of the 2 anchors"):
        lb.table_bounds(table, count=2)
    assert lb.table_bounds(table, count=1)
    for options in ({"count": 3}, {"count": 1, "measure": "tdoa"}, {"count": 1, "measure": "rss"}):
        with pytest.raises(lb.InputError):
            lb.table_bounds(table, **options)


@pytest.mark.parametrize(
    "call, cause",
    [
        (lambda: street_raster(np.zeros((3, 2)), np.zeros((3, 1)), [[1.0]], step_m=1.0), "3 cells"),
        (
            lambda: street_raster(np.random.default_rng(0).random((20, 2)), np.zeros((20, 1)), [[1.0]], step_m=1.0),
            "no raster",
        ),
        (
            lambda: street_map(City([shapely.box(0, 0, 9, 9)]), [[20, 0]], [[5.0, 5.0]], std_m=1.0, count=1),
            "lies on a street",
        ),
        (lambda: street_map(City([shapely.box(0, 0, 9, 9)]), [[20, 0]], [[15.0, 5.0]], std_m=1.0), "3 nearest of 1"),
        (lambda: street_map(City([shapely.box(0, 0, 9, 9)]), [[20, 0]], [[15.0, 5.0]], std_m=0.0), "deviation of 0.0"),
    ],
)
def test_bad_rasters_and_maps(call, cause):
    with pytest.raises(lb.InputError) as caught:
        call()
    assert cause in str(caught.value)


BLOCKS = [[[[x, y], [x + 30, y], [x + 30, y + 30], [x, y + 30], [x, y]]] for x in (0, 40) for y in (0, 40)]
TEXT = """format = 1
[city]
buildings = "blocks.geojson"
area_m = [-10, -10, 80, 80]
[measure]
kinds = ["toa", "tdoa"]
std_m = 3
[anchors]
a = { position_m = [-5, -5] }
b = { position_m = [75, 75] }
c = { position_m = [35, 35] }
d = { position_m = [15, 15], roof = true }
"""


@pytest.fixture
def files(tmp_path):
    features = [{"type": "Feature", "geometry": {"type": "Polygon", "coordinates": r}} for r in BLOCKS]
    (tmp_path / "blocks.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return tmp_path


def run(folder, text, *options):
    (folder / "city.toml").write_text(text)
    return CliRunner().invoke(app, ["map", str(folder / "city.toml"), "--out", str(folder / "out"), *options])


def test_the_program(files):
    done = run(files, TEXT)
    assert done.exit_code == 0, done.output
    assert "refused at" in done.output
    written = sorted(p.name for p in (files / "out").glob("*.*") if not p.name.startswith("."))
    assert written == ["cells.csv", "excess.png", "map.csv", "sight.png", "tdoa.png", "toa.png"]
    assert (files / "out" / "map.csv").read_text().startswith("x_m,y_m,status_toa,status_tdoa,anchors,")
    header, *rows = (files / "out" / "cells.csv").read_text().splitlines()
    assert header.startswith("anchors,share,measure,wwb_m,ezzb_m,tightest_m,mmse_m")
    cells = [row.split(",") for row in rows]
    assert sum(float(c[1]) for c in cells if c[2] == "toa") == pytest.approx(1.0, abs=1e-6)
    for cell in cells:
        assert float(cell[5]) < float(cell[6]) + 4 * float(cell[7])


@pytest.mark.parametrize(
    "old, new, cause, remedy",
    [
        ("d = { position_m = [15, 15], roof = true }", "d = { position_m = [15, 15] }", "inside building 0", "roof"),
        ("std_m = 3", "std_db = 3", "unknown key measure.std_db", "std_m"),
        (
            '["toa", "tdoa"]',
            '["toa", "aoa"]',
            "measure.kinds.1 is 'aoa', but must be 'toa' or 'tdoa'",
            "times of arrival",
        ),
        ("std_m = 3", "std_m = -3", "measure.std_m", "standard deviation"),
        ('buildings = "blocks.geojson"', "", "neither buildings nor links_csv", "buildings.geojson"),
        ("[measure]", 'links_csv = "links.csv"\n[measure]', "has buildings and links_csv", "one of them"),
        ("std_m = 3", "", "measure.std_m is missing", "deviation"),
        ("blocks.geojson", "absent.geojson", "absent.geojson", "GeoJSON"),
        ("area_m = [-10, -10, 80, 80]", "area_m = [1, 1, 29, 29]", "no street is left", "area"),
        ("area_m = [-10, -10, 80, 80]", "area_m = [9, 9, 2, 2]", "area_m = [9", "four numbers"),
        (
            "std_m = 3",
            "std_m = 3\nnearest = 9",
            "city.toml: measure.nearest is 9, and there are 4 anchors",
            "from 2 to 4",
        ),
        (
            "std_m = 3",
            "std_m = 3\nnearest = 1",
            "measure.nearest is 1, and there are 4 anchors: a difference needs 2",
            "from 2",
        ),
        ("area_m = [-10, -10, 80, 80]", "area_m = [-10, -10, 80, 80]\nmargin_m = 60", "no street is left", "margin"),
    ],
)
def test_bad_city_files(files, old, new, cause, remedy):
    from locbounds.cli.map_city import map_city

    (files / "city.toml").write_text(TEXT.replace(old, new))
    with pytest.raises(lb.InputError) as caught:
        map_city(files / "city.toml", files / "out")
    assert cause in caught.value.cause
    assert remedy in caught.value.remedy


def test_anchors_of_a_city_from_a_table_named_below_a_section(files):
    (files / "anchors.csv").write_text("anchor_id,x_m,y_m,z_m\na,-5,-5,9\nb,40,-5,9\nc,40,40,9\nd,15,15,9\n")
    head = TEXT[: TEXT.index("[anchors]")]
    (files / "table.toml").write_text(head + 'anchors_csv = "anchors.csv"\n[anchors]\nd = { roof = true }\n')
    found = load_city(files / "table.toml")
    assert found.anchors == {"a": (-5, -5), "b": (40, -5), "c": (40, 40), "d": (15, 15)}
    assert found.roof == ("d",)
    for line, words in (
        ("e = { roof = true }", "anchor e has no position"),
        ("e = { position_m = [1, 2, 3] }", "3 numbers"),
    ):
        (files / "table.toml").write_text(head + f"[anchors]\n{line}\n")
        with pytest.raises(lb.InputError, match=words):
            load_city(files / "table.toml")


def test_a_cell_that_no_anchor_reaches_is_left_out():
    ring = shapely.box(0, 0, 40, 40).difference(shapely.box(10, 10, 30, 30))
    city, anchors = City([ring]), np.array([[-5.0, 20.0], [50.0, 20.0]])
    (cell,) = [c for c in lb.street_cells(shapely.box(12, 12, 19, 28), anchors, count=2) if c.nearest[0] == 0]
    assert cell_bounds(city, anchors, cell, std_m=1.0, measure="toa", step_m=1.0) is None


def test_bad_input_ends_with_two_and_leaves_nothing(files):
    done = run(files, TEXT.replace("std_m = 3", "std_m = 3\nnearest = 9"))
    refused(
        done,
        "error: city.toml: measure.nearest is 9, and there are 4 anchors",
        "remedy: Add anchors, or give measure.nearest a number from 2 to 4",
    )
    for option in (("--grid", "50"), ("--grid", "101"), ("--rtol", "0.01")):  # 101 is what is left out, too
        done = run(files, TEXT, *option)
        refused(done, f"error: {option[0]} is for plan files", unwritten=files / "out")


def test_courtyards_out_of_reach(files, capsys):
    from locbounds.cli.map_city import map_city

    yard = [[[0, 0], [30, 0], [30, 30], [0, 30], [0, 0]], [[5, 5], [5, 25], [25, 25], [25, 5], [5, 5]]]
    features = [{"type": "Feature", "geometry": {"type": "Polygon", "coordinates": r}} for r in [yard, *BLOCKS[1:]]]
    (files / "blocks.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    inside = TEXT.replace("d = { position_m = [15, 15], roof = true }", "d = { position_m = [15, 15] }")
    outside = TEXT.replace("d = { position_m = [15, 15], roof = true }", "d = { position_m = [15, -5] }")
    closed = outside.replace("[-10, -10, 80, 80]", "[6, 6, 24, 24]")
    for text, cause in (
        (closed, "no street is left"),
        (inside, "anchor d reaches no street point of the map"),
        (outside.replace("[measure]", "courtyards = true\n[measure]"), "no anchor is in reach of the point"),
    ):
        (files / "city.toml").write_text(text)
        with pytest.raises(lb.InputError, match=cause):
            map_city(files / "city.toml", files / "out")
    (files / "city.toml").write_text(outside)
    map_city(files / "city.toml", files / "out")
    assert "unreached" in (files / "out" / "map.csv").read_text()  # in the yard
    assert "more points that an anchor in use does not reach" in capsys.readouterr().out


def test_the_program_with_a_table_of_links(files):
    rows = ["x_m,y_m,anchor_id,sight,bias_m,deviation_m"]
    for x in range(10):
        for y in range(4):
            rows += [
                f"{x},{y},{a},{'los' if x < 5 else 'nlos'},{0 if x < 5 else 8},{1 if x < 5 else 2}" for a in "abcd"
            ]
    (files / "links.csv").write_text("\n".join(rows) + "\n")
    text = TEXT.replace('buildings = "blocks.geojson"', 'links_csv = "links.csv"').replace("std_m = 3\n", "")
    done = run(files, text)
    assert done.exit_code == 0, done.output
    assert "crlb: refused, a table of links has no derivatives" in done.output
    assert (files / "out" / "cells.csv").read_text().startswith("anchors,share,measure")
    (files / "links.csv").write_text("\n".join(rows[:-1]) + "\n")
    done = run(files, text)
    assert done.exit_code == 2
    assert "links.csv has no link of (9, 3) m to d" in done.output
