"""Numbers that pages state without executing anything: computed again, within what page and computation leave open.

A number on a page carries its rounding, and its standard error where it has one. All are slow; what needs measured data
is skipped without them.
"""

import json
import math
import re

import numpy as np
import pytest
from typer.testing import CliRunner

import locbounds as lb
from datasets import PROJECT, need
from locbounds.cli.app import app

pytestmark = pytest.mark.slow
SIGMAS = 5.0


def said(page, pattern):
    """The groups of a pattern on a page, as numbers; words may be broken anywhere."""
    text = " ".join((PROJECT / "docs" / page).read_text().split())
    (found,) = re.findall(pattern, text)  # once
    return [float(x.replace(",", "")) for x in ([found] if isinstance(found, str) else found)]


def near(value, stated, digit, error=0.0, its_error=0.0):
    """Whether a value agrees with a stated one that is rounded to a multiple of ``digit``."""
    return abs(value - stated) <= 0.51 * digit + SIGMAS * math.hypot(error, its_error)


def test_corners_and_tangents_of_munich():
    buildings, corners, tangents = said(
        "streets.md", r"for the (\d+) buildings in the centre of Munich (\d+) corners and ([\d,]+) tangents"
    )
    city = lb.read_city(need("city_munich") / "buildings.geojson")
    assert len(city.buildings) == buildings
    assert (len(city.graph.corner), city.graph.weights.nnz / 2) == (corners, tangents)  # each from both its ends


def test_the_streets_of_munich(tmp_path, monkeypatch):
    """The city file as the page prints it."""
    file = re.search(r"```toml\n(.*?)```", (PROJECT / "docs" / "streets.md").read_text(), re.S)
    assert file is not None
    assert "Munich" in file[1]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "buildings.geojson").symlink_to(need("city_munich") / "buildings.geojson")
    (tmp_path / "city.toml").write_text(file[1])
    done = CliRunner().invoke(app, ["map", "city.toml", "--json"])
    assert done.exit_code == 0, done.output
    out = json.loads(done.stdout[done.stdout.index("{") :])
    number = r"([\d.]+) ± ([\d.]+) m"
    pattern = rf"{number} over all streets \(valid bound ([\d.]+) m\), TDoA {number} \(bound ([\d.]+) m\)"
    toa, toa_error, toa_bound, tdoa, tdoa_error, tdoa_bound = said("streets.md", pattern)
    stated = {"toa": (toa, toa_error, toa_bound), "tdoa": (tdoa, tdoa_error, tdoa_bound)}
    for row in out["overall"]:
        least, error, bound = stated.pop(row["measure"])
        assert near(row["mmse_m"], least, 0.1, row["mmse_stderr_m"], error)
        assert row["mmse_stderr_m"] < 2 * error
        assert near(row["tightest_m"], bound, 0.1, 0.02 * bound / SIGMAS)  # the search's draws differ
    assert not stated
    pattern = r"refused at (\d+) % of the street points, and infinite at another (\d+) % for ToA, (\d+) % for TDoA"
    refused, *infinite = said("streets.md", pattern)
    for kind, share in zip(("toa", "tdoa"), infinite, strict=True):
        counts = out["points"][kind]
        streets = {status: counts[status] for status in ("value", "boundary", "singular")}  # reached by all in use
        for status, percent in (("boundary", refused), ("singular", share)):
            assert near(100 * streets[status] / sum(streets.values()), percent, 1)


def test_one_length_is_lower_along_streets():
    (percent,) = said("streets.md", r"it is up to (\d+) % lower")
    from locbounds.papers.mcguire2009 import streets

    gaps = []
    for row, other in by_pairs(streets.fig8(streets.SIGMAS_M), "WWB, one length", "WWB"):
        gaps.append(100 * (1 - row.rmse_m / other.rmse_m))
    assert len(gaps) == len(streets.SIGMAS_M) * len(streets.STREET_CASES)
    assert near(max(gaps), percent, 1)


def by_pairs(rows, one, two):
    at = {(r.case, r.sigma, r.method): r for r in rows}
    return [(r, at[r.case, r.sigma, two]) for r in rows if r.method == one]


def slow_target(stay):
    """The two ranges of the table of score.md: a target that hardly moves, weakly separated modes, 24 steps."""
    noises = (lb.Gaussian(0.0, 3.0), lb.Gaussian(5.0, 3.0))
    anchors = [(-300.0, -20.0), (30.0, 400.0)]
    links = [lb.Link(f"a{m}", lb.Range(a), lb.MarkovSight.stay(stay), noises) for m, a in enumerate(anchors)]
    start = lb.GaussianPrior([0.0, 0.0], np.diag([400.0, 400.0]))
    return lb.Scenario("slow", lb.Times.uniform(step_s=0.5, steps=24), lb.RandomWalk(0.02), start, links)


@pytest.mark.parametrize(
    ("pattern", "sign"),
    [
        (r"alternating, stay ([\d.]+) \| (\d+) % too high: no bound \| ([\d.]+) % below", 1),
        (r"sticky, stay ([\d.]+) \| (\d+) % too low \| within its standard error of ([\d.]+) %", -1),
    ],
    ids=["alternating", "sticky"],
)
def test_windows_of_one_step(pattern, sign):
    stay, wrong, after = said("theory/score.md", pattern)
    scenario = slow_target(stay)
    full = lb.bcrb(scenario, samples=65_536, window=24)
    plain = lb.bcrb(scenario, samples=65_536, window=1)
    bound = lb.bcrb(scenario, samples=65_536, window=1, engine="corrected")
    worst = 100 * (plain.position_rmse.values / full.position_rmse.values - 1)
    k = np.abs(worst).argmax()
    errors = [100 * r.position_rmse_stderr.values / r.position_rmse.values for r in (full, plain, bound)]
    assert near(sign * worst[k], wrong, 1, errors[0][k], errors[1][k])
    last = 100 * (bound.position_rmse.values[-1] / full.position_rmse.values[-1] - 1)
    error = math.hypot(errors[0][-1], errors[2][-1])
    assert near(last, -after if sign > 0 else 0.0, 0.01, error)
    assert error < 0.2


