"""Reading range logs: what is read, how times are joined, and every kind of bad input named by line and column."""

import gzip

import numpy as np
import pytest

from locbounds.errors import InputError
from locbounds.io.log_columns import LogColumns
from locbounds.io.logs import read_log

ANCHORS = "anchor_id,x_m,y_m\n1,0,0\n2,10,0\n"
RANGES = "track_id,step,anchor_id,range_m\na,0,1,1.0\na,1,1,2.0\na,1,2,8.0\na,2,2,7.5\nb,0,2,3.0\nb,1,1,4.0\n"
TRUTH = "track_id,step,time_s,x_true_m,y_true_m\na,0,10.0,1,0\na,1,10.5,2,0\na,2,11.5,3,0\nb,0,0.0,5,5\nb,1,0.2,5,6\n"


@pytest.fixture
def read(tmp_path):
    def go(ranges=RANGES, anchors=ANCHORS, truth=TRUTH, **options):
        paths = {}
        for name, text in (("ranges", ranges), ("anchors", anchors), ("truth", truth)):
            if text is not None:
                paths[name] = tmp_path / f"{name}.csv"
                paths[name].write_text(text)
        return read_log(paths["ranges"], anchors=paths["anchors"], truth=paths.get("truth"), **options)

    return go


def test_joins_on_track_and_step(read):
    log = read()
    a, b = log.tracks
    assert (log.anchor_names, log.dim, log.ranges, log.notes) == (("1", "2"), 2, 4, ())
    assert (a.name, a.time_s.tolist(), b.steps) == ("a", [10.0, 10.5, 11.5], 1)
    np.testing.assert_array_equal(a.ranges_m, [[2.0, 8.0], [np.nan, 7.5]])  # those of step 0 are not used
    assert a.position_m.tolist() == [[1, 0], [2, 0], [3, 0]]
    assert not a.ranges_m.flags.writeable
    errors = log.errors()
    assert errors.error_m[:2, 0].tolist() == [0.0, 0.0]  # at (2, 0): 2 m to anchor 1, 8 m to anchor 2
    assert (errors.track.tolist(), errors.link.tolist()) == ([0, 0, 1, 1], [0, 1, 0, 1])


def test_ranges_with_times_meet_the_truth_between_its_rows(read):
    ranges = "track_id,time_s,anchor_id,range_m\na,1.0,1,1\na,2.0,1,2\na,2.0,2,3\na,9.0,1,4\n"
    truth = "track_id,time_s,x_true_m,y_true_m\na,0,0,0\na,4,4,8\n"
    track = read(ranges, truth=truth).tracks[0]
    assert (track.time_s.tolist(), track.position_m.tolist()) == ([1.0, 2.0], [[1, 2], [2, 4]])
    log = read(ranges, truth=truth, time_offset_s=0.5)
    assert log.tracks[0].position_m.tolist() == [[1.5, 3], [2.5, 5]]
    assert log.notes == ("Track a: 1 of 4 ranges are left out, before or after its true positions.",)


def test_one_track_needs_no_name_and_truth_is_optional_with_times(read):
    ranges = "time_s,anchor_id,range_m\n1.0,1,1\n2.0,1,2\n"
    log = read(ranges, truth=None)
    assert not log.has_truth
    assert log.notes == ("Anchors without any range are left out: 2.",)
    with pytest.raises(InputError, match="no true positions"):
        log.errors()


def test_select_columns_labels_heights_and_separators(read):
    anchors = "scene;anchor_id;x_m;y_m;z_m\nhall;1;0;0;3\nyard;1;5;5;5\n"
    ranges = "\ufefftrack;step;anchor_id;dist;sight\nt;0;1.0;3;LOS\nt;1;1.0;4;nlos\nt;2;1.0;4;\nu;0;1;9;los\n"
    truth = "scene;track_id;step;time_s;x_true_m;y_true_m;z_true_m\nhall;t;0;0;0;0;1\nhall;t;1;1;0;0;1\n"
    truth += "hall;t;2;2;0;0;1\n"
    truth += "yard;u;0;0;0;0;0\nyard;u;1;1;0;0;0\n"
    columns = LogColumns.parse(["ranges.track=track", "ranges.range=dist"])
    log = read(ranges, anchors, truth, columns=columns, select="scene=hall", labels="sight")
    assert [t.name for t in log.tracks] == ["t"]
    assert log.anchors_m.tolist() == [[0, 0, 3]]
    assert log.tracks[0].sight.tolist() == [[1], [-1]]
    assert log.errors().error_m.tolist() == [[2.0, 2.0]]
    assert read(ranges, anchors, truth, columns=columns, select={"scene": "hall"}, dim=2).dim == 2


