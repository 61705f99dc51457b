"""Bhattacharyya coefficients and error probabilities between shifted copies, against closed forms and scipy."""

import jax
import numpy as np
import pytest
from scipy import integrate, stats

import locbounds as lb

H = np.array([0.0, 0.1, 1.0, 3.0, -2.0])
RELATIVE, ABSOLUTE = 1e-8, 1e-10


def gaussian(s):
    return np.exp(-s * (1 - s) * H**2 / (2 * 4.0))


def exponential(s):
    return np.exp(-np.where(H > 0, s * H, -(1 - s) * H) / 2.0)


COEFFICIENTS = {
    "gaussian": (lb.Gaussian(1.0, 2.0), gaussian),
    "exponential": (lb.Exponential(2.0, 1.0), exponential),
    "uniform": (lb.Uniform(0.0, 2.5), lambda s: np.maximum(1 - np.abs(H) / 2.5, 0.0)),
}
ERRORS = {
    "gaussian": (lb.Gaussian(1.0, 2.0), stats.norm.sf(np.abs(H) / 4.0)),
    "exponential": (lb.Exponential(2.0, 1.0), 0.5 * np.exp(-np.abs(H) / 2.0)),
    "uniform": (lb.Uniform(0.0, 2.5), 0.5 * np.maximum(1 - np.abs(H) / 2.5, 0.0)),
    "laplace": (lb.Laplace(1.0, 2.0), 0.5 * np.exp(-np.abs(H) / 4.0)),
    "cauchy": (lb.StudentT(1.0, 1.0, 1.0), 0.5 - np.arctan(np.abs(H) / 2) / np.pi),
    "triangle": (
        lb.Uniform(0.0, 1.0) + lb.Uniform(0.0, 1.0),
        0.5 * np.where(np.abs(H) < 2, (1 - np.abs(H) / 2) ** 2, 0.0),
    ),
}


@pytest.mark.parametrize("name", COEFFICIENTS)
@pytest.mark.parametrize("exponent", [0.5, 0.3])
def test_coefficients_have_their_closed_forms(name, exponent):
    noise, expected = COEFFICIENTS[name]
    got = lb.bhattacharyya(noise, H, exponent=exponent)
    np.testing.assert_allclose(got, expected(exponent), rtol=RELATIVE, atol=ABSOLUTE)


@pytest.mark.parametrize("name", ERRORS)
def test_error_probabilities_have_their_closed_forms(name):
    noise, expected = ERRORS[name]
    np.testing.assert_allclose(lb.minimum_error(noise, H), expected, rtol=RELATIVE, atol=ABSOLUTE)


def test_unequal_priors_of_gaussians():
    """Of N(0, 1) with probability q and N(h, 1): the test decides at h/2 + log(q/(1-q))/h."""
    q, h = 0.8, np.array([0.5, 2.0])
    threshold = h / 2 + np.log(q / (1 - q)) / h
    expected = q * stats.norm.sf(threshold) + (1 - q) * stats.norm.cdf(threshold - h)
    got = lb.minimum_error(lb.Gaussian(0.0, 1.0), h, probability=q)
    np.testing.assert_allclose(got, expected, rtol=RELATIVE)


def test_the_papers_density_whose_information_is_infinite():
    """Its coefficient leaves 1 like h^2 log(1/h); by scipy's adaptive quadrature of another formula for the density."""
    noise = lb.TruncatedGaussian(0.0, 3.5, -7.0, 7.0) + lb.Uniform(0.0, 3.0)

    def density(w):
        mass = 3.0 * (2 * stats.norm.cdf(2.0) - 1)
        return max(0.0, stats.norm.cdf(min(w, 7.0) / 3.5) - stats.norm.cdf(max(w - 3.0, -7.0) / 3.5)) / mass

    for h in (0.01, 1.0):
        points = [-7 + h, -4, -4 + h, 7, 7 + h]
        expected = integrate.quad(
            lambda w, h=h: np.sqrt(density(w) * density(w - h)), -7 + h, 10, points=points, limit=500
        )
        got = lb.bhattacharyya(noise, np.array([h]))
        assert got[0] == pytest.approx(expected[0], abs=1e-7 + 10 * expected[1])


def test_shapes_symmetry_and_order():
    noise = lb.ExponentiallyModifiedGaussian(0.0, 1.0, 3.0)
    h = np.array([[0.0, 0.5], [-0.5, 4.0]])
    rho, error = lb.bhattacharyya(noise, h), lb.minimum_error(noise, h)
    assert rho.shape == error.shape == (2, 2)
    assert rho[0, 0] == pytest.approx(1, abs=1e-10)
    assert error[0, 0] == pytest.approx(0.5, abs=1e-10)
    assert rho[0, 1] == pytest.approx(rho[1, 0], rel=1e-9)
    assert np.all(error <= 0.5 * rho + 1e-12)  # Bhattacharyya's bound
    assert np.all(error >= 0.5 * (1 - np.sqrt(1 - np.minimum(rho, 1) ** 2)) - 1e-12)
    curvature = 8 * (1 - lb.bhattacharyya(noise, np.array(1e-2))) / 1e-4  # tends to the information as h falls
    with jax.enable_x64(True):
        assert curvature == pytest.approx(float(noise.information()), rel=1e-3)


@pytest.mark.parametrize("exponent", [0.0, 1.0, np.nan])
def test_what_makes_no_sense_is_an_input_error(exponent):
    with pytest.raises(lb.InputError, match="exponent"):
        lb.bhattacharyya(lb.Gaussian(0.0, 1.0), H, exponent=exponent)
    with pytest.raises(lb.InputError, match="probability"):
        lb.minimum_error(lb.Gaussian(0.0, 1.0), H, probability=exponent)
    with pytest.raises(lb.InputError, match="not finite"):
        lb.minimum_error(lb.Gaussian(0.0, 1.0), np.array([np.nan]))
