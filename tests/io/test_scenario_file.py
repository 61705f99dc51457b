"""Scenario files: reading what the user writes, and writing what reads back exactly."""

from typing import Any

import equinox as eqx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from locbounds.errors import InputError
from locbounds.io.scenario_file import dumps, load, loads, save
from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import Gaussian, GaussianMixture
from locbounds.priors import GaussianPrior
from locbounds.scenario import Link, Scenario
from locbounds.sight import DwellSight, KnownSight, MarkovSight
from locbounds.times import Times

EXAMPLE = """
format = 1
title = "Three base stations"
[time]
step_s = 0.2
steps = 10
[motion]
model = "constant-velocity"
psd_m2_s3 = 0.5
[prior]
position_m = [500, 500]
position_std_m = 50
velocity_m_s = [5, 5]
velocity_std_m_s = 2
[links]
measure = "range"
sight = { stay = 0.9, start = { los = 0.5, nlos = 0.5 } }
los = { std_m = 150 }
nlos = { plus_los = true, mean_m = 513, std_m = 409 }
[anchors]
bs1 = { position_m = [-3000, -2000] }
bs2 = { position_m = [3000, 5000] }
bs3 = { position_m = [6000, 2000], los = { std_m = 100, mean_m = 3 } }
"""


def understood(text: str, **options) -> Any:
    """The scenario of a text; what kind its noises and chains are is what the tests look at."""
    return loads(text, **options)


def test_example_means_what_it_says():
    scenario = understood(EXAMPLE)
    assert (scenario.title, scenario.steps, scenario.dim) == ("Three base stations", 10, 2)
    np.testing.assert_allclose(scenario.times.time_s, 0.2 * np.arange(11))
    assert scenario.motion.intensity.tolist() == [0.5, 0.5]
    assert not scenario.motion.discrete
    np.testing.assert_array_equal(scenario.prior.mean, [500, 500, 5, 5])
    np.testing.assert_array_equal(scenario.prior.covariance, np.diag([2500, 2500, 4, 4]))
    np.testing.assert_array_equal(scenario.anchors, [[-3000, -2000], [3000, 5000], [6000, 2000]])
    np.testing.assert_allclose(scenario.links[0].sight.transition, [[0.9, 0.1], [0.1, 0.9]])
    los, nlos = scenario.links[1].noises
    assert (los.mean, los.std, nlos.mean) == (0, 150, 513)
    np.testing.assert_allclose(nlos.std, np.hypot(150, 409))
    los, nlos = scenario.links[2].noises  # its own LOS noise, and the shared excess on top of it
    assert (los.mean, los.std, nlos.mean) == (3, 100, 516)
    np.testing.assert_allclose(nlos.std, np.hypot(100, 409))


def with_sight(table: str):
    return understood(EXAMPLE.replace("{ stay = 0.9, start = { los = 0.5, nlos = 0.5 } }", table))


def test_sight_conventions():
    """Asymmetric chains: rows are the sight now, columns the next one; LOS comes first."""
    expected = [[0.9, 0.1], [0.3, 0.7]]
    for table in ("{ stay = { los = 0.9, nlos = 0.7 } }", "{ transition = [[0.9, 0.1], [0.3, 0.7]] }"):
        sight = with_sight(table).links[0].sight
        np.testing.assert_allclose(sight.transition, expected)
        np.testing.assert_allclose(sight.start, [0.75, 0.25])  # start left out: the long-run shares
    dwell = with_sight("{ dwell_s = { los = 3, nlos = 1 }, start = { los = 0.2, nlos = 0.8 } }").links[0].sight
    assert (dwell.dwell_s.tolist(), dwell.start.tolist()) == ([3, 1], [0.2, 0.8])


def test_known_sight_in_letters_and_periods():
    letters = with_sight('{ known = "LLLLNNNLLL" }').links[0].sight
    periods = with_sight(
        '{ known = [{ until_s = 0.81, sight = "los" }, { until_s = 1.41, sight = "nlos" }, { sight = "los" }] }'
    )
    assert letters.modes.tolist() == [0, 0, 0, 0, 1, 1, 1, 0, 0, 0]
    assert eqx.tree_equal(letters, periods.links[0].sight)


