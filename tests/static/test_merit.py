"""Figures of merit against the laws they come from: closed forms, quadrature in other coordinates, draws."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2, norm

import locbounds as lb
from locbounds.static import merit

RNG = np.random.default_rng(7)
EXACT_2D, EXACT_3D = 1e-10, 1e-6


def covariance(*deviations):
    """A covariance with these deviations along random axes."""
    n = len(deviations)
    turn = np.linalg.qr(RNG.normal(size=(n, n)))[0]
    return turn @ np.diag(np.square(deviations)) @ turn.T


def below_2d(r, s1, s2):
    """Pr(|e| <= r) in Cartesian coordinates: over the first coordinate, given it the second."""
    f = lambda x: norm.pdf(x, scale=s1) * (2 * norm.cdf(np.sqrt(r**2 - x**2) / s2) - 1)  # noqa: E731
    return 2 * quad(f, 0, r, epsabs=1e-13, epsrel=1e-13)[0]


@pytest.mark.parametrize("share", [0.05, 0.5, 0.67, 0.95, 0.999])
@pytest.mark.parametrize("deviations", [(1.0, 1.0), (3.0, 2.0), (5.0, 0.4)])
def test_radii_in_the_plane_by_quadrature_in_other_coordinates(share, deviations):
    expected = brentq(lambda r: below_2d(r, *deviations) - share, 1e-6, 6 * max(deviations), xtol=1e-13)
    assert merit.error_quantile(covariance(*deviations), share) == pytest.approx(expected, rel=EXACT_2D)


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_radii_of_laws_with_a_name(share):
    for n in (1, 2, 3):
        expected = 2.5 * np.sqrt(chi2.ppf(share, n))
        assert merit.error_quantile(2.5**2 * np.eye(n), share) == pytest.approx(expected, rel=1e-9)
    for thin in (0.0, 1e-9):
        line = merit.error_quantile(np.diag([4.0, thin]), share)
        assert line == pytest.approx(2 * norm.ppf(0.5 + share / 2), rel=1e-7)


def test_radii_in_space_by_mixing_the_plane():
    """Two equal deviations: given the third coordinate, the others' length is a chi with two degrees of freedom."""
    s, t = 1.7, 0.6
    f = lambda z, r: norm.pdf(z, scale=t) * chi2.cdf((r**2 - z**2) / s**2, 2)  # noqa: E731
    for share in (0.5, 0.9):
        r = float(merit.error_quantile(covariance(s, s, t), share))
        assert 2 * quad(f, 0, r, args=(r,))[0] == pytest.approx(share, abs=EXACT_3D)


def test_median_of_a_round_error_around_another_centre():
    """The distance of a round error from the origin is a non-central chi: the sample quantile's interval holds it."""
    e = RNG.normal(size=(20_000, 2)) * 2.0 + [3.0, 1.0]
    found = lb.merit.sample_quantile(np.linalg.norm(e, axis=1), 0.67, confidence=0.9999)
    truth = 2 * np.sqrt(ncx2.ppf(0.67, 2, 10 / 4))
    assert found.low < truth < found.high
    assert found.high - found.low < 0.1 * truth


def test_intervals_of_quantiles_hold_as_often_as_they_say():
    errors = RNG.exponential(size=(600, 60))
    truth = -np.log(0.5)
    held = [q.low <= truth <= q.high for q in (lb.merit.sample_quantile(e, 0.5, confidence=0.9) for e in errors)]
    assert np.mean(held) > 0.9 - 4 * np.sqrt(0.09 / 600)  # discrete: never less than promised
    assert np.mean(held) < 0.96


@pytest.mark.parametrize("deviations", [(2.0,), (3.0, 2.0), (5.0, 0.1), (3.0, 2.0, 0.5), (1.0, 1.0, 1.0)])
def test_mean_length_and_ellipses_by_draws(deviations):
    C = covariance(*deviations)
    e = RNG.normal(size=(100_000, len(C))) @ np.linalg.cholesky(C).T
    length = np.linalg.norm(e, axis=1)
    assert abs(length.mean() - merit.mde(C)) < 4 * length.std() / np.sqrt(len(e))
    assert merit.rmse(C) == pytest.approx(np.linalg.norm(deviations))
    assert merit.mse(C) == pytest.approx(np.sum(np.square(deviations)))
    assert merit.mde(C) < merit.rmse(C)
    ellipse = merit.error_ellipse(C, 0.8)
    inside = np.square((e @ ellipse.directions) / ellipse.semi_axes_m).sum(1) <= 1
    assert abs(inside.mean() - 0.8) < 4 * np.sqrt(0.16 / len(e))
    assert np.all(np.diff(ellipse.semi_axes_m) <= 0)


def test_angle_of_an_ellipse_is_that_of_its_longest_axis():
    for angle in (-1.2, 0.0, 0.7):
        a = np.array([np.cos(angle), np.sin(angle)])
        C = 9 * np.outer(a, a) + np.outer([-a[1], a[0]], [-a[1], a[0]])
        assert merit.error_ellipse(C).angle_rad == pytest.approx(angle)


def test_no_bound_is_an_infinite_error_not_a_nan():
    C = np.stack([np.diag([np.inf, np.inf]), np.eye(2)])
    for figure in (merit.rmse, merit.cep, merit.mde):
        assert np.isposinf(figure(C)[0])
        assert np.isfinite(figure(C)[1])
    assert np.isposinf(merit.error_ellipse(C).semi_axes_m[0]).all()


FIGURES = (
    merit.mse, merit.rmse, merit.mde, merit.cep, merit.error_quantile, lambda C: merit.error_ellipse(C).semi_axes_m,
)  # fmt: skip


@pytest.mark.parametrize("figure", FIGURES)
def test_what_is_no_covariance_is_refused(figure):
    turned = np.array([[0.6, -0.8], [0.8, 0.6]])
    for wrong, words in (
        (np.diag([4.0, -100.0]), "negative variance"),
        (turned @ np.diag([4.0, -1e-6]) @ turned.T, "negative variance"),
        (np.diag([4.0, 1.0, -1.0]), "negative variance"),
        (np.diag([-4.0]), "negative variance"),
        (np.diag([np.nan, 1.0]), "NaN"),
    ):
        with pytest.raises(lb.InputError, match=words):
            figure(wrong)
        with pytest.raises(lb.InputError, match=words):
            figure(np.stack([np.full(wrong.shape, np.inf), np.eye(len(wrong)), wrong]))
    for rounded in (turned @ np.diag([4.0, -1e-12]) @ turned.T, np.diag([4.0, 0.0, -1e-12]), np.zeros((2, 2))):
        assert np.isfinite(figure(rounded)).all()
        assert np.isposinf(np.atleast_1d(figure(np.full(rounded.shape, np.inf)))[0])


@pytest.mark.parametrize("share", [0.0, 1.0, -1.0, np.nan])
def test_shares_that_are_none(share):
    with pytest.raises(lb.InputError, match="share of errors"):
        merit.error_quantile(np.eye(2), share)


def test_shapes_and_samples_that_cannot_be_used():
    with pytest.raises(lb.InputError, match="shape"):
        merit.rmse(np.eye(4))
    with pytest.raises(lb.InputError, match="not all finite"):
        merit.sample_quantile(np.array([1.0, np.nan]))
    with pytest.raises(lb.InputError, match="0 errors"):
        merit.sample_quantile(np.zeros(0))
