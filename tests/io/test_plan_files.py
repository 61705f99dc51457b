"""Plan files: what they say, and what they say when they cannot be used."""

from typing import Any

import numpy as np
import pytest

import locbounds as lb
from hall import HALL, PLACES
from locbounds.io import plans
from locbounds.io.plan_example import PLAN

read_plan: Any = plans.read_plan  # what a file holds is of one kind or another
read_text: Any = plans.read_text
THERE = np.array([[11.0, 7.0], [30.0, 15.0]])


def changed(*pairs, text=HALL):
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


def same(text, plan):
    np.testing.assert_allclose(lb.crlb(read_text(text).plan, THERE).covariance, lb.crlb(plan, THERE).covariance)


def test_the_example_is_a_plan(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN.format(name=path))
    read = read_plan(path)
    assert read.names == ("a1", "a2", "a3", "a4")
    assert read.plan.channel_names == ("a2-a1", "a3-a1", "a4-a1")
    assert read.area is read.plan.prior
    assert float(read.area.area) == 60 * 25 + 35 * 20
    assert lb.read_plan(path).plan.title.startswith("Hall with an annex")


def test_files_say_what_the_short_constructors_say():
    same(HALL, lb.toa(PLACES, 2.0))
    same(changed(('"toa"', '"tdoa"')), lb.tdoa(PLACES, 2.0))
    same(changed(('"toa"', '"tdoa"\nreference = "c"')), lb.tdoa(PLACES, 2.0))
    same(changed(('"toa"', '"rss"\nexponent = 2.5'), ("std_m", "std_db")), lb.rss(PLACES, 2.0, exponent=2.5))
    same(changed(('"toa"', '"aoa"'), ("std_m", "std_deg")), lb.aoa(PLACES, np.radians(2.0)))
    same(changed(("[area]", 'clock = "unknown"\n[area]')), lb.toa(PLACES, 2.0, clock_std_m=np.inf))
    same(changed(("[area]", "clock_std_m = 5\n[area]")), lb.toa(PLACES, 2.0, clock_std_m=5.0))


def test_anchors_may_differ():
    mixed = changed(("[20, 20] }", '[20, 20], measure = "aoa", los = { std_rad = 0.05 } }'))
    same(mixed, lb.toa(PLACES[:2], 2.0) + lb.aoa(PLACES[2:], 0.05))
    own = changed(("[20, 20] }", "[20, 20], los = { std_m = 5 } }"))
    same(own, lb.toa(PLACES, np.array([2.0, 2.0, 5.0])))


def test_sight_known_unknown_and_soft():
    blocked = changed(("[20, 20] }", '[20, 20], sight = "nlos" }'))
    same(blocked, lb.toa(PLACES[:2], 2.0))
    assert read_text(blocked).left_out == ("c",)
    assert "left out: c" in read_text(blocked).notes[0]
    known = changed(("[20, 20] }", '[20, 20], sight = "nlos", nlos = { mean_m = 9, std_m = 6 } }'))
    same(known, lb.toa(PLACES, np.array([2.0, 2.0, 6.0])))
    soft = changed(("[anchors]", "sight = { nlos = 0.3 }\nnlos = { mean_m = 9, std_m = 6 }\n[anchors]"))
    same(soft, lb.toa(PLACES, lb.Mixture([0.7, 0.3], [lb.Gaussian(0, 2), lb.Gaussian(9, 6)])))


def test_anchors_from_a_table(tmp_path):
    (tmp_path / "anchors.csv").write_text("anchor_id,x_m,y_m\na,0,0\nb,40,0\nc,20,20\n")
    text = HALL.partition("[anchors]")[0].replace("[area]", 'anchors_csv = "anchors.csv"\n[area]')
    (tmp_path / "plan.toml").write_text(text)
    read = read_plan(tmp_path / "plan.toml")
    np.testing.assert_array_equal(read.positions, PLACES)


@pytest.mark.parametrize("section", ["area", "links"])
def test_a_table_of_anchors_named_below_a_section(tmp_path, section):
    (tmp_path / "anchors.csv").write_text("anchor_id,x_m,y_m\na,0,0\nb,40,0\nc,20,20\n")
    text = HALL.partition("[anchors]")[0].replace(f"[{section}]", f'[{section}]\nanchors_csv = "anchors.csv"')
    np.testing.assert_array_equal(read_text(text, folder=tmp_path).positions, PLACES)


