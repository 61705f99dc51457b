"""Limits that are known in closed form."""

import numpy as np
import pytest
from scipy.special import gammainc
from scipy.stats import norm

import locbounds as lb
from locbounds.static import support as supports
from locbounds.static.overlap import Rule, legendre
from locbounds.static.pair_laws import GaussianPairs, gaussian_error
from locbounds.static.weiss_weinstein_kernel import bound_matrices, grams, printed, with_exponent
from locbounds.static.weiss_weinstein_search import equal_lengths
from locbounds.static.ziv_zakai_kernel import along

EXACT = 1e-6
TABULATED = 1e-4  # coefficients of noises between the nodes of their tables
NOTHING = GaussianPairs.of(lambda p: np.zeros((len(p), 1)), np.eye(1))
X = np.array([1.0])


def wwb_of(support, law, H, form=grams, n=24):
    return bound_matrices(H, form(support, law, [H], n, [1.0])[0])[0]


@pytest.mark.parametrize("share", [1 / 3, 2 / 3])
def test_without_data_both_lengths_of_a_uniform_law_give_the_same(share):
    L = 3.0
    assert wwb_of(supports.box([0.0], [L]), NOTHING, np.array([[share * L]])) == pytest.approx(2 * L**2 / 27, rel=EXACT)


def test_the_search_finds_the_larger_of_several_maxima():
    best, swept = equal_lengths(supports.box([0.0], [3.0]), NOTHING, [1.0])
    assert np.trace(best[0].matrix) == pytest.approx(2 * 9 / 27, rel=EXACT)
    row = swept.mse_m2[0]
    middle = (swept.lengths_m > 1.3) & (swept.lengths_m < 1.7)
    assert row[middle].max() < 0.99 * row.max()


def linear():
    rng = np.random.default_rng(0)
    A, C, P = rng.normal(size=(3, 2)), np.diag([1.0, 2.0, 0.5]), np.array([[4.0, 1.0], [1.0, 2.0]])
    J = A.T @ np.linalg.inv(C) @ A + np.linalg.inv(P)
    return supports.gaussian([1.0, 2.0], P), GaussianPairs.of(lambda p: p @ A.T, C), J


@pytest.mark.parametrize("H", [0.7 * np.eye(2), np.diag([0.4, 1.3]), np.array([[0.5, 0.2], [-0.3, 0.8]])])
def test_linear_gaussian(H):
    support, law, J = linear()
    expected = H @ np.linalg.inv(4 * np.sinh(H.T @ J @ H / 4)) @ H.T
    np.testing.assert_allclose(wwb_of(support, law, H), expected, rtol=EXACT)
    np.testing.assert_allclose(wwb_of(support, law, H, form=printed), expected, rtol=EXACT)
    half = with_exponent(support, law, [H], 0.5, 24, [1.0])[0]
    np.testing.assert_allclose(bound_matrices(H, half)[0], expected, rtol=EXACT)


def test_short_test_vectors_give_the_inverse_information():
    support, law, J = linear()
    np.testing.assert_allclose(wwb_of(support, law, 1e-3 * np.eye(2)), np.linalg.inv(J), rtol=EXACT)


@pytest.mark.parametrize("std", [0.05, 0.7, 20.0])
def test_ziv_zakai_of_a_uniform_law_and_gaussian_noise(std):
    """Bell et al. 1997: ``int h (1 - h/L) Q(h / 2 std) dh`` in incomplete gamma functions."""
    L = 3.0
    a = L**2 / (8 * std**2)
    expected = (
        L**2 / 6 * norm.sf(L / (2 * std))
        + std**2 * gammainc(1.5, a)
        - 16 * std**3 / (3 * L * np.sqrt(2 * np.pi)) * gammainc(2.0, a)
    )
    law = GaussianPairs.of(lambda p: p, std**2 * np.eye(1))
    assert along(supports.box([1.0], [1.0 + L]), law, X, 4, [1.0], rtol=1e-7).mse_m2[0] == pytest.approx(
        expected, rel=EXACT
    )


