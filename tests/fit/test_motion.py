"""Motion and prior against a joint Gaussian density, and against their own standard errors."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from locbounds.errors import InputError
from locbounds.fit import fit_psd, prior_from_tracks
from locbounds.fit.motion import _log_likelihood


def walk(seed, *, n, psd, jitter, dim=2):
    """Irregular times and positions of integrated white acceleration, by its exact covariance per step."""
    rng = np.random.default_rng(seed)
    dt = rng.uniform(0.2, 1.5, n - 1)
    x, v, track = np.zeros(dim), rng.normal(size=dim), [np.zeros(dim)]
    for d in dt:
        step = rng.multivariate_normal([0, 0], psd * np.array([[d**3 / 3, d**2 / 2], [d**2 / 2, d]]), size=dim)
        x, v = x + d * v + step[:, 0], v + step[:, 1]
        track.append(x)
    return np.r_[0, np.cumsum(dt)], np.array(track) + jitter * rng.normal(size=(n, dim))


def test_likelihood_is_the_joint_gaussian_density():
    """Cov(x(s), x(t)) of twice integrated white noise is q (s^2 t / 2 - s^3 / 6), s <= t; flat start: a wide one."""
    q, r = 0.3, 0.2
    t, x = walk(0, n=6, psd=q, jitter=r)
    low, high = np.minimum.outer(t, t), np.maximum.outer(t, t)
    wide = 1e5
    cov = q * (low**2 * high / 2 - low**3 / 6) + r**2 * np.eye(6) + wide * (1 + np.outer(t, t))
    both = sum(multivariate_normal(np.zeros(6), cov).logpdf(c) for c in x.T)
    first = sum(multivariate_normal(np.zeros(2), cov[:2, :2]).logpdf(c[:2]) for c in x.T)
    with jax.enable_x64(True):
        ours = float(_log_likelihood(jnp.log(jnp.array([q, r**2])), jnp.asarray(t), jnp.asarray(x)))
    assert ours == pytest.approx(both - first, abs=1e-3)  # what is left of the wide start: 1 / wide


@pytest.mark.parametrize("given", [True, False])
def test_recovers_intensity_and_jitter_within_standard_errors(given):
    psd, jitter = 0.05, 0.1
    tracks = [walk(10 + i, n=300 - 5 * i, psd=psd, jitter=jitter) for i in range(12)]
    fit = fit_psd(*zip(*tracks, strict=True), truth_std_m=jitter if given else None)
    assert abs(fit.psd_m2_s3 - psd) < 4 * fit.stderr
    assert fit.stderr < 0.1 * psd
    if given:
        assert fit.truth_std_m == pytest.approx(jitter)
    else:
        assert abs(fit.truth_std_m - jitter) < 4 * fit.truth_std_stderr
    assert (fit.tracks, fit.notes) == (12, ())


def test_exact_truth():
    tracks = [walk(40 + i, n=300 - 5 * i, psd=2.0, jitter=0.0) for i in range(12)]
    fit = fit_psd(*zip(*tracks, strict=True), truth_std_m=0.0)
    assert abs(fit.psd_m2_s3 - 2.0) < 4 * fit.stderr


def test_interpolated_truth_is_reported():
    t = np.arange(0, 300, 0.5)
    corners = np.array([[0, 0], [10, 0], [10, 10], [0, 10], [0, 20]], float)
    x = np.stack([np.interp(t, np.arange(5) * 75.0, c) for c in corners.T], axis=1)
    fit = fit_psd([t], [x])
    assert "interpolated" in fit.notes[0]
    assert np.isnan(fit.stderr)


@pytest.mark.parametrize("positions", [np.zeros((10, 2)), np.arange(10.0)[:, None] * [1.0, 2.0], np.zeros((2, 2))])
def test_truth_without_manoeuvres_asks_for_the_intensity(positions):
    with pytest.raises(InputError, match=r"motion\.psd_m2_s3 cannot be estimated"):
        fit_psd([np.arange(len(positions)) * 1.0], [positions])


def test_area_prior_weighs_time_and_start_prior_takes_first_positions():
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    tracks = [np.outer(t, [1.0, 0.0]) + [0, k] for k in (0.0, 3.0, 6.0)]
    mean, cov = prior_from_tracks([t] * 3, tracks)
    np.testing.assert_allclose(mean, [2, 3, 1, 0], atol=1e-12)
    np.testing.assert_allclose(np.diag(cov), [2, 6, 0, 0], atol=1e-5)
    mean, cov = prior_from_tracks([t] * 3, tracks, where="start")
    np.testing.assert_allclose(mean[:2], [0, 3], atol=1e-12)
    np.testing.assert_allclose(np.diag(cov)[:2], [0, 9], atol=1e-4)  # sample variance of 0, 3, 6
    assert np.linalg.eigvalsh(cov).min() > 0
    with pytest.raises(InputError, match="start"):
        prior_from_tracks([t], tracks[:1], where="start")
    with pytest.raises(InputError, match="prior is"):
        prior_from_tracks([t], tracks[:1], where="corner")
