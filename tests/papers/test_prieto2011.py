"""Prieto 2011: densities, what the printed Monte Carlo does, Fig. 3 at a small size, measured distances."""

import csv
import gzip
import sys
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate
from scipy.special import erf, ndtr
from typer.testing import CliRunner

import locbounds as lb
from datasets import need
from locbounds.cli.app import app
from locbounds.papers.prieto2011 import densities, measured, outputs, setting
from locbounds.papers.prieto2011.statements import remarks
from locbounds.papers.prieto2011.study import (
    Curve,
    Drift,
    Setting,
    Study,
    accumulated,
    edge_slopes,
    gain,
    settings,
    squared_scores,
    study,
)
from locbounds.precision import double_precision

STEPS, RUNS = 4, 32
DRAWS = 400_000
SIGMAS = 4.0


@pytest.fixture(scope="module")
def small():
    return study(runs=RUNS, steps=STEPS, samples=2_000, particles=200)


def made_up(*, gain=(0.02, 0.003), fused=0.5, error=0.01, reached=0.6, growth=0.5, often=0.5):
    """A study of nothing: the numbers that the statements depend on are given, all others are one."""
    methods = {"PCRLB as printed, N = 7": "not a bound", "PCRLB, noise not cut": "conditional", "EKF": "estimator"}
    methods |= {"Weiss-Weinstein": "conditional", "EKF as printed": "estimator", "particle filter": "estimator"}
    filtered = {"fusion": fused, "toa, random tracks": reached}
    curves = [
        Curve(
            case,
            method,
            np.array([2.0, filtered.get(case, 1.0) if method == "particle filter" else 1.0]),
            np.array([0.1, error if valid == "estimator" else 0.0]),
            valid,
        )
        for case in ("rss", "toa", "fusion", "toa, random tracks")
        for method, valid in methods.items()
    ]
    drifts = [Drift(case, n, 0.1 * n, 0.01, 1.0, growth) for case in ("rss", "toa") for n in (100, 1_000)]
    rows = [
        Setting(case, bias, prior, (often if prior == "every step" else 1.0) * (3.0 if "second" in bias else 1.0))
        for case in ("rss", "toa", "fusion")
        for bias in ("one per sample", "one per second")
        for prior in ("initial", "every step")
    ]
    gains = {(c.case, m): gain for c in curves for m in ("EKF", "EKF as printed")}
    return Study(curves, drifts, rows, gains, 7, 3)


def closed_form(case, e):
    """Density of cut noise plus its bias (eqs. 5 and 9), and where it ends."""
    if case == "rss":
        s, b = 1.6, 3.0
        total = np.hypot(s, b)
        low, high = np.maximum(-2 * b, e - 2 * s), np.minimum(2 * b, e + 2 * s)
        mu, std = e * b**2 / total**2, s * b / total
        bell = np.exp(-((e / total) ** 2) / 2) / total / np.sqrt(2 * np.pi)
        return bell * (ndtr((high - mu) / std) - ndtr((low - mu) / std)) / erf(np.sqrt(2)) ** 2
    return (ndtr(np.minimum(e, 7.0) / 3.5) - ndtr(np.maximum(e - 3.0, -7.0) / 3.5)) / 3.0 / erf(np.sqrt(2))


def test_the_densities_are_the_closed_forms_of_the_two_cases():
    (_, (e, p)), (_, (_, swapped)) = densities.curves(densities.FIG1).items()
    np.testing.assert_allclose(p, closed_form("rss", e), atol=1e-12)
    np.testing.assert_allclose(swapped, p, atol=1e-12)
    for (noise, _), (e, p) in zip(densities.FIG2.values(), densities.curves(densities.FIG2).values(), strict=True):
        s = noise.high / 2
        closed = (ndtr(np.minimum(e, 2 * s) / s) - ndtr(np.maximum(e - 3.0, -2 * s) / s)) / 3.0 / erf(np.sqrt(2))
        np.testing.assert_allclose(p, closed, atol=1e-12)
        assert integrate.trapezoid(p, e) == pytest.approx(1.0, abs=1e-4)


ENDS = {"rss": (-9.2, 9.2), "toa": (-7.0, 10.0)}