def test_compressed_files(tmp_path):
    for name, text in (("r", RANGES), ("a", ANCHORS), ("t", TRUTH)):
        with gzip.open(tmp_path / f"{name}.csv.gz", "wt") as file:
            file.write(text)
    assert read_log(tmp_path / "r.csv.gz", anchors=tmp_path / "a.csv.gz", truth=tmp_path / "t.csv.gz").ranges == 4


def test_positions_that_look_like_degrees_are_remarked(read):
    anchors = "anchor_id,x_m,y_m\n1,11.574331,48.137154\n2,11.574912,48.137001\n"
    assert any("degrees" in note for note in read(anchors=anchors).notes)


BAD = {
    "text in a cell": ({"ranges": RANGES.replace("7.5", "far")}, 'line 5 of ranges.csv, column range_m, is "far"'),
    "nan": ({"ranges": RANGES.replace("8.0", "nan")}, 'line 4 of ranges.csv, column range_m, is "nan"'),
    "infinite": ({"truth": TRUTH.replace("11.5", "inf")}, 'line 4 of truth.csv, column time_s, is "inf"'),
    "empty cell": ({"anchors": ANCHORS.replace("10,0", ",0")}, "line 3 of anchors.csv, column x_m, is empty"),
    "blank lines count": ({"ranges": RANGES.replace("a,1,1", "\na,1,1").replace("7.5", "x")}, "line 6 of ranges.csv"),
    "no name": ({"ranges": RANGES.replace("a,2,2", "a,2,")}, "line 5 of ranges.csv has no anchor_id"),
    "time goes back": ({"truth": TRUTH.replace("11.5", "10.1")}, "line 4 .* goes back in time"),
    "time twice": ({"truth": TRUTH.replace("11.5", "10.5")}, "line 4 .* repeats the time before"),
    "step twice": ({"truth": TRUTH.replace("a,2,", "a,1,")}, "repeats a step"),
    "range twice": ({"ranges": RANGES + "b,1,1,4.1\n"}, "line 8 .* second range to anchor 1"),
    "unknown anchor": ({"ranges": RANGES.replace("a,2,2", "a,2,7")}, "line 5 .* anchor 7, which is not in anchors.csv"),
    "anchor twice": ({"anchors": ANCHORS + "1,5,5\n"}, "anchor 1 is in anchors.csv more than once"),
    "one range": ({"ranges": "track_id,step,anchor_id,range_m\na,1,1,1\n"}, "the log has one range"),
    "misspelt column": ({"ranges": RANGES.replace("range_m", "rnge_m")}, "column range_m; the nearest name is rnge_m"),
    "wrong unit": ({"ranges": RANGES.replace("range_m", "range_cm")}, "the nearest name is range_cm"),
    "two columns of one name": ({"anchors": ANCHORS.replace("y_m", "x_m")}, "two columns x_m"),
    "empty file": ({"ranges": ""}, "ranges file ranges.csv has no rows"),
    "header only": ({"truth": TRUTH[: TRUTH.index("\n") + 1]}, "truth file truth.csv has no rows"),
    "ragged": ({"ranges": RANGES + "b,1,2,3,4,5,6\n"}, "cannot be read"),
    "degrees in anchors": ({"anchors": "anchor_id,lat,lon\n1,48.1,11.5\n"}, r"degrees \(column lat\)"),
    "degrees mapped": (
        {"truth": TRUTH.replace("x_true_m", "longitude"), "columns": LogColumns.parse(["truth.x=longitude"])},
        "in degrees",
    ),
    "heights in one file": ({"anchors": "anchor_id,x_m,y_m,z_m\n1,0,0,2\n2,1,1,2\n"}, "anchors file has heights"),
    "no truth, no times": ({"truth": None}, "no times, and there is no truth"),
    "offset without times": ({"time_offset_s": 1.0}, "no times"),
    "label": ({"ranges": RANGES.replace("range_m", "range_m,l").replace("7.5", "7.5,maybe"), "labels": "l"}, '"maybe"'),
    "no label column": ({"labels": "sight"}, "no column sight"),
    "select nothing": ({"select": "track_id=z"}, "no row with track_id = z"),
    "select unknown": ({"select": "scne=hall"}, "no file has a column scne"),
    "select syntax": ({"select": "hall"}, "not COLUMN=VALUE"),
    "no common track": ({"ranges": RANGES.replace("a,", "x,").replace("b,", "y,")}, "no range has a true position"),
    "no common time": (
        {"ranges": "track_id,time_s,anchor_id,range_m\na,90,1,1\na,91,1,2\n"},
        "no range has a true position",
    ),
    "ranges back in time": (
        {"ranges": "track_id,time_s,anchor_id,range_m\na,10.2,1,1\na,10.1,1,2\n"},
        "line 3 of ranges.csv goes back in time",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_named_with_a_remedy(read, name):
    options, message = BAD[name]
    with pytest.raises(InputError, match=message) as caught:
        read(**options)
    assert caught.value.remedy


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_log(tmp_path / "none.csv", anchors=tmp_path / "none.csv")


def test_not_a_text_file(tmp_path):
    path = tmp_path / "r.csv.gz"
    path.write_bytes(b"no gzip at all")
    with pytest.raises(InputError, match="cannot be read"):
        read_log(path, anchors=path)


@pytest.mark.parametrize("option", ["range=dist", "ranges.rnge=d", "ranges.range", "x.y=z"])
def test_bad_column_mapping(option):
    with pytest.raises(InputError, match="column mapping"):
        LogColumns.parse([option])


def test_degrees_beside_metres_are_refused(read):
    """Anchors some hundred metres apart are thousandths of a degree apart."""
    ranges = "time_s,anchor_id,range_m\n1.0,1,60\n2.0,1,70\n2.0,2,110\n"
    anchors = "anchor_id,x_m,y_m\n1,48.137154,11.576124\n2,48.138154,11.577124\n"
    with pytest.raises(InputError, match="degrees"):
        read(ranges, anchors=anchors, truth=None)


@pytest.mark.parametrize(
    ("factor", "unit"),
    [(1e3, "millimetres"), (1e2, "centimetres"), (1e-3, "kilometres"), (-1, "negative metres"),
     (1 / 0.3048, "feet or nanoseconds"), (1 / 0.299792458, "feet or nanoseconds")],
)  # fmt: skip
def test_ranges_of_one_anchor_in_another_unit_are_refused(read, factor, unit):
    """Anchor 2 alone: the ranges of anchor 1 are right."""
    truth = "step,time_s,x_true_m,y_true_m\n" + "".join(f"{k},{k},{k},20\n" for k in range(9))
    rows = [(k, m, np.hypot(k - 10 * (m - 1), 20) + 0.2) for k in range(1, 9) for m in (1, 2)]
    ranges = "step,anchor_id,range_m\n" + "".join(f"{k},{m},{z * (factor if m == 2 else 1)}\n" for k, m, z in rows)
    with pytest.raises(InputError, match=f"anchor 2 look like {unit}"):
        read(ranges, truth=truth)
    good = "step,anchor_id,range_m\n" + "".join(f"{k},{m},{z}\n" for k, m, z in rows)
    assert read(good, truth=truth).notes == ()


def test_single_odd_ranges_are_kept_and_remarked(read):
    log = read(RANGES.replace("a,1,1,2.0", "a,1,1,-0.3").replace("a,2,2,7.5", "a,2,2,7500"))
    assert "1 of 4 ranges are negative, down to -0.3 m" in log.notes[0]
    assert "1 ranges are longer than 1e+03 m" in log.notes[1]
    timed = "time_s,anchor_id,range_m\n1.0,1,-1\n2.0,1,-2\n"
    with pytest.raises(InputError, match="most ranges are negative"):
        read(timed, truth=None)
