"""Surveys from wide and long files, and what is wrong with them."""

import numpy as np
import pytest

import locbounds as lb
from datasets import need
from locbounds.io.surveys import SurveyColumns

WIDE = "point_id,x_m,y_m,ap1,ap2\na,0,0,-40,-70\na,0,0,-42,\nb,3,0,-52,-61\n"
LONG = (
    "point_id,sample,anchor_id,rssi_dbm,range_m\n"
    "a,0,1,-40,1.5\na,0,2,-70,\na,1,1,-42,1.6\nb,0,1,-52,2.5\nb,0,2,-61,2.0\n"
)
POINTS = "point_id,x_m,y_m,split\na,0,0,train\nb,3,0,test\nc,9,9,test\n"


@pytest.fixture
def file(tmp_path):
    def write(text, name="s.csv"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def test_wide_and_long_say_the_same(file):
    wide = lb.read_survey(file(WIDE)).survey
    long = lb.read_survey(file(LONG), points=file(POINTS, "p.csv"))
    assert wide.names == ("ap1", "ap2")
    assert long.survey.names == ("1", "2")
    np.testing.assert_array_equal(wide.value, long.survey.value)
    np.testing.assert_array_equal(wide.value, [[-40, -70], [-42, np.nan], [-52, -61]])
    np.testing.assert_array_equal(wide.position_m, long.survey.position_m)
    assert wide.point.tolist() == long.survey.point.tolist() == [0, 0, 1]
    assert long.labels["split"] == ("train", "train", "test")
    assert "1 points of p.csv have no samples." in long.survey.notes


def test_ranges_and_both(file):
    both = lb.read_survey(file(LONG), points=file(POINTS, "p.csv"), values="both").survey
    assert both.names == ("1", "2", "range 1", "range 2")
    assert both.units == ("dB", "dB", "m", "m")
    np.testing.assert_array_equal(both.value[:, 2:], [[1.5, np.nan], [1.6, np.nan], [2.5, 2.0]])


def test_own_column_names_and_patterns(file):
    text = "east;north;ssid_a;ssid_b;n1;n2;n3\n0;0;-40;-50;1;2;3\n1;0;-41;-52;1;2;3\n"
    columns = SurveyColumns.parse(["x=east", "y=north"])
    assert lb.read_survey(file(text), columns=columns, access_points="ssid_*").survey.names == ("ssid_a", "ssid_b")
    with pytest.raises(lb.InputError, match="no column of s"):
        lb.read_survey(file(text), columns=columns, access_points="zzz*")


def test_units(file):
    milli = lb.read_survey(file("x_m,y_m,ap1,ap2\n0,0,1e-4,1e-7\n3,0,1e-5,\n"), milliwatts=True).survey
    np.testing.assert_allclose(milli.value, [[-40, -70], [-50, np.nan]])
    coded = lb.read_survey(file("x_m,y_m,ap1,ap2\n0,0,-40,100\n3,0,-50,-60\n"), not_heard=100).survey
    assert np.isnan(coded.value[0, 1])
    suspicious = lb.read_survey(file("x_m,y_m,ap1,ap2\n0,0,-40,-110\n3,0,-50,-60\n")).survey
    assert "code for not heard" in suspicious.notes[0]


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        (WIDE.replace("-52", "loud"), {}, ["line 4", "ap1", '"loud"']),
        (WIDE.replace("b,3,0", "b,,0"), {}, ["line 4", "x_m", "empty"]),
        (WIDE.replace("x_m", "lon"), {}, ["degrees"]),
        (WIDE.replace("x_m", "xx"), {}, ["no column x_m", "--column fingerprints.x"]),
        (WIDE.replace("b,3,0", "a,3,0"), {}, ["point a is at two positions", "lines 2 and 4", "--merge"]),
        (WIDE.replace("-70", "100"), {}, ["RSS of 100", "--not-heard 100"]),
        (WIDE.replace("-70", "-200"), {}, ["RSS of -200", "--not-heard -200"]),
        ("x_m,y_m,ap1\n0,0,1e-4\n1,0,1e-5\n", {}, ["look like mW", "--mw"]),
        (WIDE, {"milliwatts": True}, ["dBm already"]),
        (WIDE, {"values": "range"}, ["wide file", "RSS only"]),
        (WIDE, {"values": "power"}, ['"power"', "rss, range, both"]),
        ("x_m,y_m,loud\n0,0,-40\n1,0,-50\n", {}, ["look like access points", "--access-points"]),
        (WIDE, {"select": "floor=2"}, ["no file has a column floor"]),
        (LONG, {}, ["no column x_m"]),
        (LONG.replace("a,0,2,-70,", "a,0,1,-70,"), {"points": POINTS}, ["line 3", "second value of access point 1"]),
        (LONG.replace("b,0,2", "z,0,2"), {"points": POINTS}, ["line 6", "point z", "no position"]),
        (LONG, {"points": POINTS.replace("c,", "a,")}, ["point a", "more than once"]),
        ("", {}, ["no rows"]),
    ],
)
def test_bad_files_are_refused_with_cause_and_remedy(file, text, options, words):
    if "points" in options:
        options = options | {"points": file(options["points"], "p.csv")}
    with pytest.raises(lb.InputError) as error:
        lb.read_survey(file(text), **options)
    assert error.value.remedy
    for word in words:
        assert word in str(error.value)


def test_ids_at_one_position_are_one_point(file):
    survey = lb.read_survey(file(WIDE.replace("b,3,0", "b,0,0") + "c,9,0,-50,-50\n")).survey
    assert survey.points == 2
    assert "1 points have the position of another one" in " ".join(survey.notes)


def test_the_large_set_is_read_whole():
    path = need("wifine_train")
    read = lb.read_survey(path / "fingerprints.csv.gz")
    assert (read.survey.points, read.survey.value.shape) == (19_448, (19_448, 436))
    assert len(set(read.survey.group)) == 120
    assert read.survey.heard.sum(axis=1).mean() == pytest.approx(50.0, abs=0.05)  # the data set's README
