"""What every noise promises: density, sampler, score, information and moments belong to one law."""

from functools import partial

import jax
import numpy as np
import pytest
from scipy import integrate, stats

import locbounds as lb
from compiling import QUICKLY
from locbounds.precision import double_precision

NOISES = {
    "gaussian": lb.Gaussian(2.0, 3.0),
    "outliers": lb.GaussianMixture([0.85, 0.15], [0.5, 6.0], [1.0, 8.0]),
    "two peaks": lb.GaussianMixture([0.4, 0.6], [-10.0, 20.0], [1.0, 2.0]),
    "one component": lb.GaussianMixture([1.0], [2.0], [3.0]),
}
QUADRATURE = 1e-8
DRAWS, SIGMAS = 50_000, 4.0


@pytest.fixture(params=NOISES, scope="module")
def noise(request):
    return NOISES[request.param]


@double_precision
@partial(jax.jit, compiler_options=QUICKLY)
def log_density(noise, w):
    return noise.log_prob(w)


def density(noise, w):
    return np.exp(np.asarray(log_density(noise, np.asarray(w))))


def integral(noise, f):
    w = np.linspace(-120.0, 140.0, 40_001)  # trapezoidal: spectrally accurate for smooth laws that decay
    return integrate.trapezoid(f(w) * density(noise, w), w)


def test_density_moments_and_information_belong_together(noise):
    with jax.enable_x64(True):
        mean, variance, information = (float(v) for v in (noise.mean, noise.variance, noise.information()))
    assert integral(noise, np.ones_like) == pytest.approx(1, abs=QUADRATURE)
    assert integral(noise, lambda w: w) == pytest.approx(mean, abs=1e2 * QUADRATURE)
    assert integral(noise, lambda w: (w - mean) ** 2) == pytest.approx(variance, rel=QUADRATURE)
    step = 1e-4

    def score(w):  # central differences, no autodiff
        return -(np.log(density(noise, w + step)) - np.log(density(noise, w - step))) / (2 * step)

    def near(w):  # beyond 30 deviations the density underflows
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(density(noise, w) > 1e-250, score(w) ** 2, 0.0)

    assert integral(noise, near) == pytest.approx(information, rel=1e-6)  # error of the differences
    assert information * variance >= 1 - QUADRATURE  # Cramer-Rao


def test_score_is_minus_the_derivative_of_the_log_density(noise):
    w = np.linspace(-30.0, 40.0, 101)
    step = 1e-5
    expected = -(np.log(density(noise, w + step)) - np.log(density(noise, w - step))) / (2 * step)
    with jax.enable_x64(True):
        np.testing.assert_allclose(noise.score(w), expected, rtol=1e-5, atol=1e-6)


def test_draws_follow_the_density(noise):
    with jax.enable_x64(True):
        w = np.sort(np.asarray(noise.sample(jax.random.key(3), (DRAWS,))))
    grid = np.linspace(-120.0, 140.0, 40_001)
    cdf = integrate.cumulative_trapezoid(density(noise, grid), grid, initial=0.0)
    distance = np.abs(np.interp(w, grid, cdf) - (np.arange(DRAWS) + 0.5) / DRAWS).max()
    assert stats.kstwobign.sf(distance * np.sqrt(DRAWS)) > 2e-4


def test_components_are_the_law_itself(noise):
    with jax.enable_x64(True):
        weights, means, variances = (np.asarray(c) for c in noise.components())
    w = np.linspace(-30, 40, 57)
    mixture = (weights * stats.norm.pdf(w[:, None], means, np.sqrt(variances))).sum(1)
    np.testing.assert_allclose(density(noise, w), mixture, rtol=1e-9, atol=1e-300)
    assert noise.regularity().finite


@pytest.mark.parametrize(
    "build, match",
    [
        (lambda: lb.Gaussian(0.0, 0.0), "standard deviation is 0"),
        (lambda: lb.Gaussian(0.0, -1.0), "standard deviation is -1"),
        (lambda: lb.Gaussian(np.nan, 1.0), "mean is nan"),
        (lambda: lb.Gaussian(0.0, np.inf), "inf"),
        (lambda: lb.GaussianMixture([0.5, 0.4], [0, 0], [1, 1]), "weights"),
        (lambda: lb.GaussianMixture([1.5, -0.5], [0, 0], [1, 1]), "weights"),
        (lambda: lb.GaussianMixture([0.5, 0.5], [0, 0, 0], [1, 1]), "shapes"),
        (lambda: lb.GaussianMixture([0.5, 0.5], [0, 0], [1, 0]), "deviations"),
    ],
)
def test_numbers_that_are_no_law_are_input_errors(build, match):
    with pytest.raises(lb.InputError, match=match):
        build()