@pytest.mark.parametrize("case", ["rss", "toa"])
def test_large_squared_scores_are_as_frequent_as_the_closed_form_says_and_not_with_noise_that_is_not_cut(case):
    low, high = ENDS[case]
    e = low + (high - low) * (np.arange(400_000) + 0.5) / 400_000
    p = closed_form(case, e)
    square = np.gradient(np.log(p), e) ** 2
    cut, regular = (setting.scenario(case, noise=noise).sensors[0].error for noise in ("cut", "regular"))
    found, other = (squared_scores(noise, DRAWS, 0) for noise in (cut, regular))
    for level in (1.0, 4.0):
        expected = DRAWS * p[square > level].sum() * (high - low) / 400_000
        assert expected > 50
        assert abs(np.sum(found > level) - expected) < SIGMAS * np.sqrt(expected)
        assert expected - np.sum(other > level) > 2 * SIGMAS * np.sqrt(expected)


@double_precision
@jax.jit
def density_and_score(noise, e):
    return jnp.exp(noise.log_prob(e)), noise.score(e)


def frequency(noise, ends, level, n=40_000):
    """``Pr(score^2 > level)`` by draws next to the ends, even in the logarithm of the distance t, and its error."""
    t = np.exp(np.random.default_rng(0).uniform(np.log(1e-7), np.log(1e-2), n))
    total = np.zeros(n)
    for e in (ends[0] + t, ends[1] - t):
        p, score = density_and_score(noise, e)
        total += p * t * np.log(1e5) * (score**2 > level)
    return total.mean(), total.std() / np.sqrt(n)


@pytest.mark.parametrize("case", ["rss", "toa"])
def test_the_printed_monte_carlo_grows_with_its_draws_as_the_edges_say(case):
    """Near an edge p = c t and score = 1/t: Pr(score^2 > s) = c / (2 s), so that the mean grows by c/2 per factor e."""
    cut, regular = (setting.scenario(case, noise=noise).sensors[0].error for noise in ("cut", "regular"))
    slope = edge_slopes(cut)
    s, other = (1.6, 3.0) if case == "rss" else (3.5, 3.0)
    jump = np.exp(-2.0) / s / np.sqrt(2 * np.pi) / erf(np.sqrt(2))  # of cut noise at its end
    end = np.exp(-2.0) / other / np.sqrt(2 * np.pi) / erf(np.sqrt(2)) if case == "rss" else 1 / other
    assert slope == pytest.approx(2 * jump * end, rel=1e-6)
    for level in (1e6, 1e8):
        expected = slope / (2 * level)
        found, error = frequency(cut, ENDS[case], level)
        assert error < 0.02 * expected
        # the next term of p is of relative size t = level^-1/2, with a factor below 2 per metre or dB
        assert abs(found - expected) < SIGMAS * error + 2 * expected / np.sqrt(level)
        assert frequency(regular, ENDS[case], level)[0] == 0.0


@pytest.mark.slow
def test_fig3_has_every_way_and_says_which_is_a_bound(small):
    rows = list(csv.DictReader(outputs.fig3_csv(small).splitlines()))
    assert list(rows[0]) == ["case", "method", "time_s", "rmse_m", "stderr_m", "valid"]
    valid = {(r["case"], r["method"].partition(",")[0]): r["valid"] for r in rows}
    for case in ("rss", "toa", "fusion"):
        assert valid[case, "PCRLB as printed"] == "not a bound"
        assert valid[case, "Weiss-Weinstein"] == "conditional"
        assert {"EKF", "EKF as printed", "particle filter"} <= {m for c, m in valid if c == case}
    assert valid["toa, random tracks", "Weiss-Weinstein"] == "valid"
    at = {(r["case"], r["method"], float(r["time_s"])): float(r["rmse_m"]) for r in rows}
    model = setting.scenario("toa", noise="regular", steps=STEPS)
    bound = np.asarray(lb.ranging.distance_bcrb(model).position_mse)
    assert at["toa, random tracks", "PCRLB, noise not cut", 3.0] == pytest.approx(np.sqrt(bound[1:4].mean()), rel=1e-9)
    assert at["toa, random tracks", "Weiss-Weinstein", 3.0] < at["toa, random tracks", "PCRLB, noise not cut", 3.0]
    drift = list(csv.DictReader(outputs.drift_csv(small).splitlines()))
    assert {r["case"] for r in drift} == {"rss", "toa"}
    assert len({r["draws"] for r in drift}) == 4


