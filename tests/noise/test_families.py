"""Every family: density, distribution function, quantiles, score, draws, moments and information are one law's.

References: scipy.stats for the families it has; a mixture by hand; sums against the convolution of scipy's densities.
"""

from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate, stats

import locbounds as lb
from compiling import QUICKLY
from locbounds.noise import Convolution
from locbounds.precision import double_precision

LAWS = {
    "truncated gaussian": (lb.TruncatedGaussian(0.5, 2.0, -1.0, 4.0), stats.truncnorm(-0.75, 1.75, 0.5, 2.0)),
    "half gaussian, tail": (lb.TruncatedGaussian(0.0, 1.0, 6.0), stats.truncnorm(6.0, np.inf)),
    "uniform": (lb.Uniform(-1.0, 3.0), stats.uniform(-1.0, 4.0)),
    "exponential": (lb.Exponential(2.0, 1.0), stats.expon(1.0, 2.0)),
    "modified": (lb.ExponentiallyModifiedGaussian(1.0, 0.5, 3.0), stats.exponnorm(6.0, 1.0, 0.5)),
    "student": (lb.StudentT(4.5, 1.0, 2.0), stats.t(4.5, 1.0, 2.0)),
    "laplace": (lb.Laplace(1.0, 2.0), stats.laplace(1.0, 2.0)),
    "gamma": (lb.Gamma(3.5, 2.0, -1.0), stats.gamma(3.5, -1.0, 2.0)),
    "steep gamma": (lb.Gamma(0.6, 2.0), stats.gamma(0.6, 0.0, 2.0)),
    "log-normal": (lb.LogNormal(2.0, 0.7, 1.0), stats.lognorm(0.7, 1.0, 2.0)),
    "sum of uniforms": (lb.Uniform(0.0, 1.0) + lb.Uniform(-1.0, 2.0), stats.trapezoid(0.25, 0.75, -1.0, 4.0)),
    "sum of gaussians": (lb.Gaussian(1.0, 3.0) + lb.Gaussian(-2.0, 4.0), stats.norm(-1.0, 5.0)),
    "sum of gammas": (lb.Gamma(1.5, 2.0) + lb.Gamma(1.2, 2.0), stats.gamma(2.7, 0.0, 2.0)),
    "sum of halves": (lb.Gamma(0.5, 1.0) + lb.Gamma(0.7, 1.0), stats.gamma(1.2)),
    "erlang": (lb.Exponential(2.0, 1.0) + lb.Exponential(2.0), stats.gamma(2.0, 1.0, 2.0)),
}
CLOSED, TABLE = 2e-12, 1e-9  # relative, of densities; tables also of their own stated error
PROBABILITIES = np.array([1e-6, 1e-3, 0.02, 0.2, 0.45, 0.8, 0.98, 0.999, 1 - 1e-6])
DRAWS, SIGNIFICANCE = 4000, 1e-5  # fifteen laws: a false alarm in fewer than 1 of 1,000 seeds


@partial(jax.jit, compiler_options=QUICKLY)
def _everything(noise, w, key):
    draws = noise.sample(key, (DRAWS,))
    return {
        "log_prob": noise.log_prob(w),
        "cdf": noise.cdf(w),
        "score": noise.score(w),
        "draws": draws,
        "levels": noise.cdf(draws),
        "quantile": noise.quantile(PROBABILITIES[1:-1]),
        "mean": noise.mean,
        "variance": noise.variance,
        "mass": noise.expect(lambda w: 1.0 + 0 * w),
        "information": noise.information(),
    }


@cache
def everything(name):
    noise, reference = LAWS[name]
    with jax.enable_x64(True):
        return jax.tree.map(np.asarray, _everything(noise, reference.ppf(PROBABILITIES), jax.random.key(7)))


SLOW = pytest.mark.slow
LONG = ("sum of halves", "sum of gammas", "erlang")  # further convolutions, whose compilation takes long


@pytest.fixture(params=[pytest.param(n, marks=SLOW) if n in LONG else n for n in LAWS], scope="module")
def name(request):
    return request.param