def test_noise_that_is_not_gaussian():
    """Laplace noise of scale b: error ``exp(-d / 2b) / 2``, Bhattacharyya coefficient ``(1 + d / 2b) exp(-d / 2b)``."""
    L, b, h = 3.0, 0.4, 0.7
    plan = lb.observe(lambda p: p[0], [lb.Laplace(0.0, b)], dim=1, prior=lb.UniformBox([0.0], [L]))
    c = 2 * b
    x = L / c
    integral = c**2 * (1 - np.exp(-x) * (1 + x)) - c**3 / L * (2 - np.exp(-x) * (2 + 2 * x + x**2))
    assert lb.ezzb(plan, rtol=1e-4).position_mse[0] == pytest.approx(0.5 * integral, rel=TABULATED)

    def rho(d):
        return (1 + d / c) * np.exp(-d / c)

    mu, q = (1 - h / L) * rho(h), 2 * (1 - h / L) - 2 * (1 - 2 * h / L) * rho(2 * h)
    assert lb.wwb(plan, tests=np.array([[h]])).position_mse[0] == pytest.approx(h**2 * mu**2 / q, rel=TABULATED)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_ziv_zakai_is_the_least_error_of_a_scalar_gaussian(ratio):
    P, std = 4.0, 1.5
    law = GaussianPairs.of(lambda p: p, std**2 * np.eye(1))
    found = along(supports.gaussian([1.0], [[P]]), law, X, 40, [ratio], rtol=1e-6)
    assert found.mse_m2[0] == pytest.approx(1 / (1 / P + 1 / (ratio * std) ** 2), rel=EXACT)


def test_a_free_shift_makes_it_exact_for_a_correlated_gaussian():
    """The best shift minimises ``d^T J d`` for ``a . d = h``: ``a^T J^-1 a``; along a it is ``1 / a^T J a``."""
    support, law, J = linear()
    a = np.array([1.0, 0.0])
    straight = along(support, law, a, 16, [1.0], rtol=1e-4).mse_m2[0]
    free = along(support, law, a, 16, [1.0], free=True, rtol=1e-4).mse_m2[0]
    assert straight == pytest.approx(1 / J[0, 0], rel=1e-4)
    assert free == pytest.approx(np.linalg.inv(J)[0, 0], rel=1e-2)  # of a searched shift
    assert free > 1.05 * straight


@pytest.mark.parametrize(
    ("support", "variance"),
    [
        (supports.disc([1.0, 2.0], 15.0), 15.0**2 / 4),
        (supports.box([0.0, 0.0], [4.0, 9.0]), 16 / 12),
        (supports.gaussian([0.0, 0.0], np.diag([9.0, 1.0])), 9.0),
    ],
    ids=["disc", "box", "gaussian"],
)
def test_without_data_ziv_zakai_is_the_prior_variance(support, variance):
    found = along(support, NOTHING, np.array([1.0, 0.0]), 24, [1.0], rtol=1e-5)
    assert found.mse_m2[0] == pytest.approx(variance, rel=EXACT)


def test_without_data_it_is_half_of_the_variance_of_an_exponential_law():
    t, w = legendre(200)

    def overlap(shifts, n, rough=None):
        start = max(0.0, float(-shifts.min()))
        return Rule((start + 40 * t**2)[:, None], 80 * t * w)

    support = supports.Support(1, lambda p: -p[:, 0], overlap, lambda a: 60.0, False, False, np.eye(1))
    assert along(support, NOTHING, X, 10, [1.0], rtol=1e-6).mse_m2[0] == pytest.approx(0.5, rel=EXACT)


def test_equal_places_are_confused_half_of_the_time():
    assert gaussian_error(np.zeros(1), np.zeros(1)).tolist() == [0.5]
    law = GaussianPairs.of(lambda p: p, np.eye(1))
    assert law.error(law.pairs(np.ones((1, 1)), np.ones((1, 1))), 1.0)[0] == 0.5


def test_the_diagonal_of_a_convex_uniform_law_is_an_overlap_minus_an_affinity():
    """``q_ii = 2 [rho(h) - mu(2 h)]``, with the overlap fraction rho of the disc from its formula."""
    R, h = 5.0, 2.0
    anchor = np.array([2.0, 3.0])
    law = GaussianPairs.of(lambda p: np.linalg.norm(p - anchor, axis=1, keepdims=True), np.eye(1))
    support = supports.disc([0.0, 0.0], R)
    gram, double = grams(support, law, [np.array([[h], [0.0]]), np.array([[2 * h], [0.0]])], 40, [1.0])
    d = h / R
    rho = (2 * np.arccos(d / 2) - d / 2 * np.sqrt(4 - d**2)) / np.pi
    assert gram.q[0, 0, 0] == pytest.approx(2 * (rho - double.mu[0, 0]), rel=1e-4)  # rough at the anchor