def test_a_gain_is_that_of_paired_runs():
    rng = np.random.default_rng(0)
    one, two = (SimpleNamespace(diagnostics={"error_m": s * np.abs(rng.normal(size=(400, 9)))}) for s in (2.0, 1.8))
    value, error = gain(one, two)
    assert abs(value - 0.1) < SIGMAS * error
    assert gain(one, one) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("numbers", "which", "words"),
    [
        ({"growth": 0.5}, 0, "does not hold; both densities vanish linearly"),
        ({"growth": 0.0}, 0, 'Monte Carlo": holds'),
        ({"reached": 0.6}, 1, "lies above what filters reach"),
        ({"reached": 1.3}, 1, "lies below what filters reach on the cut noise here, but is no bound"),
        ({"reached": 0.98}, 1, "cannot be told from"),
        ({"fused": 0.5}, 2, "So it does here: fusion 0.50 ± 0.01 m"),
        ({"fused": 0.98}, 2, "It does not here"),
        ({"gain": (0.02, 0.003)}, 3, "does not hold of an EKF with matched moments (rss 2.0 ± 0.3 %"),
        ({"gain": (0.3, 0.03)}, 3, "some case: holds of an EKF"),
        ({"gain": (0.3, 0.1)}, 3, "not decided by so few runs of the one as printed"),
        ({"fused": 0.5}, 4, 'fusion": holds'),
        ({"fused": 1.2}, 4, 'fusion": does not hold'),
        ({"fused": 0.98, "error": 0.05}, 4, 'fusion": not decided'),
        ({"often": 0.5}, 5, "(1.00 to 0.50 m, fusion): over-confident"),
        ({"often": 1.0}, 5, "without effect"),
    ],
)
def test_remarks_follow_from_the_numbers(numbers, which, words):
    assert words in remarks(made_up(**numbers))[which]


def test_readings_change_the_numbers_as_their_closed_forms_say():
    """Signal strengths at a given distance: ten samples, with ten biases or with one."""
    found = {(s.case, s.bias, s.derivatives): s.rmse_m for s in settings(STEPS)}
    one, ten = (found["rss", bias, "initial"] for bias in ("one per second", "one per sample"))
    assert one > 1.5 * ten
    assert found["fusion", "one per sample", "every step"] < found["fusion", "one per sample", "initial"]
    d = setting.trajectory(STEPS)
    J = (25 / np.log(10) / d[1:]) ** 2 / (3.0**2 + 1.6**2 / 10)
    model = setting.scenario("rss", noise="regular", common=True, steps=STEPS)
    mse = lb.ranging.distance_bcrb(model, track=d, given=J).position_mse
    assert one == pytest.approx(float(accumulated(np.asarray(mse))[-1]), rel=1e-9)


@pytest.mark.slow
def test_measured_distances_have_bounds_and_estimators_side_by_side():
    rows = measured.compare(need("wifi_rtt_grid"))
    at = {(r.scene, r.measured, r.method): r for r in rows}
    for scene in ("lecture_theatre", "office"):
        for kind in ("rss", "toa", "fusion"):
            sample, block = (
                at[scene, kind, f"Cramér-Rao, bias {of}"].rmse_m for of in ("drawn per sample", "of the block")
            )
            assert sample < 0.3 * block
            assert at[scene, kind, "posterior mean, measured"].rmse_m > 3 * sample
        simple = at[scene, "toa", "mean range less offset"]
        assert at[scene, "toa", "posterior mean, measured"].rmse_m < simple.rmse_m + SIGMAS * simple.stderr_m
        assert simple.stderr_m > 0