def test_outliers_widen_both_conditions():
    text = EXAMPLE.replace("[anchors]", "outlier = { share = 0.02, mean_m = 10, std_m = 2000 }\n[anchors]")
    text = text.replace("bs1 = {", "bs1 = { outlier = { share = 0, std_m = 1 }, ")
    scenario = understood(text)
    assert isinstance(scenario.links[0].noises[0], Gaussian)
    for noise, mean in zip(scenario.links[1].noises, (0, 513), strict=True):
        np.testing.assert_allclose(noise.weights, [0.98, 0.02])
        assert (noise.means.tolist(), noise.stds[1]) == ([mean, 10], 2000)


def test_excess_on_top_of_a_mixture_is_the_sum_of_independent_errors():
    los = "los = { weights = [0.9, 0.1], means_m = [0, 5], stds_m = [3, 4] }"
    nlos = understood(EXAMPLE.replace("los = { std_m = 150 }", los)).links[0].noises[1]
    np.testing.assert_allclose(nlos.mean, 0.5 + 513)
    los_variance = 0.9 * 9 + 0.1 * (16 + 25) - 0.25
    np.testing.assert_allclose(nlos.variance, los_variance + 409**2)


def test_missing_steps_and_uneven_times_and_3d():
    text = EXAMPLE.replace("step_s = 0.2\nsteps = 10", "times_s = [1, 2, 4, 7]").replace(
        "stay = 0.9", "dwell_s = { los = 2, nlos = 1 }"
    )
    scenario = understood(text.replace("bs1 = {", "bs1 = { missing_steps = [1, 3], "))
    assert scenario.times.intervals.tolist() == [1, 2, 3]
    assert scenario.reports[:, 0].tolist() == [False, True, False]
    assert scenario.reports[:, 1].all()
    for flat, high in (
        ("[500, 500]", "[500, 500, 1]"),
        ("[5, 5]", "[5, 5, 0]"),
        ("-2000]", "-2000, 10]"),
        ("5000]", "5000, 10]"),
        ("6000, 2000]", "6000, 2000, 30]"),
        ("= 50\n", "= [50, 50, 2]\n"),
    ):
        text = text.replace(flat, high)
    scenario = understood(text)
    assert scenario.dim == 3
    np.testing.assert_array_equal(np.diag(scenario.prior.covariance), [2500, 2500, 4, 4, 4, 4])


def test_anchors_from_a_table_with_overrides(tmp_path):
    (tmp_path / "anchors.csv").write_text("anchor_id,x_m,y_m,note\na,1,2,x\nb c,3,4,y\n")
    table = 'anchors_csv = "anchors.csv"\n'
    head = EXAMPLE.split("[anchors]")[0]
    for text in (table + head, head + table, head + "[anchors]\n" + table):  # also where TOML counts it to a section
        (tmp_path / "s.toml").write_text(text)
        scenario = load(tmp_path / "s.toml")
        assert [link.name for link in scenario.links] == ["a", "b c"]
        np.testing.assert_array_equal(scenario.anchors, [[1, 2], [3, 4]])
    (tmp_path / "s.toml").write_text(table + head + '[anchors]\n"b c" = { los = { std_m = 1 } }\n')
    assert [
        float(link.noises[0].std) for link in understood((tmp_path / "s.toml").read_text(), folder=tmp_path).links
    ] == [150, 1]


def test_written_file_is_short_and_teaches():
    text = dumps(understood(EXAMPLE.replace(", los = { std_m = 100, mean_m = 3 }", "")))
    assert text.count("std_m = 150") == 1
    assert "bs1 = { position_m = [-3000, -2000] }" in text
    assert "step 0 is the prior" in text
    assert max(map(len, text.splitlines())) <= 120


def test_comments_say_where_numbers_came_from():
    notes = {
        "": "Fitted",
        "links.los": "from 4210 ranges",
        "links.los.std_m": "and more",
        "anchors.bs1.los": "few",
        "time": "log",
    }
    text = dumps(understood(EXAMPLE), notes)
    lines = text.splitlines()
    assert lines[0] == "# Fitted"
    assert lines[lines.index("[time]") + 1] == "# log"
    k = lines.index("los = { std_m = 150 }")
    assert lines[k - 2 : k] == ["# from 4210 ranges", "# and more"]
    assert "few" in text
    assert eqx.tree_equal(understood(text), understood(EXAMPLE))


def test_save_is_whole_or_nothing(tmp_path):
    path = tmp_path / "s.toml"
    save(understood(EXAMPLE), path)
    assert eqx.tree_equal(load(path), understood(EXAMPLE))
    assert [p.name for p in tmp_path.iterdir()] == ["s.toml"]
    with pytest.raises(InputError, match="cannot write"):
        save(understood(EXAMPLE), tmp_path / "s.toml" / "below.toml")