@pytest.mark.parametrize(
    ("los", "words"),
    [
        ("std_deg = -3", ["links.los.std_deg is -3, but must be positive", "std_deg: standard deviation in degrees"]),
        ("std_rad = -0.1", ["links.los.std_rad is -0.1, but", "std_rad: standard deviation in radians"]),
        ("mean_deg = 4", ["links.los has no std_deg", "Add std_deg: standard deviation in degrees"]),
        ("std_deg = '3'", ["links.los.std_deg is '3', not a number"]),
        ("stddev_deg = 3", ["unknown key links.los.stddev_deg = 3", "Did you mean std_deg?"]),
        ("std_db = 3", ["unknown key links.los.std_db = 3", "Did you mean std_rad or std_deg?", "are in radians"]),
        ("std_deg = 3, std_rad = 0.05", ["links.los has std_deg and std_rad", "Keep one"]),
        ("weights = [0.5, 0.5], means_deg = [0, 5], stds_deg = [1, -2]", ["links.los.stds_deg is -2"]),
        (
            "mixture = [{ share = 0.9, std_rad = 0.1 }, { share = 0.1, std_deg = 0 }]",
            ["links.los.mixture.1.std_deg is 0, but", "in degrees"],
        ),
    ],
)
def test_errors_about_angles_speak_of_what_is_written(los, words):
    with pytest.raises(lb.InputError) as error:
        read_text(changed(('"toa"', '"aoa"'), ("std_m = 2", los)), source="hall.toml")
    for word in ("hall.toml: ", *words):
        assert word in str(error.value)
    assert "_m" not in str(error.value)


def test_degrees_in_every_kind_of_table():
    narrow = changed(('"toa"', '"aoa"'), ("std_m", "std_deg"))
    own = changed(("[20, 20] }", "[20, 20], los = { std_deg = 5 } }"), text=narrow)
    same(own, lb.aoa(PLACES, np.radians([2.0, 2.0, 5.0])))
    parts = "mixture = [{ share = 0.9, std_rad = 0.1 }, { share = 0.1, mean_deg = 9, std_deg = 18 }]"
    rare = "outlier = { share = 0.1, std_deg = 20 }\n[anchors]"
    w = np.linspace(-1, 1, 7)
    for text, law in (
        (changed(("std_deg = 2", parts), text=narrow), ((0.9, 0.1), (0.0, 9.0), (np.degrees(0.1), 18.0))),
        (changed(("[anchors]", rare), text=narrow), ((0.9, 0.1), (0.0, 0.0), (2.0, 20.0))),
    ):
        shares, means, deviations = law
        expected = lb.GaussianMixture(shares, np.radians(means), np.radians(deviations)).log_prob(w)
        np.testing.assert_allclose(read_text(text).plan.groups[0].noises[0].log_prob(w), expected, rtol=1e-6)


def test_areas_and_priors():
    box = read_text(HALL)
    assert box.plan.prior is box.area
    disc = read_text(changed(("low_m = [0, 0]\nhigh_m = [40, 20]", "center_m = [1, 2]\nradius_m = 3")))
    assert disc.area.radius == 3
    gauss = read_text(HALL + "[prior]\nposition_m = [10, 10]\nposition_std_m = [3, 4]\n")
    np.testing.assert_array_equal(gauss.plan.prior.covariance, np.diag([9.0, 16.0]))
    two = """[prior]
mixture = [{ share = 0.25, center_m = [9, 9], radius_m = 2 }, { share = 0.75, low_m = [0, 0], high_m = [4, 4] }]
"""
    np.testing.assert_allclose(read_text(HALL + two).plan.prior.mean, [3.75, 3.75])
    hole = "outline_m = [[0, 0], [40, 0], [40, 20], [0, 20]]\nholes_m = [[[10, 5], [20, 5], [20, 10], [10, 10]]]"
    yard = read_text(changed(("low_m = [0, 0]\nhigh_m = [40, 20]", hole)))
    assert float(yard.area.area) == 750.0
    closed = hole.replace("[0, 20]]", "[0, 20], [0, 0]]", 1)  # the first corner repeated
    assert float(read_text(changed(("low_m = [0, 0]\nhigh_m = [40, 20]", closed))).area.area) == 750.0


def test_three_dimensions():
    high = changed(("[0, 0] }", "[0, 0, 4] }"), ("[40, 0] }", "[40, 0, 6] }"), ("[20, 20] }", "[20, 20, 3] }"))
    at = read_text(changed(("high_m = [40, 20]", "high_m = [40, 20]\nheight_m = 1.5"), text=high))
    assert (at.height_m, at.heights_m, at.plan.prior) == (1.5, None, None)
    span = read_text(changed(("high_m = [40, 20]", "high_m = [40, 20]\nheight_m = [0, 3]"), text=high))
    assert (span.height_m, span.heights_m) == (1.5, (0.0, 3.0))
    assert span.plan.prior.dim == 3
    with pytest.raises(lb.InputError, match="the area has none"):
        read_text(high)


BOX = "low_m = [0, 0]\nhigh_m = [40, 20]"


@pytest.mark.parametrize(
    ("pairs", "what"),
    [
        ([("b = { position_m = [40, 0] }\nc = { position_m = [20, 20] }\n", "")], "cannot determine 2 coordinates"),
        (
            [("[area]", 'clock = "unknown"\n[area]'), ("c = { position_m = [20, 20] }\n", "")],
            "cannot determine 2 coordinates and a clock",
        ),
        ([('"toa"', '"tdoa"'), ("c = { position_m = [20, 20] }\n", "")], "cannot determine 2 coordinates"),
    ],
)  # fmt: skip
def test_too_few_measurements_are_noted_where_there_is_a_prior(pairs, what):
    notes = read_text(changed(*pairs)).notes
    assert any("no Cramér-Rao bound" in note and what in note for note in notes)


