"""``simulate`` and ``score`` through the shell: runs out, estimates in, and what is wrong with them."""

import json

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import locbounds as lb
from locbounds.cli.app import app
from refusals import refused

STEPS, RUNS = 3, 40


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a scenario, its runs, and estimates of an IMM-EKF of these runs."""
    place = tmp_path_factory.mktemp("own")
    scenario = lb.papers.fritsche2013.scenario(steps=STEPS)
    lb.save(scenario, place / "s.toml")
    draws = lb.simulate(scenario, runs=RUNS, seed=5)
    np.save(place / "imm.npy", lb.ImmEkf()(scenario, draws.measurements).mean)
    return place


@pytest.fixture(autouse=True)
def _there(place, monkeypatch):
    monkeypatch.chdir(place)
    monkeypatch.setenv("LOCBOUNDS_CACHE", "off")


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def simulated(*options, runs=RUNS, out="runs"):
    done = run("simulate", "s.toml", "--runs", runs, "--seed", 5, "--out", out, *options)
    assert done.exit_code == 0, done.output
    return done


def arrays(path):
    with np.load(path) as file:
        return dict(file)


def table(estimates):
    """Estimates of the steps 1.. as the documented CSV table."""
    runs, steps, _ = estimates.shape
    run, k = (i.ravel() for i in np.indices((runs, steps)))
    columns = dict(zip(("x_m", "y_m"), estimates.reshape(-1, estimates.shape[-1]).T, strict=False))
    return pd.DataFrame({"track_id": run, "step": k + 1, **columns})


def scored(estimates, *options):
    done = run(
        "score", "s.toml", "--estimates", estimates, "--bounds", "bcrb", "--rtol", 0.05, "--seed", 5, "--json", *options
    )
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def test_runs_are_those_of_python_in_both_formats(place):
    simulated()
    draws = lb.simulate(lb.load("s.toml"), runs=RUNS, seed=5)
    seen, hidden = arrays("runs/ranges.npz"), arrays("runs/truth.npz")
    np.testing.assert_array_equal(seen["ranges_m"], draws.measurements)
    np.testing.assert_array_equal(hidden["state_true"], draws.states)
    np.testing.assert_array_equal(hidden["position_true_m"], draws.states[..., :2])
    np.testing.assert_array_equal(hidden["sight"], draws.sight)
    assert not {"state_true", "position_true_m", "sight"} & set(seen)
    ranges, truth, sight = (pd.read_csv(f"runs/{name}.csv") for name in ("ranges", "truth", "sight"))
    np.testing.assert_array_equal(ranges["range_m"], draws.measurements.ravel())  # every digit
    np.testing.assert_array_equal(truth[["x_true_m", "y_true_m", "vx_m_s", "vy_m_s"]], draws.states.reshape(-1, 4))
    np.testing.assert_array_equal(sight["sight"] == "nlos", draws.sight.ravel() == 1)
    assert lb.load("runs/scenario.toml").steps == STEPS


def test_the_same_seed_gives_the_same_bytes_and_fewer_runs_their_beginning(place):
    simulated()
    simulated(out="again")
    simulated("--format", "csv", runs=7, out="few")
    for name in ("ranges.csv", "truth.csv", "sight.csv", "ranges.npz", "truth.npz"):
        assert (place / "runs" / name).read_bytes() == (place / "again" / name).read_bytes()
    assert (place / "runs" / "ranges.csv").read_text().startswith((place / "few" / "ranges.csv").read_text())
    assert not (place / "few" / "ranges.npz").exists()


def test_a_range_that_was_not_reported_is_a_missing_line(place):
    scenario = lb.load("s.toml").with_reports(np.array([[1, 0, 1], [1, 1, 1], [0, 1, 0]]) > 0)
    lb.save(scenario, "gaps.toml")
    assert run("simulate", "gaps.toml", "--runs", 2, "--out", "gaps").exit_code == 0
    ranges = pd.read_csv("gaps/ranges.csv")
    assert ranges.groupby("track_id")["step"].apply(list).tolist() == [[1, 1, 2, 2, 2, 3]] * 2
    assert np.isnan(arrays("gaps/ranges.npz")["ranges_m"]).sum() == 6


def test_simulated_runs_are_a_log(place):
    simulated("--format", "csv")
    log = lb.read_log("runs/ranges.csv", anchors="runs/anchors.csv", truth="runs/truth.csv")
    assert (len(log.tracks), log.anchor_names) == (RUNS, ("bs1", "bs2", "bs3"))


def test_csv_and_arrays_score_alike_and_the_truth_can_be_drawn_again(place):
    simulated()
    imm = np.load("imm.npy")
    table(imm[:, 1:]).sample(frac=1, random_state=0).to_csv("mine.csv", index=False)  # in any order
    np.savez("mine.npz", estimates=imm)
    a, b = scored("mine.csv", "--truth", "runs"), scored("mine.npz", "--truth", "runs/truth.csv")
    c = scored("imm.npy", "--name", "mine", "--out", "c")
    assert a["scores"] == b["scores"] == c["scores"]
    own, bound = a["scores"]
    assert own["method"] == "own"
    ratio = bound["efficiency"]
    assert bound["low"] < ratio < bound["high"]
    assert (place / "c" / "rmse.png").read_bytes().startswith(b"\x89PNG")
    rows = (place / "c" / "rmse.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows[1:]] == ["own"] * 4 + ["bcrb"] * 4
    assert "mine" in run("score", "s.toml", "--estimates", "imm.npy", "--seed", 5, "--bounds", "bcrb", "--rtol", 0.05,
                         "--name", "mine", "--out", "c").stdout  # fmt: skip


def test_a_filter_told_the_sight_is_compared_with_bounds_that_know_it():
    simulated()
    found = scored("imm.npy", "--truth", "runs", "--sees", "ranges,sight", "--bounds", "bcrb,enumer")
    assert list(found["refused"]) == ["bcrb"]
    assert [row["efficiency"] != "" for row in found["scores"]] == [False, False, True]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t[t["step"] != 2], ["no line for run 0, step 2 (and 39 more)", "its prediction"]),
        (lambda t: t[t["track_id"] != 7], ["no estimate of run 7", "all runs"]),
        (lambda t: t.assign(track_id=t["track_id"] + 1), ["the runs 1..40, the truth 0..39", "starts at 0"]),
        (lambda t: t.assign(step=t["step"] + 1), ["is step 4", "0..3"]),
        (lambda t: pd.concat([t, t[:1]]), ["line 122 ", "second time"]),
        (lambda t: t.assign(x_m=t["x_m"].where(t.index != 3)), ["line 5 ", "x_m", "empty"]),
        (lambda t: t.assign(x_m=1e3 * t["x_m"], y_m=1e3 * t["y_m"]), ["look like millimetres"]),
        (lambda t: t.rename(columns={"x_m": "east"}), ["no column x_m", "--column estimates.x"]),
        (lambda t: t.rename(columns={"x_m": "lat", "y_m": "lon"}), ["degrees", "Project"]),
        (lambda t: t.drop(columns="step"), ["neither a column step nor time_s"]),
        (lambda t: t.assign(time_s=200 * t["step"]), ["is at 200 s, step 1 of the scenario at 0.2 s", "in seconds"]),
    ],
)
def test_bad_tables_are_refused_and_nothing_is_written(place, change, words):
    simulated("--format", "csv")
    change(table(np.load("imm.npy")[:, 1:])).to_csv("bad.csv", index=False)
    score_refuses(place, "bad.csv", words, "--truth", "runs")


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"a": np.ones((RUNS, 4, 2)), "b": np.ones(3)}, ["holds the arrays a, b", "estimates"]),
        ({"estimates": np.ones((RUNS, 7, 2))}, ["have 7 steps, the bound the steps 0..3"]),
        ({"estimates": np.array(["x"])}, ["not numbers"]),
    ],
)
def test_bad_arrays_are_refused(place, arrays, words):
    np.savez("bad.npz", **arrays)
    score_refuses(place, "bad.npz", words, "--seed", 5)


def test_files_that_are_not_there(place):
    score_refuses(place, "nowhere.npz", ["nowhere.npz does not exist"])
    score_refuses(place, "nowhere.csv", ["nowhere.csv does not exist"])
    (place / "text.npz").write_text("hello")
    score_refuses(place, "text.npz", ["cannot be read"])
    score_refuses(place, "imm.npy", ["neither truth.npz nor truth.csv"], "--truth", ".")
    done = run("score", "s.toml")
    assert (done.exit_code, "--estimates" in done.stderr) == (2, True)


def score_refuses(place, estimates, words, *options):
    done = run("score", "s.toml", "--estimates", estimates, "--bounds", "bcrb", "--rtol", 0.05, "--out", "no", *options)
    refused(done, *words, unwritten=place / "no")