def test_density_distribution_and_quantiles_are_those_of_scipy(name):
    noise, reference = LAWS[name]
    w, got = reference.ppf(PROBABILITIES), everything(name)
    tolerance = TABLE if isinstance(noise, Convolution) else 1e-9 if "tail" in name else CLOSED
    np.testing.assert_allclose(got["log_prob"], reference.logpdf(w), rtol=tolerance, atol=10 * tolerance)
    np.testing.assert_allclose(got["cdf"], PROBABILITIES, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(got["quantile"], w[1:-1], rtol=1e-6, atol=1e-7)
    assert got["mass"] == pytest.approx(1, abs=1e-9)


def test_moments_are_those_of_scipy(name):
    _, reference = LAWS[name]
    assert everything(name)["mean"] == pytest.approx(reference.mean(), rel=1e-8, abs=1e-9)
    assert everything(name)["variance"] == pytest.approx(reference.var(), rel=1e-8)


def test_draws_follow_the_distribution_function(name):
    assert stats.kstest(everything(name)["levels"], "uniform").pvalue > SIGNIFICANCE


def test_score_is_that_of_differences(name):
    _, reference = LAWS[name]
    got = everything(name)
    w = reference.ppf(PROBABILITIES[2:-2])
    step = 1e-6 * reference.std()
    expected = -(reference.logpdf(w + step) - reference.logpdf(w - step)) / (2 * step)
    np.testing.assert_allclose(got["score"][2:-2], expected, rtol=1e-5, atol=1e-6)


INFORMATION = {"gamma": 1 / (4.0 * 1.5), "student": 5.5 / 7.5 / 4.0, "laplace": 0.25, "sum of gaussians": 1 / 25.0}
INFORMATION["log-normal"] = np.exp(2 * 0.49) * (1 + 1 / 0.49) / 4.0
INFORMATION["sum of gammas"] = 1 / (4.0 * 0.7)


@pytest.mark.parametrize("name", [pytest.param(n, marks=SLOW) if n in LONG else n for n in INFORMATION])
def test_information_has_its_closed_form(name):
    """Textbook values; the convolution of two gamma laws of one scale is a gamma law, with an edge like t^1.7."""
    assert everything(name)["information"] == pytest.approx(INFORMATION[name], rel=1e-6)


def test_information_of_the_modified_gaussian_is_that_of_quadrature():
    _, reference = LAWS["modified"]

    def integrand(w, step=1e-4):
        score = (reference.logpdf(w + step) - reference.logpdf(w - step)) / (2 * step)
        return score**2 * reference.pdf(w)

    expected = integrate.quad(integrand, -1.5, 60.0, points=[0.0, 1.0, 2.0, 5.0], limit=200)[0]
    assert everything("modified")["information"] == pytest.approx(expected, rel=1e-5)  # error of the differences


def test_a_mixture_is_its_parts_weighted():
    parts = [lb.Laplace(0.0, 1.0), lb.Uniform(2.0, 3.0)]
    noise = lb.Mixture([0.3, 0.7], parts)
    reference = [stats.laplace(0.0, 1.0), stats.uniform(2.0, 1.0)]
    w = np.array([-3.0, 0.5, 2.0 + 1e-9, 2.5, 9.0])

    @double_precision
    @partial(jax.jit, compiler_options=QUICKLY)
    def everything(noise, w, key):
        draws = noise.sample(key, (DRAWS,))
        moments = noise.components(), noise.mean, noise.variance
        return jnp.exp(noise.log_prob(w)), noise.cdf(w), noise.score(w), noise.cdf(draws), moments

    density, cdf, score, draws, moments = jax.tree.map(np.asarray, everything(noise, w, jax.random.key(1)))
    (weights, means, variances), mean, variance = moments
    expected = [0.3 * reference[0].pdf(w), 0.7 * reference[1].pdf(w)]
    np.testing.assert_allclose(density, sum(expected), rtol=CLOSED)
    np.testing.assert_allclose(cdf, 0.3 * reference[0].cdf(w) + 0.7 * reference[1].cdf(w), rtol=CLOSED)
    np.testing.assert_allclose(score, np.sign(w) * expected[0] / sum(expected), rtol=CLOSED)
    assert stats.kstest(draws, "uniform").pvalue > SIGNIFICANCE
    np.testing.assert_allclose([weights, means, variances], [[0.3, 0.7], [0.0, 2.5], [2.0, 1 / 12]])
    assert mean == pytest.approx(weights @ means)
    assert variance == pytest.approx(weights @ (variances + means**2) - (weights @ means) ** 2)


def test_sums_of_mixtures_are_mixtures_of_sums():
    noise = lb.GaussianMixture([0.9, 0.1], [0.0, 5.0], [1.0, 2.0]) + lb.Exponential(3.0)
    assert [type(part) for part in noise.parts] == [lb.ExponentiallyModifiedGaussian] * 2
    gaussian = lb.GaussianMixture([0.9, 0.1], [0.0, 5.0], [1.0, 2.0]) + lb.Gaussian(1.0, 2.0)
    np.testing.assert_allclose(gaussian.means, [1.0, 6.0])
    np.testing.assert_allclose(gaussian.stds, np.sqrt([5.0, 8.0]))


def test_filters_see_moments_or_quartiles():
    components = double_precision(jax.jit(lambda noise: noise.components(), compiler_options=QUICKLY))
    for noise, mean, var in ((lb.Exponential(3.0), 3.0, 9.0), (lb.Laplace(1.0, 2.0), 1.0, 8.0)):
        assert [float(x[0]) for x in components(noise)] == pytest.approx([1.0, mean, var], rel=1e-12)
    assert [float(x[0]) for x in components(lb.StudentT(5.0, 0.0, 2.0))] == pytest.approx([1.0, 0.0, 4.0 * 5 / 3])
    _, _, variance = components(lb.StudentT(1.0, 0.0, 2.0))  # Cauchy: no variance
    assert np.sqrt(variance[0]) == pytest.approx(stats.cauchy.ppf(0.75, 0, 2.0) / stats.norm.ppf(0.75), rel=1e-9)


@pytest.mark.parametrize(
    "build, match",
    [
        (lambda: lb.TruncatedGaussian(0.0, -1.0, 0.0, 1.0), "standard deviation is -1"),
        (lambda: lb.TruncatedGaussian(0.0, 1.0, 2.0, 2.0), "truncation limits are 2.0 and 2.0"),
        (lambda: lb.TruncatedGaussian(0.0, 1.0, 50.0, 51.0), "leave no mass"),
        (lambda: lb.TruncatedGaussian(np.zeros(2), 1.0), r"center has shape \(2,\)"),
        (lambda: lb.Uniform(3.0, 3.0), "uniform noise from 3.0 to 3.0"),
        (lambda: lb.Uniform(0.0, np.inf), "high is inf"),
        (lambda: lb.Exponential(0.0), "scale is 0"),
        (lambda: lb.ExponentiallyModifiedGaussian(0.0, 0.0, 1.0), "standard deviation is 0"),
        (lambda: lb.StudentT(0.0, 0.0, 1.0), "degrees of freedom is 0"),
        (lambda: lb.Laplace(0.0, np.nan), "scale is nan"),
        (lambda: lb.Gamma([1.0, 2.0], 1.0), r"shape has shape \(2,\)"),
        (lambda: lb.LogNormal(-1.0, 1.0), "median is -1"),
        (lambda: lb.Mixture([0.5, 0.6], [lb.Laplace(0, 1), lb.Laplace(0, 2)]), "weights"),
        (lambda: lb.Mixture([1.0], [lb.Laplace(0, 1), lb.Laplace(0, 2)]), "weights of shape"),
        (lambda: lb.Gaussian(0.0, 1.0) + 3.0, "cannot add 3.0"),
    ],
)
def test_numbers_that_are_no_law_are_input_errors(build, match):
    with pytest.raises(lb.InputError, match=match):
        build()


def test_the_modified_gaussian_far_below_its_mean():
    """A wide sibling mode draws there: no place may be impossible (a function of JAX underflows in a narrow window)."""
    noise, w = lb.ExponentiallyModifiedGaussian(0.0, 1.0, 1.0), np.linspace(-45.0, -15.0, 3001)
    with jax.enable_x64(True):
        log_prob, score = noise.log_prob(w), noise.score(w)
    np.testing.assert_allclose(log_prob, stats.exponnorm(1.0).logpdf(w), rtol=2e-12)
    h = 1e-4
    slope = (stats.exponnorm(1.0).logpdf(w + h) - stats.exponnorm(1.0).logpdf(w - h)) / (2 * h)
    np.testing.assert_allclose(score, -slope, rtol=1e-7)