def test_pieces_without_a_file_form_are_named():
    scenario = understood(EXAMPLE)
    three = MarkovSight(None, np.full((3, 3), 1 / 3))
    link = scenario.links[0]
    odd = Link(link.name, link.measurement, three, (*link.noises, Gaussian(0, 1)))
    with pytest.raises(InputError, match="bs1 with 3 sight conditions"):
        dumps(scenario.replace(links=[odd]))


# Random scenarios; built outside of strategies, since the shape checks use random numbers themselves

coordinates = st.floats(-1e5, 1e5, allow_nan=False)
deviations = st.one_of(st.sampled_from([0.5, 2.0, 150.0, 0.1]), st.floats(1e-3, 1e4))
probabilities = st.one_of(st.sampled_from([0.0, 0.5, 0.9, 1.0]), st.floats(0, 1))
names = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=6)


def laws(draw):
    p = draw(probabilities)
    return np.array([p, 1 - p])


def sights(draw, times):
    kind = draw(st.sampled_from(["known", "dwell", "markov", "stay"]))
    if kind == "known":
        return KnownSight(draw(st.lists(st.integers(0, 1), min_size=times.steps, max_size=times.steps)))
    start = laws(draw) if draw(st.booleans()) else None
    if kind == "dwell" or np.ptp(times.intervals) > 1e-6 * times.intervals.max():
        return DwellSight(start, [draw(deviations), draw(deviations)])
    if kind == "stay":
        return MarkovSight.stay(draw(probabilities), start)
    return MarkovSight(start, [laws(draw), laws(draw)])


def noises(draw):
    kind = draw(st.sampled_from(["gauss", "excess", "mixture", "outlier"]))
    los, nlos, far = ((draw(coordinates), draw(deviations)) for _ in range(3))
    if kind == "excess":
        return Gaussian(*los), Gaussian(los[0] + nlos[0], np.sqrt(los[1] ** 2 + nlos[1] ** 2))
    if kind == "gauss":
        return Gaussian(*los), Gaussian(*nlos)
    share = draw(st.floats(0.001, 0.999))
    mixed = [GaussianMixture([1 - share, share], [a[0], far[0]], [a[1], far[1]]) for a in (los, nlos)]
    return (mixed[0], mixed[1]) if kind == "outlier" else (mixed[0], Gaussian(*nlos))


def scenarios(draw):
    dim = draw(st.sampled_from([2, 3]))
    if draw(st.booleans()):
        times = Times.uniform(step_s=draw(st.floats(0.01, 100)), steps=draw(st.integers(1, 30)))
    else:
        times = Times(
            draw(st.floats(-1e3, 1e3)) + np.cumsum(draw(st.lists(st.floats(0.01, 9), min_size=2, max_size=20)))
        )
    discrete, per_axis = draw(st.booleans()), draw(st.booleans())
    intensity = draw(st.lists(st.floats(0, 10), min_size=dim, max_size=dim)) if per_axis else draw(st.floats(0, 10))
    root = np.diag(draw(st.lists(deviations, min_size=2 * dim, max_size=2 * dim)))
    if draw(st.booleans()):
        root[draw(st.integers(0, 2 * dim - 1)), 0] += draw(deviations)
    covariance = root @ root.T
    prior = GaussianPrior(draw(st.lists(coordinates, min_size=2 * dim, max_size=2 * dim)), covariance)
    pool = [(sights(draw, times), noises(draw)) for _ in range(2)]
    links = []
    for name in draw(st.lists(names, min_size=1, max_size=4, unique=True)):
        sight, noise = draw(st.sampled_from(pool))
        reports = draw(st.none() | st.lists(st.booleans(), min_size=times.steps, max_size=times.steps).map(np.array))
        links.append(Link(name, Range(draw(st.lists(coordinates, min_size=dim, max_size=dim))), sight, noise, reports))
    return Scenario(
        draw(st.text(st.characters(exclude_categories=["Cs"]), max_size=20)),
        times,
        ConstantVelocity(intensity, dim, discrete=discrete),
        prior,
        links,
    )


@given(st.data())
def test_round_trip_leaf_by_leaf(data):
    scenario = scenarios(data.draw)
    assert eqx.tree_equal(understood(dumps(scenario)), scenario)
