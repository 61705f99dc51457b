"""The rigorous bound: never above the exact least error, equal to brute force, valid with any matching."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation
from scipy.special import ndtr

from locbounds.survey import Fingerprints, printed_mse, survey_bound, survey_candidates, survey_model
from locbounds.survey.bound import integrate
from locbounds.survey.pairs import spread
from locbounds.survey.solvers import AllPairs, SomePairs
from small_surveys import best_injection, exact_mmse, small_survey

SURVEYS = 1_000
ROUNDING = 1e-9  # relative; the quadrature is exact to that


def test_the_bound_is_never_above_the_exact_least_error_on_a_thousand_surveys():
    rng = np.random.default_rng(20090)
    tightest, printed_above = 0.0, 0
    for _ in range(SURVEYS):
        model = small_survey(rng)
        exact, wrong = exact_mmse(model)
        bound = survey_bound(model, levels=200)
        most = exact * (1 + ROUNDING) + wrong
        for part, least in zip(bound.axes.values(), most, strict=True):
            assert part.mse_m2 <= least
        assert max(bound.length.mse_m2, bound.mse_m2) <= most.sum()
        tightest = max(tightest, bound.mse_m2 / (exact + wrong).sum())
        printed_above += printed_mse(model) > most.sum()
    assert tightest > 0.999  # two points: the helper tells nothing
    assert printed_above > 0.9 * SURVEYS  # the formula of the chapter is not a bound


@pytest.mark.parametrize("seed", range(12))
def test_every_value_of_a_is_that_of_the_best_assignment(seed):
    rng = np.random.default_rng(seed)
    model = small_survey(rng, points=int(rng.integers(2, 7)), space=2)
    n = model.points
    confusions = ndtr(-cdist(model.whitened, model.whitened) / 2)
    bound = survey_bound(model, rtol=1e-15, levels=10_000)
    for name, part in [*bound.axes.items(), ("length", bound.length)]:
        if name == "length":
            apart, share = cdist(model.position_m, model.position_m), 1
        else:
            x = model.position_m[:, "xy".index(name)]
            apart, share = x - x[:, None], 2
        edges = np.unique(apart[apart > 0])
        values = [share * best_injection(confusions, apart >= h) / n for h in edges]
        integral = sum(
            a * (h**2 - g**2) / 4 for a, h, g in zip(values, edges, np.concatenate([[0], edges]), strict=False)
        )
        assert part.ziv_zakai_m2 == pytest.approx(integral, rel=1e-12, abs=1e-300)
        square = best_injection(apart**2 * spread(cdist(model.whitened, model.whitened)), apart != 0) / n
        assert part.pairs_m2 == pytest.approx(square, rel=1e-12, abs=1e-300)
        assert (part.lost_to_grid_m2, part.lost_to_pairs_m2) == (0, 0)


def test_certificates_are_injections_of_pairs_far_enough_apart():
    model = small_survey(np.random.default_rng(3), points=7, columns=2, space=2)
    confusions = ndtr(-cdist(model.whitened, model.whitened) / 2)
    for name, part in survey_bound(model).axes.items():
        x = model.position_m[:, "xy".index(name)]
        assert part.matchings
        for m in part.matchings:
            assert len(set(m.left)) == len(m.left) == len(set(m.right))
            assert (x[m.right] - x[m.left] >= m.distance_m).all()
            assert m.value == pytest.approx(2 * confusions[m.left, m.right].sum() / model.points)


def test_a_coarse_grid_only_lowers_the_bound_and_says_by_how_much_at_most():
    model = small_survey(np.random.default_rng(5), points=7, columns=1, space=1, noise_db=3.0)
    fine = AllPairs(model.whitened, model.position_m, 0)
    exact = integrate(fine, 0.0, rtol=1e-12, levels=1000)
    for levels in (2, 3, 5, 9):
        part = integrate(fine, 0.0, rtol=1e-12, levels=levels)
        assert part.ziv_zakai_m2 <= exact.ziv_zakai_m2 * (1 + 1e-12)
        assert part.mse_m2 + part.lost_to_grid_m2 + part.lost_to_pairs_m2 >= exact.mse_m2 * (1 - 1e-12)


def hall(n=300, seed=0, spread_db=4.0):
    rng = np.random.default_rng(seed)
    place = rng.random((n, 3)) * [30, 12, 3]
    beacons = rng.random((8, 3)) * [30, 12, 3]
    heard = -30 - 20 * np.log10(1 + cdist(place, beacons)) + spread_db * rng.normal(size=(n, 8))
    return survey_model(Fingerprints.at(place, heard), noise_db=3.0)


@pytest.mark.parametrize("scale", [0.5, 1.0, 3.0])
def test_candidates_and_auctions_give_a_lower_value_and_an_upper_one(scale):
    model = hall()
    candidates = survey_candidates(model)
    for axis in (0, 1, 2, None):
        every = AllPairs(model.whitened / scale, model.position_m, axis)
        some = SomePairs(model.whitened, model.position_m, candidates, axis, scale)
        for h in (1e-6, 0.5, 2.0, 8.0):
            best, found = every.solve(h), some.solve(h)
            assert found.value <= best.value * (1 + 1e-12)
            assert best.value <= found.upper * (1 + 1e-5)  # candidates are ranked in single precision
        best, most = some.pairs()
        assert best <= every.pairs()[0] * (1 + 1e-12)
        assert every.pairs()[0] <= most * (1 + 1e-5)
    exact, nearly = survey_bound(model, scale=scale), survey_bound(model, scale=scale, candidates=candidates)
    assert nearly.mse_m2 <= exact.mse_m2 * (1 + 1e-12)
    assert nearly.mse_m2 > 0.95 * exact.mse_m2


def test_a_rotation_of_all_positions_does_not_change_the_length():
    model = hall(60)
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    turned = dataclasses.replace(model, position_m=model.position_m @ turn.T + [5.0, -3.0, 2.0])
    here, there = survey_bound(model), survey_bound(turned)
    assert there.length.mse_m2 == pytest.approx(here.length.mse_m2, rel=1e-9)
    assert there.axes["x"].mse_m2 != pytest.approx(here.axes["x"].mse_m2, rel=1e-3)


def test_the_bound_grows_with_the_noise():
    model = hall(60)
    low, high = survey_bound(model, scale=0.5), survey_bound(model, scale=2.0)
    assert low.mse_m2 < high.mse_m2
    assert high.noise_db == pytest.approx(6.0)


def test_indistinguishable_points_on_a_line():
    """No information at all: the least error is the variance of the points, the bound is below it."""
    x = np.arange(11.0)[:, None]
    heard = np.column_stack([-50 + 1e-9 * x[:, 0], -60 - 1e-9 * x[:, 0]])
    bound = survey_bound(survey_model(Fingerprints.at(x, heard), noise_db=5.0))
    assert 0.7 * x.var() < bound.mse_m2 <= x.var()
