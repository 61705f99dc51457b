"""k-NN, the map between the points, and the ranking, against slower or simpler computations."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

import locbounds as lb
from locbounds.survey import Fingerprints, printed_mse
from locbounds.survey.importance import _with_kept_matchings, access_points, fall_without_each
from locbounds.survey.interpolate import interpolated
from locbounds.survey.neighbours import Errors, nearest_neighbours, simulated
from locbounds.survey.noise import Noise
from locbounds.survey.study import study

RNG = np.random.default_rng(8)


def room(n=60, noise=2.0, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2)) * [12, 9]
    beacons = np.array([[0.0, 0], [12, 0], [6, 9], [0, 9], [12, 9]])
    heard = -35 - 20 * np.log10(1 + cdist(x, beacons)) + rng.normal(size=(n, 5))
    return lb.survey_model(Fingerprints.at(x, heard), noise_db=noise)


def test_neighbours_are_those_of_a_plain_search():
    model = room()
    z = model.mean[:20] + RNG.normal(size=(20, 5))
    near = np.argsort(cdist(z, model.mean), axis=1)[:, :3]
    d = np.sort(cdist(z, model.mean), axis=1)[:, :3]
    np.testing.assert_allclose(nearest_neighbours("knn", neighbours=3)(model, z), model.position_m[near].mean(axis=1))
    weight = (1 / d) / (1 / d).sum(axis=1, keepdims=True)
    expected = np.einsum("ij,ijk->ik", weight, model.position_m[near])
    np.testing.assert_allclose(nearest_neighbours("wknn", neighbours=3)(model, z), expected)


def test_no_estimator_beats_the_bound_on_draws_from_the_model():
    model = room(noise=6.0)
    bound = lb.survey_bound(model).rmse_m
    least = lb.discrete_mmse(model)
    assert bound < least.rmse_m
    for id in ("knn", "wknn"):
        rmse, stderr = simulated(nearest_neighbours(id), model, draws=6_000)
        assert rmse > least.rmse_m - 4 * np.hypot(stderr, least.rmse_stderr_m)
        assert rmse > bound


def test_the_standard_error_counts_groups_not_samples():
    square = np.repeat(RNG.random(50), 20)
    group = np.repeat(np.arange(50), 20)
    errors = Errors(np.zeros((1000, 2)), square, group)
    means = square.reshape(50, 20)[:, 0]
    assert errors.stderr_m == pytest.approx(means.std(ddof=1) / np.sqrt(50) / (2 * errors.rmse_m))


@pytest.mark.parametrize("correlated", [False, True])
def test_distances_without_a_column_are_those_of_the_smaller_covariance(correlated):
    factor = RNG.normal(size=(4, 4))
    covariance = factor @ factor.T + np.eye(4)
    deviation = np.sqrt(np.diagonal(covariance))
    correlation = covariance / np.outer(deviation, deviation) if correlated else None
    noise = Noise(deviation, correlation, "made")
    d = RNG.normal(size=(6, 4))
    square, fall = fall_without_each(noise, d)
    full = noise.columns(np.arange(4))
    np.testing.assert_allclose(square, np.sum(full.whitened(d) ** 2, axis=1))
    for k in range(4):
        keep = np.arange(4) != k
        np.testing.assert_allclose(square - fall[:, k], np.sum(noise.columns(keep).whitened(d[:, keep]) ** 2, axis=1))


def test_every_removal_raises_the_bound_and_kept_matchings_say_less():
    model = room(noise=5.0)
    ranked = access_points(model)
    assert all(r.rise_m >= 0 for r in ranked)
    assert [r.rise_m for r in ranked] == sorted((r.rise_m for r in ranked), reverse=True)
    bound = lb.survey_bound(model, levels=12)
    full, without = _with_kept_matchings(model, bound, 1.0)
    assert full**2 == pytest.approx(sum(p.ziv_zakai_m2 for p in bound.axes.values()))
    anew = {r.name: r.rmse_without_m for r in ranked}
    for name, value in zip(model.names, without, strict=True):
        assert full < value <= anew[name] * (1 + 1e-9)


def test_the_map_is_right_between_the_points_and_locates_by_its_posterior_mean():
    """A smooth field: a fifth of the error of taking the nearest point's fingerprint, or less."""
    x = np.stack(np.meshgrid(np.arange(0, 12, 2.0), np.arange(0, 9, 2.0)), -1).reshape(-1, 2)
    beacons = np.array([[-3.0, -3], [15, -3], [6, 14], [-3, 12]])

    def field(place):
        return -3.0 * cdist(place, beacons)

    model = lb.survey_model(Fingerprints.at(x, field(x) - 20), noise_db=0.5)
    dense = interpolated(model)
    grid = dense.model.position_m
    nearest = field(x[cdist(grid, x).argmin(axis=1)])
    wrong, plain = (np.sqrt(np.mean((z - field(grid)) ** 2)) for z in (dense.model.mean + 20, nearest))
    assert wrong < 0.2 * plain
    certain = dense._replace(variance=0 * dense.variance)  # then it locates by the posterior mean of its model
    loud = dense.model.at_noise(4.0)
    best, stderr = simulated(lambda _, z: certain._replace(model=loud).locate(z), loud, draws=6_000)
    least = lb.discrete_mmse(loud, draws=6_000)
    assert abs(best - least.rmse_m) < 4 * np.hypot(stderr, least.rmse_stderr_m)
    with pytest.raises(lb.InputError, match="at least 8 points"):
        interpolated(lb.survey_model(Fingerprints.at(x[:5], field(x[:5]) - 20), noise_db=0.5))


def test_the_printed_formula_is_the_sum_over_sorted_distances_by_hand():
    model = room(6, noise=3.0)
    d, apart = cdist(model.whitened, model.whitened), cdist(model.position_m, model.position_m)
    h = np.linspace(0, 2 * apart.max(), 200_001)
    from scipy.special import erfc

    p = 0.5 * erfc(d / (2 * np.sqrt(2)))
    worst = np.array([[np.max(np.where(apart[i] >= x / 2, p[i], 0)) for i in range(6)] for x in h[::100]])
    coarse = np.trapezoid(h[::100] * worst.mean(axis=1), h[::100]) / 2
    assert printed_mse(model) == pytest.approx(coarse, rel=2e-3)  # the step of the numerical integral

    def at_noise(noise_db):
        return lb.survey_model(Fingerprints.at(model.position_m, model.mean), noise_db=noise_db)

    as_printed = printed_mse(at_noise(2.0), squared=True)  # sigma^2 = 4 in the place of sigma
    assert as_printed == pytest.approx(printed_mse(at_noise(4.0)), rel=1e-9)
    assert as_printed > 1.1 * printed_mse(at_noise(2.0))


def test_a_study_holds_together():
    model = room(40)
    x = np.repeat(model.position_m, 2, axis=0)
    z = np.repeat(model.mean, 2, axis=0) + 2 * RNG.normal(size=(80, 5))
    found = study(Fingerprints.at(x, z), test="samples", levels=[0.5, 2.0])
    value = {r.method: r.rmse_m for r in found.rows}
    assert value["survey"] == max(value["survey-length"], np.hypot(value["survey-x"], value["survey-y"]))
    assert value["survey"] < value["mmse"] < value["knn"]
    assert {"gp", "survey-gp", "mmse-gp", "wknn"} <= set(value)
    assert {r.valid for r in found.rows if r.method == "survey-printed"} == {"as printed, not a bound"}
    low, high = ([r.rmse_m for r in found.curve if r.method == m] for m in ("survey", "mmse"))
    assert low[0] < low[1]
    assert (np.array(low) < high).all()
