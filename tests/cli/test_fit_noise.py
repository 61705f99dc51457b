"""``locbounds fit --noise``: the table of laws, and the best law of each labelled sight in the scenario."""

import csv
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

import locbounds as lb
from locbounds.cli.app import app
from locbounds.cli.fit_noise import compare, with_best_laws
from locbounds.fit import RangeLog, Track, errors_of_log
from locbounds.io.range_errors import read_errors
from refusals import refused


@pytest.fixture(scope="module")
def log():
    """Labelled ranges: Laplace errors in LOS, an exponential excess with Gaussian noise in NLOS."""
    rng, anchors, tracks = np.random.default_rng(0), np.array([[0.0, 0.0], [60.0, 10.0]]), []
    for k in range(6):
        steps = 150
        position = np.stack([np.linspace(5, 50, steps + 1), np.full(steps + 1, 5.0 + k)], 1)
        sight = np.arange(2 * steps).reshape(steps, 2) // 5 % 2  # as many of each: one shape to compile for
        excess = rng.normal(0, 0.3, (steps, 2)) + rng.exponential(3.0, (steps, 2))
        error = np.where(sight == 0, rng.laplace(0, 0.5, (steps, 2)), excess)
        distance = np.linalg.norm(position[1:, None] - anchors, axis=-1)
        tracks.append(Track(f"t{k}", np.arange(steps + 1.0), distance + error, position, sight))
    return RangeLog(("a", "b"), anchors, tuple(tracks))


def test_labelled_laws_go_into_the_scenario(log):
    few = "gaussian,laplace,exponentially-modified-gaussian"
    laws = compare(errors_of_log(log, None), few, lambda text: None)
    assert {name: rows[0][1] for name, rows in laws.items()} == {
        "LOS": "laplace",
        "NLOS": "exponentially-modified-gaussian",
    }

    comments = {"links.los": "Gaussian", "time": "log"}
    fitted = SimpleNamespace(scenario=lb.papers.fritsche2013.scenario(steps=5), comments=comments, notes=())
    scenario, comments, notes = with_best_laws(fitted, laws)
    assert isinstance(scenario.links[2].noises[0], lb.Laplace)
    assert isinstance(scenario.links[0].noises[1], lb.ExponentiallyModifiedGaussian)
    assert float(scenario.links[0].noises[1].scale) == pytest.approx(3.0, rel=0.15)
    assert "best of 3 laws" in comments["links.los"]
    assert comments["time"] == "log"
    assert notes == ()


def test_one_track_is_refused_and_unknown_families_are_named(log):
    from dataclasses import replace

    with pytest.raises(lb.InputError, match="one track cannot be split"):
        errors_of_log(replace(log, tracks=log.tracks[:1]), None)
    with pytest.raises(lb.InputError, match="unknown noise family 'laplac'") as error:
        compare(errors_of_log(log, None), "laplac", lambda text: None)
    assert "Did you mean laplace?" in error.value.remedy