@pytest.mark.parametrize(
    ("pairs", "words"),
    [
        ([(BOX, "")], ["area is empty", "outline_m", "radius_m"]),
        ([(f"[area]\n{BOX}", "")], ["area", "is missing"]),
        ([(BOX, "outline_m = []")], ["area", "at least three"]),
        ([(BOX, "outline_m = [[0, 0], [5, 0]]")], ["area", "2 different corners", "at least three"]),
        ([(BOX, "outline_m = [[0, 0], [4, 4], [4, 0], [0, 4]]")], ["crosses itself", "order along the edge"]),
        ([(BOX, "outline_m = [[0, 0], [4, 4], [8, 8]]")], ["corners of outline_m lie on one line", "enclose"]),
        ([("[area]", 'clock = "known"\nclock_std_m = 3\n[area]')], ["toml: the file has both clock and clock_std_m"]),
        ([(BOX, "center_m = [0, 0]\nradius_m = -2")], ["area.radius_m", "-2"]),
        ([(BOX, "low_m = [0, 0]\nhigh_m = [0, 20]")], ["area"]),
        ([(BOX, "center_m = [0, 0]\nhigh_m = [0, 20]")], ["area has center_m, high_m"]),
        ([(BOX, BOX + "\nholes_m = [[[1, 1], [2, 1], [2, 2]]]")], ["holes_m", "outline_m"]),
        ([("std_m", "std_db")], ["unknown key links.los.std_db", "Did you mean std_m", "metres"]),
        ([("std_m = 2", "std_m = -2")], ["links.los.std_m", "-2"]),
        ([("[20, 20] }", '[20, 20], measure = "aoa" }')], ["anchors.c", "std_rad", "noise of its own"]),
        ([("measure", "mesure")], ["links.mesure", "Did you mean measure"]),
        ([('"toa"', '"time"')], ["links.measure", "time"]),
        ([('measure = "toa"', "")], ["no measure"]),
        ([("los = { std_m = 2 }", "")], ["no los"]),
        (
            [("= [0, 0] }", "= [0, 0, 4] }"), ("b = { position_m = [40, 0] }\nc = { position_m = [20, 20] }\n", ""),
             ("high_m = [40, 20]", "high_m = [40, 20]\nheight_m = 1.5")],
            ["cannot determine 3 coordinates", "Add anchors"],
        ),
        ([('"toa"', '"tdoa"\nreference = "d"')], ["links.reference", "d", "Known: a, b, c"]),
        ([('"toa"', '"tdoa"'), ("[area]", 'clock = "unknown"\n[area]')], ["unknown clock", "Remove clock"]),
        ([("[20, 20] }", "[20, 20, 3] }")], ["2 and 3 coordinates"]),
        ([("[20, 20] }", "[20, nan] }")], ["anchors.c.position_m"]),
        ([("[20, 20] }", '[20, 20], sight = { nlos = 1.5 } }')], ["sight", "probability"]),
        ([("[anchors]", 'sight = "nlos"\n[anchors]')], ["every link is NLOS"]),
        ([("format = 1", "format = 7")], ["format"]),
        ([("[area]", "[area")], ["not valid TOML"]),
    ],
)  # fmt: skip
def test_errors_name_key_value_and_remedy(pairs, words):
    with pytest.raises(lb.InputError) as error:
        read_text(changed(*pairs), source="hall.toml")
    for word in words:
        assert word in str(error.value)
    assert error.value.cause.startswith("hall.toml")
    assert error.value.remedy


@pytest.mark.parametrize(
    ("prior", "words"),
    [
        (
            "mixture = [{ share = 0.5, center_m = [0, 0], radius_m = 2 }]",
            ["prior: mixture weights are [0.5]", "sum to one"],
        ),
        ("position_m = [0, 0]\nposition_std_m = inf", ["position_std_m"]),
        ("position_m = [0, 0]\nposition_std_m = 0", ["position_std_m"]),
        ("position_m = [0, 0]\nposition_std_m = [[1, 2], [2, 1]]", ["prior"]),
        ("position_m = [0, 0]", ["only one of"]),
        ("position_m = [0, 0, 0]\nposition_std_m = 2", ["3 coordinates"]),
        ("radius_m = inf\ncenter_m = [0, 0]", ["radius_m"]),
        ("outline_m = [[0, 0], [4, 4], [4, 0], [0, 4]]", ["crosses itself"]),
        ("", ["prior is empty"]),
    ],
)
def test_priors_that_do_not_integrate_or_do_not_fit(prior, words):
    with pytest.raises(lb.InputError) as error:
        read_text(HALL + "[prior]\n" + prior)
    for word in words:
        assert word in str(error.value)
    assert error.value.remedy


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(lb.InputError, match="cannot read") as error:
        read_plan(tmp_path / "none.toml")
    assert "--like plan" in error.value.remedy
    (tmp_path / "latin.toml").write_bytes(b'title = "B\xfcro"')
    with pytest.raises(lb.InputError, match="UTF-8"):
        read_plan(tmp_path / "latin.toml")
