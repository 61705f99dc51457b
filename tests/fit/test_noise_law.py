"""Laws of range errors: maximum likelihood against scipy's and closed forms; the truth wins; measured data."""

import gzip

import numpy as np
import pytest
from scipy import stats

import locbounds as lb
from datasets import need
from locbounds.fit import compare_noise_laws, fit_noise_law
from locbounds.fit.one_sided import ONE_SIDED, ContradictedError

REFERENCE = {  # scipy's fit of the same law to the same numbers
    "student-t": (stats.t(4.0, 1.0, 2.0), stats.t),
    "exponentially-modified-gaussian": (stats.exponnorm(3.0, 0.0, 1.0), stats.exponnorm),
    "gaussian": (stats.norm(1.0, 2.0), stats.norm),
    "laplace": (stats.laplace(1.0, 2.0), stats.laplace),
}


@pytest.mark.parametrize("family", REFERENCE)
def test_the_maximum_is_that_of_scipy(family):
    law, oracle = REFERENCE[family]
    e = law.rvs(2000, random_state=np.random.default_rng(3))
    found = fit_noise_law(e, family)
    best = oracle.logpdf(e, *oracle.fit(e)).sum()
    assert found.log_likelihood >= best - 1e-3  # scipy's search stops where it likes
    assert found.log_likelihood == pytest.approx(best, abs=0.05)


def test_gamma_with_a_known_start_is_that_of_scipy():
    e = stats.gamma(2.5, 1.0, 2.0).rvs(2000, random_state=np.random.default_rng(4))
    shape, _, scale = stats.gamma.fit(e, floc=1.0)
    noise = fit_noise_law(e, "gamma", start_m=1.0).noise
    assert (float(noise.shape), float(noise.scale)) == pytest.approx((shape, scale), rel=1e-3)


def test_limits_are_the_extremes():
    e = np.random.default_rng(5).uniform(-1.0, 3.0, 500)
    for family in ("uniform", "truncated-gaussian"):
        noise = fit_noise_law(e, family).noise
        assert (float(noise.low), float(noise.high)) == pytest.approx((e.min(), e.max()), abs=1e-12)


def test_a_mixture_finds_its_parts():
    truth = lb.GaussianMixture([0.8, 0.2], [0.0, 5.0], [1.0, 2.0])
    rng = np.random.default_rng(6)
    e = np.where(rng.random(4000) < 0.8, rng.normal(0, 1, 4000), rng.normal(5, 2, 4000))
    noise = fit_noise_law(e, "gaussian-mixture").noise
    order = np.argsort(noise.means)
    np.testing.assert_allclose(noise.weights[order], truth.weights, atol=0.05)
    np.testing.assert_allclose(noise.means[order], truth.means, atol=0.4)


