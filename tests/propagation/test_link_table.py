"""A ray tracer's table: round trip through a file, and holes that are named."""

import numpy as np
import pytest
import shapely

import locbounds as lb
from locbounds.io.link_table import COLUMNS, read_links
from locbounds.propagation import City, LinkTable, street_links

ANCHORS = {"a": (0.0, 0.0), "b": (100.0, 0.0)}
ROWS = [
    (3, 4, "a", "nlos", 2, 0.5),
    (3, 4, "b", "los", 0, 0.25),
    (5, 4, "a", "los", 0, 0.5),
    (5, 4, "b", "none", "", ""),
]


def write(tmp_path, rows, header=COLUMNS):
    path = tmp_path / "links.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in (header, *rows)) + "\n")
    return path


def test_the_file(tmp_path):
    table = read_links(write(tmp_path, ROWS), ANCHORS)
    assert table.points.tolist() == [[3, 4], [5, 4]]
    assert table.sight.tolist() == [[1, 0], [0, -1]]
    assert table.links.length_m[0].tolist() == [7.0, pytest.approx(np.hypot(97, 4))]
    assert np.isinf(table.links.length_m[1, 1])
    assert table.deviation_m[0].tolist() == [0.5, 0.25]
    assert table.step_m == 2.0


def test_what_the_geometry_writes_is_read_as_the_geometry(tmp_path):
    city = City([shapely.box(20, -10, 60, 10)])
    points = np.stack(np.meshgrid(np.arange(-20.0, 90.0, 10.0), [-20.0, -10.0, 15.0]), -1).reshape(-1, 2)
    links = street_links(city, ANCHORS, points)
    rows = [
        (*points[i], name, ("los", "nlos")[links.sight[i, m]], repr(float(links.excess_m[i, m])), 1.0)
        for i in range(len(points))
        for m, name in enumerate(ANCHORS)
    ]
    table = read_links(write(tmp_path, rows), ANCHORS)
    order = np.lexsort(points.T[::-1])
    np.testing.assert_array_equal(table.points, points[order])
    np.testing.assert_array_equal(table.sight, links.sight[order])
    np.testing.assert_allclose(table.links.length_m, links.length_m[order], rtol=1e-12)


@pytest.mark.parametrize(
    "rows, header, cause, remedy",
    [
        (ROWS[:3], COLUMNS, "no link of (5, 4) m to b", "for every point and anchor"),
        ([*ROWS, ROWS[0]], COLUMNS, "line 6 of links.csv gives the link of (3, 4) m to a a second time", "Keep one"),
        ([(3, 4, "a", "nlos", "", 0.5), *ROWS[1:]], COLUMNS, "line 2 of links.csv has no bias_m", "sight = none"),
        ([(3, 4, "a", "nlos", 1, 0), *ROWS[1:]], COLUMNS, "no positive deviation_m", "in metres"),
        ([(3, 4, "a", "maybe", 1, 1), *ROWS[1:]], COLUMNS, 'the sight "maybe"', "los, nlos or none"),
        ([(3, 4, "c", "los", 1, 1), *ROWS], COLUMNS, "anchor c, whose position is not given", "Add it"),
        (ROWS[::2], COLUMNS, "no link to anchor b", "leave the anchor out"),
        ([("x", 4, "a", "los", 1, 1), *ROWS], COLUMNS, 'column x_m, is "x"', "Correct it"),
        (ROWS, ("x_m", "y_m", "anchor_id", "sight", "bias_m", "std_m"), "no column deviation_m", "Rename"),
        (ROWS, ("lon", "lat", *COLUMNS[2:]), "degrees", "Project"),
    ],
)
def test_tables_are_refused(tmp_path, rows, header, cause, remedy):
    with pytest.raises(lb.InputError) as caught:
        read_links(write(tmp_path, rows, header), ANCHORS)
    assert cause in caught.value.cause
    assert remedy in caught.value.remedy


def test_points_off_a_raster():
    points = [[0.0, 0.0], [1.0, 0.0], [2.5, 0.0]]
    table = LinkTable.of(points, {"a": (9.0, 9.0)}, np.zeros((3, 1), int), np.zeros((3, 1)), np.ones((3, 1)))
    with pytest.raises(lb.InputError, match="on no raster"):
        _ = table.step_m
