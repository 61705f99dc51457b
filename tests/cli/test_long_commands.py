"""``track``, ``paper`` and ``fit`` through the shell: wrong options, and Ctrl-C in the middle."""

import threading
import time

import pytest
from typer.testing import CliRunner

from locbounds.cli.app import app
from refusals import refused


@pytest.fixture(autouse=True)
def _a_scenario_in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LOCBOUNDS_CACHE", "off")
    assert run("new", "s.toml").exit_code == 0
    (tmp_path / "s.toml").write_text((tmp_path / "s.toml").read_text().replace("steps = 100 ", "steps = 3 "))


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def files(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file() and p.name != ".locbounds")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["track", "s.toml", "--bounds", "bcbr"], ["unknown bound 'bcbr'", "Did you mean bcrb?"]),
        (["track", "s.toml", "--filters", "imm-efk"], ["unknown filter 'imm-efk'", "Did you mean imm-ekf?"]),
        (["track", "s.toml", "--bounds", "imm-ekf"], ["unknown bound 'imm-ekf'", "Known: bcrb"]),
        (["track", "s.toml", "--filters", "none", "--rtol", "0"], ["rtol is 0", "between 0 and 1"]),
        (["track", "s.toml", "--filters", "none", "--rtol", "nan"], ["rtol is nan"]),
        (["track", "s.toml", "--runs", "0"], ["--runs", "--help"]),
        (["track", "s.toml", "--filters", "none", "--bounds", "known-sight"], ["is random", "enumer"]),
        (["track", "s.toml", "--horizon", "predict:4"], ["4 steps ahead, the record has 3", "predict:3"]),
        (["track", "s.toml", "--horizon", "later"], ["the horizon is 'later'", "smooth"]),
        (["track", "none.toml"], ["cannot read none.toml", "locbounds new none.toml"]),
        (
            ["track", "s.toml", "--filters", "none", "--ranges", "r.csv"],
            ["--anchors, --truth", "Give ranges, anchors and truth"],
        ),
        (["paper", "fritsche"], ["unknown paper 'fritsche'", "Did you mean fritsche2013?"]),
        (["paper", "fritsche2013", "--samples", "0"], ["--samples"]),
        (["paper", "fritsche2013", "--out", "s.toml"], ["s.toml is a file", "--out"]),
        (["fit", "none.csv", "--anchors", "a.csv", "--truth", "t.csv"], ["none.csv"]),
        (["fit", "none.csv"], ["--anchors, --truth missing"]),
    ],
)
def test_wrong_options_are_refused_and_nothing_is_written(tmp_path, arguments, words):
    done = run(*arguments)
    refused(done, *words, unwritten=tmp_path / "s-out")
    assert files(tmp_path) == ["s.toml"]


def test_ctrl_c_between_bounds_keeps_the_finished_one(tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("locbounds.bounds.conditional.enumer", interrupted)
    done = run("track", "s.toml", "--bounds", "bcrb,enumer", "--filters", "none", "--rtol", "0.1")
    assert done.exit_code == 130
    assert done.stderr.startswith("error: interrupted\nremedy: kept what was finished: s-out/partial-rmse.csv")
    rows = (tmp_path / "s-out" / "partial-rmse.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows] == ["method"] + ["bcrb"] * 4
    assert not (tmp_path / "s-out" / "rmse.csv").exists()
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    assert run("track", "s.toml", "--bounds", "bcrb", "--filters", "none", "--rtol", "0.1").exit_code == 0
    assert files(tmp_path / "s-out") == ["rmse.csv", "rmse.png", "run.nc"]  # the whole replaces the partial


def test_ctrl_c_in_a_study_does_not_wait_for_the_bounds_that_run(monkeypatch):
    from locbounds.papers import fritsche2013

    running, ended = threading.Event(), threading.Event()

    def interrupted(*_, **__):
        assert running.wait(10)
        raise KeyboardInterrupt

    def slow(model, *, samples, seed, progress):
        running.set()
        try:
            for _ in range(600):  # half a minute
                time.sleep(0.05)
                progress(1, 1.0, 1.0)
        finally:
            ended.set()

    monkeypatch.setattr(fritsche2013, "simulate", lambda *_, **__: None)
    monkeypatch.setattr(fritsche2013, "evaluate_on", interrupted)
    monkeypatch.setattr(fritsche2013, "bcrb", slow)
    with pytest.raises(KeyboardInterrupt):
        next(fritsche2013.study(samples=1, runs=2))
    assert ended.wait(5)


def test_bounds_and_filters_follow_the_horizon(tmp_path):
    done = run("track", "s.toml", "--horizon", "smooth", "--bounds", "enumer", "--filters", "imm-kf-smoother",
               "--runs", "8", "--rtol", "0.1")  # fmt: skip
    assert done.exit_code == 0, done.output
    assert "tightest valid bound for a smoother that sees the ranges only: enumer" in done.output
    assert "Position RMSE, smoothing" in done.output