def test_the_bias_of_one_block():
    converged, most = said("theory/score.md", r"differs from that of 64 blocks, ([\d.]+) m, by less than ([\d.]+) m")
    scenario, seeds = lb.papers.fritsche2013.scenario(), 200
    one = np.array([lb.bcrb(scenario, samples=1, window=12, seed=seed).mean_position_rmse() for seed in range(seeds)])
    many = lb.bcrb(scenario, samples=64 * 2048, window=12, seed=seeds)
    error = many.mean_position_rmse_stderr()
    assert near(many.mean_position_rmse(), converged, 0.01, error)
    assert abs(one.mean() - many.mean_position_rmse()) < most + SIGMAS * math.hypot(error, one.std() / math.sqrt(seeds))


def test_the_printed_weiss_weinstein_bound_is_looser():
    (percent,) = said("theory/static-bounds.md", r"the bound looser, by up to (\d+) % in Fig. 3")
    from locbounds.papers.mcguire2009 import CASES

    gaps = [
        100 * (level.wwb_m / level.printed_m - 1)
        for case in CASES
        if case.figure == "fig3"
        for level in lb.bounds_over_noise(case.plan(), case.sigmas, rtol=2e-3)
    ]
    assert len(gaps) == 16
    assert near(max(gaps), percent, 1, 0.4 / SIGMAS)


def test_maximum_likelihood_lies_below_the_inverse_mean_information():
    from locbounds.papers.mcguire2009 import CASES
    from locbounds.papers.mcguire2009.simple import inverse_expected_information
    from locbounds.static.estimators import ls, ml

    pattern = r"at (\d+) m that is ([\d.]+) m if .*? and ([\d.]+) m in a box .*? information is ([\d.]+) m"
    sigma, inside, wide, claimed = said("theory/static-bounds.md", pattern)
    for estimator, stated in ((ml, inside), (ls, wide)):
        found = estimator(CASES[0].plan(sigma), seed=1)
        assert near(found.mean_position_rmse(), stated, 0.1, found.mean_position_rmse_stderr())
    assert near(sigma * inverse_expected_information(CASES[0]), claimed, 0.1)


def test_distances_measured_in_two_rooms():
    """The lessons of rss-toa.md: no draws but those of the predictions."""
    from locbounds.papers.prieto2011 import measured

    rows = {(r.scene, r.measured, r.method): r for r in measured.compare(need("wifi_rtt_grid"))}
    scenes = sorted({scene for scene, *_ in rows})
    assert len(scenes) == 2

    def values(kind, method):
        return sorted(rows[scene, kind, method].rmse_m for scene in scenes)

    lessons = [
        ("toa", "Cramér-Rao, bias of the block", r"number is ([\d.]+) to ([\d.]+) m for ToA"),
        ("toa", "posterior mean, as the laws predict", r"would have ([\d.]+) to ([\d.]+) m on data that follow"),
        ("rss", "inverted path loss", r"RSS alone inverts to ([\d.]+) and ([\d.]+) m"),
        ("rss", "posterior mean, measured", r"brings that to ([\d.]+) and ([\d.]+) m"),
        ("toa", "mean range less offset", r"the mean range less its offset ([\d.]+) and ([\d.]+) m"),
        ("toa", "posterior mean, measured", r"it has ([\d.]+) m \(lecture theatre\) and ([\d.]+) m \(office\)"),
    ]
    for kind, method, pattern in lessons:
        stated = sorted(said("rss-toa.md", pattern))
        digit = 0.01 if "offset" in pattern or "theatre" in pattern else 0.1
        for value, number in zip(values(kind, method), stated, strict=True):
            assert near(value, number, digit), (kind, method)


def test_the_table_of_400_tracks():
    """Fewer tracks with another seed, and their larger standard errors."""
    from locbounds.papers import chen2010

    page = (PROJECT / "docs" / "known-sight.md").read_text()
    found = chen2010.study(runs=100, seed=1)
    names = {"RBPF": "RBPF", "EKF banks": "EKF banks", "IMM-KF": "IMM-KF", "IMM-KF, weighted": "IMM-KF weighted"}
    pair = r"([\d.]+) ± ([\d.]+) m"
    for shown, name in names.items():
        (numbers,) = re.findall(rf"^\| {shown} \| {pair} \| {pair} \|", page, re.M)
        for stay, (value, error) in zip(
            (chen2010.STAY, chen2010.MATCHED_STAY), np.array(numbers, float).reshape(2, 2), strict=True
        ):
            (result,) = [s.result for s in found.settings if (s.method, s.stay) == (name, stay)]
            stderr = result.mean_position_rmse_stderr(1)
            assert near(result.mean_position_rmse(1), value, 0.1, stderr, error), (name, stay)
    for shown, name in {"bound (total)": "known-sight", "told the sight": "oracle"}.items():
        ((value, error),) = re.findall(rf"^\| {re.escape(shown)} \| {pair} \|", page, re.M)
        result = found.results[name]
        assert near(
            result.mean_position_rmse(1), float(value), 0.1, result.mean_position_rmse_stderr(1), float(error)
        ), name