def test_the_true_family_wins_and_contradicted_ones_are_last_with_the_reason():
    rng = np.random.default_rng(7)
    e = rng.normal(0, 1, 6000) + rng.exponential(3, 6000)
    families = ("gaussian", "exponentially-modified-gaussian", "uniform", *ONE_SIDED)
    rows = compare_noise_laws(e[:4000], e[4000:], groups=np.arange(2000) // 20, families=families, start_m=0.0)
    by_name = {row.family: row for row in rows}
    assert rows[0].family == "exponentially-modified-gaussian"
    assert rows[0].behind == 0
    assert by_name["gaussian"].behind > 4 * by_name["gaussian"].behind_stderr > 0
    assert {row.family for row in rows[-3:]} == set(ONE_SIDED)
    assert "of the errors are at or below 0 m" in by_name["gamma"].note
    assert by_name["uniform"].regularity == "irregular"
    assert rows[0].ks < 1.63 / np.sqrt(2000)  # the 1 % point of Kolmogorov's statistic


def test_errors_outside_a_fitted_support_are_impossible():
    rows = compare_noise_laws(np.linspace(0, 1, 50), np.array([0.5, 2.0]), families=("uniform",))
    assert (rows[0].impossible, rows[0].held_out) == (1, -np.inf)
    assert "impossible held out: 1" in rows[0].note


@pytest.mark.parametrize(
    "e, family, match",
    [
        (np.arange(30.0), "gama", "unknown noise family 'gama'"),
        (np.arange(5.0), "gaussian", "5 errors"),
        (np.ones(30), "gaussian", "all range errors are equal"),
        (np.arange(30.0), "gamma", "at or below 0 m"),
    ],
)
def test_bad_input(e, family, match):
    with pytest.raises(lb.InputError, match=match):
        fit_noise_law(e, family, start_m=0.0)


@pytest.mark.parametrize("family", ["gamma", "log-normal"])
def test_a_fitted_start_is_the_maximum_of_scipys_profile(family):
    """Against scipy's fits with a fixed start, on a fine grid of starts; the truth is within the errors' resolution."""
    law, oracle = {
        "gamma": (stats.gamma(3.0, -2.0, 1.5), stats.gamma),
        "log-normal": (stats.lognorm(0.6, -2.0, 3.0), stats.lognorm),
    }[family]
    e = law.rvs(800, random_state=np.random.default_rng(8))
    found = fit_noise_law(e, family)
    starts = e.min() - np.geomspace(0.02, 2.0, 41)
    best = max(oracle.logpdf(e, *oracle.fit(e, floc=start)).sum() for start in starts)
    assert best - 1e-3 <= found.log_likelihood <= best + 0.2
    assert found.parameters == 3
    assert float(found.noise.start) == pytest.approx(-2.0, abs=0.5)


def test_a_start_that_the_errors_do_not_single_out_is_said():
    rng = np.random.default_rng(9)
    e = rng.normal(0.0, 1.0, 500)
    noise = fit_noise_law(e, "exponential").noise
    assert (float(noise.start), float(noise.scale)) == pytest.approx((e.min(), e.mean() - e.min()), rel=1e-12)
    with pytest.raises(ContradictedError, match="goes to minus infinity") as error:
        fit_noise_law(-np.exp(0.5 * e), "gamma")  # skewed to the left
    assert "start_m" in error.value.remedy
    with pytest.raises(ContradictedError, match="goes to the smallest error"):
        fit_noise_law(rng.gamma(0.3, 1.0, 500), "gamma")


@pytest.fixture(scope="module")
def office():
    import pandas as pd

    folder = need("wifi_rtt_grid")
    with gzip.open(folder / "samples.csv.gz") as file:
        samples = pd.read_csv(file)
    keys = ["scene", "point_id"]
    anchors = pd.read_csv(folder / "anchors.csv").rename(columns={"x_m": "ax", "y_m": "ay"})
    table = samples.merge(pd.read_csv(folder / "points.csv"), on=keys).merge(anchors, on=["scene", "anchor_id"])
    table = table[(table.scene == "office") & table.range_m.notna() & (table["sample"] % 2 == 0)]
    return table.assign(error=table.range_m - np.hypot(table.x_m - table.ax, table.y_m - table.ay))


FEW = ("gaussian", "student-t", "laplace", "exponentially-modified-gaussian", "uniform")


@pytest.mark.parametrize("los", [1, 0])
def test_measured_grid_errors_have_a_winner(office, los):
    """The survey's own split: the test points were not fitted to; points are the groups of dependent errors."""
    part = office[office.los == los]
    fit, held = (part[part.split == name].sample(400, random_state=1) for name in ("train", "test"))
    rows = compare_noise_laws(fit.error, held.error, groups=held.point_id, families=FEW)
    by_name = {row.family: row for row in rows}
    assert rows[0].regularity == "regular"
    assert by_name["uniform"].regularity == "irregular"
    assert rows[0].ks < by_name["uniform"].ks
    assert by_name["gaussian"].behind >= 0
    assert by_name["gaussian"].behind_stderr > 0 or rows[0].family == "gaussian"


@pytest.mark.slow
def test_measured_walks_have_a_skewed_winner():
    from locbounds.io.logs import read_log

    folder = need("wifi_rtt_walks")
    files = {name: folder / f"{name}.csv" for name in ("anchors",)} | {"truth": folder / "truth.csv.gz"}
    kept, held = read_log(folder / "ranges.csv.gz", select="scene=canteen", **files).hold_out(4)
    groups = np.broadcast_to(held.errors().track[:, None], held.errors().error_m.shape)
    rows = compare_noise_laws(kept.errors().error_m, held.errors().error_m, groups=groups)
    by_name = {row.family: row for row in rows}
    assert rows[0].family == "exponentially-modified-gaussian"
    assert by_name["gaussian"].behind > 4 * by_name["gaussian"].behind_stderr
    assert {by_name[family].impossible for family in ONE_SIDED} != {0}  # one held-out error is 8 m below all others