@pytest.fixture
def survey(tmp_path, monkeypatch):
    """Eight points and two anchors, one of them out of sight: the survey in three files, and as one table."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LOCBOUNDS_CACHE", "off")
    rng = np.random.default_rng(3)
    at, anchors = rng.uniform(0, 20, (8, 2)), np.array([[0.0, 0.0], [30.0, 0.0]])
    samples, table = ["spot,anchor_id,range_m,los"], ["range_m,true_m,error_m,spot,split,kind"]
    for k, m in np.ndindex(8, 2):
        true = np.linalg.norm(at[k] - anchors[m])
        for error in (rng.laplace, rng.gumbel)[m](0.0, 1.0, 40):
            samples.append(f"p{k},{'ab'[m]},{true + error},{1 - m}")
            table.append(f"{true + error},{true},{error},p{k},{'test' if k > 5 else 'train'},{('LOS', 'NLOS')[m]}")
    samples.append("p0,a,,1")  # not heard
    files = {
        "samples.csv": samples,
        "table.csv": table,
        "anchors.csv": ["anchor_id,x_m,y_m", *(f"{n},{x},{y}" for n, (x, y) in zip("ab", anchors, strict=True))],
        "points.csv": [
            "spot,x_true_m,y_true_m,split",
            *(f"p{k},{x},{y},{'test' if k > 5 else 'train'}" for k, (x, y) in enumerate(at)),
        ],
    }
    for name, lines in files.items():
        (tmp_path / name).write_text("\n".join(lines) + "\n")


FILES = ("samples.csv", "--anchors", "anchors.csv", "--truth", "points.csv", "--points", "spot")
FEW = ("--noise", "gaussian,laplace")


def run(*arguments):
    return CliRunner().invoke(app, ["fit", *arguments])


def test_a_survey_at_points_and_its_table_give_the_same_laws(survey, tmp_path):
    ways = {
        "files": (*FILES, "--labels", "los", "--hold-out", "split=test"),
        "errors": ("table.csv", "--errors", "error_m", "--points", "spot", "--labels", "kind", "--hold-out", "2"),
    }
    texts = {}
    for name, arguments in ways.items():
        done = run(*arguments, *FEW, "--out", name)
        assert done.exit_code == 0, done.output
        assert "LOS: laplace is best" in done.stdout
        assert sorted(path.name for path in (tmp_path / name).glob("noise*")) == ["noise.csv", "noise.png"]
        texts[name] = (tmp_path / name / "noise.csv").read_text()
    assert len(set(texts.values())) == 1
    files = {"anchors": "anchors.csv", "truth": "points.csv", "points": "spot"}
    first, *others = (
        read_errors("samples.csv", labels="los", hold_out=which, **files) for which in ("split=test", "2", "p6,p7")
    )
    table = read_errors("table.csv", distance="true_m", points="spot", labels="kind", hold_out="split=test")
    for other in (*others, table):
        for name, part in first.by_sight().items():
            np.testing.assert_array_equal(part.error_m, other.by_sight()[name].error_m)
            np.testing.assert_array_equal(part.held, other.by_sight()[name].held)
    rows = list(csv.DictReader(texts["errors"].splitlines()))
    table = np.genfromtxt(tmp_path / "table.csv", delimiter=",", names=True, dtype=None, encoding=None)
    fit, held = (table["error_m"][(table["kind"] == "LOS") & (table["split"] == part)] for part in ("train", "test"))
    (gaussian,) = [row for row in rows if (row["errors of"], row["law"]) == ("LOS", "gaussian")]
    expected = stats.norm.logpdf(held, fit.mean(), fit.std())
    assert float(gaussian["held-out"]) == pytest.approx(expected.mean(), abs=1e-4)
    assert (
        float(gaussian["s.e."])
        == pytest.approx(  # two points: half the difference of their means
            abs(expected[:40].mean() - expected[40:].mean()) / 2, abs=1e-4
        )
    )


@pytest.mark.parametrize(
    "arguments, words",
    [
        (FILES[:3] + FILES[5:], ("truth missing", "--distance")),
        ((*FILES, "--errors", "e"), ("the errors are in samples.csv, yet there is a file", "Leave it out")),
        ((*FILES, "--psd", "1"), ("--psd is for tracks", "Leave --psd out")),
        ((*FILES, "--hold-out", "p9"), ("no spot is called p9", "p0, p1")),
        ((*FILES, "--hold-out", "split=tset"), ("no errors are held out by split=tset", "COLUMN=VALUE")),
        ((*FILES, "--labels", "anchor_id"), ('column anchor_id, says "a"', "1 and 0 only")),
        (("table.csv", "--errors", "eror_m"), ("no column eror_m; the nearest name is error_m", "Rename")),
        (("table.csv", "--errors", "error_m", "--distance", "true_m"), ("both", "one of them")),
        (("table.csv", "--errors", "error_m", "--hold-out", "2"), ("cannot hold out 2", "--points COLUMN")),
    ],
)
def test_surveys_that_do_not_fit_together_are_refused(survey, tmp_path, arguments, words):
    before = sorted(tmp_path.iterdir())
    done = run(*arguments)
    refused(done, *words)
    assert sorted(tmp_path.iterdir()) == before


def test_errors_without_groups_are_said_to_count_as_independent(survey):
    done = run("table.csv", "--errors", "error_m", *FEW)
    assert done.exit_code == 0, done.output
    assert "standard errors take all as independent" in done.stdout
