"""Fit quality: white where the model is true, not white where errors drift; numbers against SciPy and NumPy."""

import numpy as np
import pytest
from scipy.stats import kstest, norm

from fit.simulated import errors
from locbounds.fit import RangeLog, Track, fit_quality, fit_sight_noise, quality_figure
from locbounds.fit.quality import _statement, autocorrelation, smooth_errors


def log_of(time, error):
    """A log of a mobile that stands still, two links: sequences 2 i and 2 i + 1 make track i."""
    anchors = np.array([[3.0, 4.0], [-6.0, 8.0]])
    tracks = []
    for i in range(0, len(time), 2):
        z = error[i : i + 2].T + [5.0, 10.0]
        t = np.r_[time[i, 0] - 1, time[i]]
        tracks.append(Track(f"t{i // 2}", t, z, np.zeros((len(t), 2))))
    return RangeLog(("a", "b"), anchors, tuple(tracks))


@pytest.fixture(scope="module")
def fitted():
    time, error, sight = errors(7, sequences=12, steps=300)
    time[1::2] = time[::2]  # both links of a track report at the same times; what that does to the dwell is fitted
    log = log_of(time, error)
    e = log.errors()
    return log, fit_sight_noise(e.time_s, e.error_m, groups=e.track), sight


def test_residuals_of_a_true_model_are_white_and_standard_normal(fitted):
    log, fit, _ = fitted
    score = smooth_errors(fit, log.errors()).score
    score = score[np.isfinite(score)]
    n = len(score)
    assert abs(score.mean()) < 4 / np.sqrt(n)
    assert abs(score.std() - 1) < 4 / np.sqrt(2 * n)
    quality = fit_quality(log, fit)
    assert max(map(abs, quality.residual_autocorrelation[:4])) < 4 / np.sqrt(0.8 * n)
    assert "nearly white" in quality.statement
    assert quality.correlation_time == 1
    assert max(link.ks for link in quality.links) < 0.1


def test_posterior_finds_the_sights(fitted):
    log, fit, sight = fitted
    nlos = smooth_errors(fit, log.errors()).nlos
    seen = np.isfinite(log.errors().error_m)
    assert np.mean((nlos > 0.5)[seen] == sight[seen]) > 0.95  # the laws are 2.1 m apart, 0.3 and 1 m wide
    assert abs(nlos[seen].mean() - sight[seen].mean()) < 0.02


def test_numbers_of_a_link(fitted):
    log, fit, _ = fitted
    link = fit_quality(log, fit).links[1]
    e = log.errors().error_m[log.errors().link == 1]
    e = e[np.isfinite(e)]

    def cdf(x):
        shares = 1 - fit.nlos_share, fit.nlos_share
        return sum(p * w * norm.cdf(x, m, s) for r, p in enumerate(shares) for w, m, s in zip(*fit.law(r), strict=True))

    assert link.ks == pytest.approx(kstest(e, cdf).statistic, abs=1e-12)
    assert (link.ranges, link.mean_m, link.std_m) == (len(e), pytest.approx(e.mean()), pytest.approx(e.std()))
    np.testing.assert_allclose(cdf(np.array(link.fitted_quantiles_m)), (0.05, 0.25, 0.5, 0.75, 0.95), atol=2e-3)
    draws = np.random.default_rng(0).choice(2, size=200_000, p=[1 - fit.nlos_share, fit.nlos_share])
    mean = np.array([fit.law(r)[0] @ fit.law(r)[1] for r in (0, 1)])[draws].mean()
    assert link.fitted_mean_m == pytest.approx(mean, abs=0.02)


def test_drifting_errors_are_reported():
    time, error, _ = errors(8, sequences=12, steps=300, outliers=False, missing=0.0)
    time[1::2] = time[::2]
    rng = np.random.default_rng(0)
    drift = np.zeros(error.shape)
    for k in range(1, 300):
        drift[:, k] = 0.98 * drift[:, k - 1] + 0.1 * rng.normal(size=12)
    log = log_of(time, error + drift)
    e = log.errors()
    quality = fit_quality(log, fit_sight_noise(e.time_s, e.error_m, outliers=False))
    assert quality.residual_autocorrelation[0] > 0.3
    assert "not white" in quality.statement
    assert "optimistic" in quality.statement
    assert quality.correlation_time > 5


def test_autocorrelation_is_that_of_numpy_and_skips_gaps():
    x = np.random.default_rng(0).normal(size=(1, 500)).cumsum(1)
    x -= x.mean()
    expected = [x[0, k:] @ x[0, :-k] / np.sqrt((x[0, k:] @ x[0, k:]) * (x[0, :-k] @ x[0, :-k])) for k in (1, 3)]
    assert autocorrelation(x, (1, 3)) == pytest.approx(expected)
    x[0, 100:200] = np.nan
    both = np.isfinite(x[0, 1:]) & np.isfinite(x[0, :-1])
    later, earlier = x[0, 1:][both], x[0, :-1][both]
    expected = later @ earlier / np.sqrt((later @ later) * (earlier @ earlier))
    assert autocorrelation(x, (1, 600)) == pytest.approx((expected, np.nan), nan_ok=True)


def test_autocorrelation_stays_between_minus_one_and_one_however_few_pairs_there_are():
    rng = np.random.default_rng(1)
    for _ in range(50):
        x = rng.standard_cauchy(size=(3, 12))
        x[rng.random(x.shape) < 0.7] = np.nan  # one pair or none at most lags
        found = np.array(autocorrelation(x, tuple(range(1, 12))))
        assert np.all(np.isnan(found) | (np.abs(found) <= 1))
    assert np.isnan(autocorrelation(np.zeros((1, 5)), (1,)))[0]


def test_statements_count_ranges_in_words_that_make_sense():
    assert "about 1.2 successive ranges" in _statement(0.08, 1.16)
    assert "about 23 successive ranges" in _statement(0.9, 23.4)
    assert "Too few" in _statement(float("nan"), 1.0)


def test_figure_has_a_panel_per_link(fitted, tmp_path):
    log, fit, _ = fitted
    figure = quality_figure(log, fit)
    assert len(figure.axes) == 3
    figure.savefig(tmp_path / "quality.png")
