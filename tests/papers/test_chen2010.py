import csv

import numpy as np
import pytest
from typer.testing import CliRunner

import locbounds as lb
from locbounds.cli.app import app
from locbounds.papers import chen2010
from locbounds.papers.chen2010.study import along_every_track, paired

STEPS = 16


@pytest.fixture(scope="module")
def small():
    return chen2010.study(runs=6, steps=STEPS, samples=100)


def test_the_least_steady_bound_is_the_riccati_fixed_point_and_no_layout_is_below_it():
    scenario = chen2010.scenario(steps=1)
    F, Q = np.asarray(scenario.transition[0]), np.asarray(scenario.process_noise[0])

    def steady(angles):
        u = np.array([[np.cos(a), np.sin(a), 0, 0] for a in angles])
        J, P = u.T @ u / 150.0**2, np.asarray(scenario.prior.covariance)
        for _ in range(1500):
            P = F @ P @ F.T + Q
            P = P @ np.linalg.inv(np.eye(4) + J @ P)
        return np.sqrt(P[0, 0] + P[1, 1])

    thirds = 2 * np.pi * np.arange(3) / 3
    assert chen2010.least_steady_bound() == pytest.approx(steady(thirds), rel=1e-9)
    rng = np.random.default_rng(0)
    assert min(steady(rng.uniform(0, 2 * np.pi, 3)) for _ in range(5)) > chen2010.least_steady_bound()
    assert max(chen2010.PUBLISHED_BOUND_M.values()) < chen2010.least_steady_bound()
    assert max(chen2010.PUBLISHED_BOUND_M.values()) > chen2010.least_steady_bound() / np.sqrt(2)


def test_the_two_printed_deviations_are_one():
    assert chen2010.scenario(steps=1).links[0].noises[1].variance == pytest.approx(436.0**2, rel=2e-3)


def test_the_schedule_is_table_1():
    sights = chen2010.schedule()
    assert [int(s.sum()) for s in sights.values()] == [200, 0, 400]
    assert sights["bs1"][199] == 1
    assert sights["bs1"][200] == 0
    with pytest.raises(lb.InputError, match="cannot be divided"):
        chen2010.schedule(steps=15)


@pytest.mark.slow
def test_bounds_along_all_tracks_at_once_are_those_along_each(small):
    truth = chen2010.scenario(steps=STEPS).with_known_sight(chen2010.schedule(steps=STEPS))
    draws = lb.simulate(truth, runs=6, seed=0)
    along = along_every_track(truth, draws)
    np.testing.assert_array_equal(along, small.along_tracks)
    one = lb.known_sight(truth, expectation=lb.AlongTrack(draws.states[2, :, :2]))
    np.testing.assert_allclose(along[:, 2], one.position_rmse.values, rtol=1e-9)


@pytest.mark.slow
def test_the_paired_difference_has_the_error_of_a_jackknife(small):
    a, b = small.results["RBPF"], small.results["IMM-KF"]
    difference, error = paired(a, b)
    squares = [np.square(r.diagnostics["error_m"])[:, 1:].mean(1) for r in (a, b)]
    without = [np.sqrt(np.delete(squares[1], i).mean()) - np.sqrt(np.delete(squares[0], i).mean()) for i in range(6)]
    assert difference == pytest.approx(np.sqrt(squares[1].mean()) - np.sqrt(squares[0].mean()))
    assert error == pytest.approx(np.sqrt(5 * np.var(without)), rel=0.1)


@pytest.mark.slow
def test_what_cannot_hold_is_said_with_the_reason(small):
    said = {s.verdict: s for s in chen2010.statements(small)}
    assert "39.6" in said["cannot hold"].why
    assert "Per axis" in said["cannot hold"].why


@pytest.mark.slow
def test_the_command_writes_what_it_promises(tmp_path, monkeypatch, small):
    monkeypatch.setenv("LOCBOUNDS_CACHE", "off")
    monkeypatch.setattr("locbounds.papers.chen2010.study", lambda **_: small)
    done = CliRunner().invoke(app, ["paper", "chen2010", "--runs", "6", "--out", str(tmp_path / "o")])
    assert done.exit_code == 0, done.output
    expected = {
        "fig1.csv": ("method", "step", "position_rmse_m", "stderr_m"),
        "fig2.csv": ("method", "error_m", "share", "stderr"),
        "quantiles.csv": ("method", "quantile", "value_m", "stderr_m"),
        "segments.csv": ("method", "segment", "rmse_m", "stderr_m"),
    }
    for name, columns in expected.items():
        rows = list(csv.reader((tmp_path / "o" / name).read_text().splitlines()))
        assert tuple(rows[0]) == columns
        assert list(dict.fromkeys(row[0] for row in rows[1:])) == [
            "known-sight",
            "IMM-KF",
            "EKF banks",
            "RBPF",
            "oracle",
        ]
    assert (tmp_path / "o" / "fig1.png").stat().st_size > 10_000
    assert (tmp_path / "o" / "fig2.png").stat().st_size > 10_000
    for words in ("cannot hold", "requirement", "per axis", "0.99925", "clipped"):
        assert words in done.output.lower()
    settings = list(csv.DictReader((tmp_path / "o" / "settings.csv").read_text().splitlines()))
    assert {row["stay"] for row in settings} == {"0.85", "0.99925"}


def test_a_requirement_that_cannot_be_read_stops_before_any_work(tmp_path):
    done = CliRunner().invoke(app, ["paper", "chen2010", "--requirement", "fast", "--out", str(tmp_path / "o")])
    assert done.exit_code == 2
    assert "cannot read the requirement" in done.stderr
    assert not (tmp_path / "o").exists()


@pytest.mark.slow
def test_ranking_and_emergency_limits_hold_over_random_tracks():
    said = chen2010.statements(chen2010.study(runs=400))
    assert [s.verdict for s in said if "most accurate" in s.paper or "satisfy" in s.paper] == ["holds", "holds"]