def survey(folder, **changes):
    """Two points, one anchor, twelve samples at the first point and three at the second."""
    rng = np.random.default_rng(0)
    z = np.round(np.array([[5.0, -50.0]]) + rng.normal(size=(15, 2)), 3)
    lines = [f"hall,{0 if i < 12 else 7},{i},A,{r},{s},1" for i, (r, s) in enumerate(z)]
    files = {
        "anchors.csv": "scene,anchor_id,x_m,y_m\nhall,A,3.0,4.0",
        "points.csv": "scene,point_id,x_m,y_m,split\nhall,0,0.0,0.0,train\nhall,7,1.0,0.0,test",
        "samples.csv.gz": "\n".join(
            ["scene,point_id,sample,anchor_id,range_m,rssi_dbm,los", *lines, "hall,0,15,A,,-50,1"]
        ),
    } | {name.replace("_csv", ".csv").replace("_gz", ".gz"): text for name, text in changes.items()}
    for name, text in files.items():
        if text is not None:
            (folder / name).write_bytes(gzip.compress(text.encode()) if name.endswith(".gz") else text.encode())
    return z


def test_blocks_of_ten_samples_and_more_are_read_with_their_moments(tmp_path):
    z = survey(tmp_path)[:12]
    (scene, links), *more = measured.read(tmp_path).items()
    assert (scene, more, links.point.tolist(), links.train.tolist(), links.samples.tolist()) == (
        "hall", [], [0], [True], [12],
    )  # fmt: skip
    got = [links.distance_m, links.range_m, links.rssi, links.within_range, links.within_rssi]
    np.testing.assert_allclose(np.concatenate(got), [5.0, *z.mean(0), *z.var(0, ddof=1)], rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"anchors_csv": None}, "anchors.csv does not exist"),
        ({"points_csv": "scene,point_id,x_m,y_m\nhall,0,0.0,0.0"}, "points.csv has no column split"),
        ({"points_csv": "scene,point_id,x_m,y_m,split\nhall,0,here,0.0,train"}, 'line 2 .* column x_m, is "here"'),
        ({"points_csv": "scene,point_id,x_m,y_m,split\nhall,0,0.0,0.0,train"}, "no place of point 7 in hall"),
        ({"anchors_csv": "scene,anchor_id,x_m,y_m\nhall,B,3.0,4.0"}, "no place of anchor A in hall"),
    ],
)
def test_files_that_are_no_survey_are_named(tmp_path, changes, words):
    survey(tmp_path, **changes)
    with pytest.raises(lb.InputError, match=words):
        measured.read(tmp_path)


def test_a_posterior_mean_of_gaussian_laws_is_the_conjugate_one():
    fitted = measured.Fitted("toa", 0.0, 1.0, lb.Gaussian(0.5, 1.0), 2.0, "gaussian", 1.0)
    rng = np.random.default_rng(0)
    prior = np.sort(10.0 + 3.0 * rng.normal(size=4_000))
    z = np.array([7.0, 12.0])
    gain = 9.0 / (9.0 + 1.0 + 4.0 / 5)
    got = measured.posterior_mean((fitted,), (z,), prior, 5)
    np.testing.assert_allclose(got, 10.0 + gain * (z - 10.5), atol=0.15)


def run(*arguments):
    return CliRunner().invoke(app, ["paper", "prieto2011", *map(str, arguments)])


def test_the_command_writes_its_files_and_skips_data_that_are_missing(tmp_path, monkeypatch):
    monkeypatch.delenv("LOCBOUNDS_DATA", raising=False)
    monkeypatch.setenv("LOCBOUNDS_CACHE", "off")
    monkeypatch.setattr(sys.modules["locbounds.papers.prieto2011.study"], "study", lambda **options: made_up())
    done = run("--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    written = {p.name for p in (tmp_path / "out").iterdir()}
    assert written >= {
        "fig1.csv", "fig1.png", "fig2.csv", "fig2.png", "fig3.csv", "fig3.png", "as-printed.csv", "settings.csv",
    }  # fmt: skip
    assert "measured.csv" not in written
    assert "LOCBOUNDS_DATA" in done.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--samples", 1], "number of samples is 1"),
        (["--runs", 1], "--runs"),
        (["--data", "nowhere"], "no folder nowhere"),
    ],
)
def test_wrong_options_end_with_code_2_and_leave_nothing(tmp_path, monkeypatch, arguments, words):
    monkeypatch.setenv("LOCBOUNDS_CACHE", "off")
    monkeypatch.chdir(tmp_path)
    done = run(*arguments, "--out", "out")
    assert done.exit_code == 2, done.output
    assert words in done.stderr
    assert "\nremedy: " in done.stderr
    assert not (tmp_path / "out").exists()
