import numpy as np
import pytest
from scipy.optimize import least_squares

import locbounds as lb
import textbook_filters
import textbook_trackers as textbook
from filter_scenarios import awkward, with_gaps
from locbounds.filters.imm_kf import range_models
from locbounds.filters.lowering import lower
from locbounds.precision import double_precision

CONVERGED = 1e-3  # metres; both least squares stop before rounding does


def simple() -> lb.Scenario:
    scenario = awkward(2)
    return scenario.replace(prior=lb.GaussianPrior(scenario.prior.mean, np.diag([400.0, 400.0, 1.0, 1.0])))


def test_smooths_like_the_textbook_and_locates_like_scipy():
    scenario = simple()
    model = double_precision(lower)(scenario)
    F, Q, mean_0, P_0 = (np.asarray(a) for a in double_precision(range_models)(model))
    z = with_gaps(lb.simulate(scenario, runs=2, seed=4).measurements)
    ours = lb.ImmKfSmoother()(scenario, z)
    for track, mean, covariance in zip(z, ours.mean, np.asarray(ours.covariance), strict=True):
        per_link = [
            textbook.kim_smoother(
                F[..., m],
                Q[..., m],
                model.transitions[m],
                model.start[m],
                mean_0[:, m],
                P_0[..., m],
                model.means[m, :, 0],
                model.variances[m, :, 0],
                track[:, m],
            )
            for m in range(3)
        ]
        position = model.m0[:2]
        for k in range(scenario.steps):
            r, V = np.array([a[k][0] for a in per_link]), np.array([a[k][1] for a in per_link])
            w = 1 / V[:, 0, 0]

            def residual(p, r=r, w=w):
                return np.sqrt(w) * (r[:, 0] - np.linalg.norm(p - model.anchors, axis=1))

            position = least_squares(residual, position, xtol=1e-12, ftol=1e-12, gtol=1e-12).x
            np.testing.assert_allclose(mean[k + 1, :2], position, atol=CONVERGED)
            u = textbook_filters.ranges(position, model.anchors, 2)[1]
            expected = np.linalg.inv((u * w[:, None]).T @ u)
            np.testing.assert_allclose(covariance[k + 1, :2, :2], expected, rtol=1e-3)


def test_with_one_sight_the_smoothed_ranges_are_those_of_all_data_at_once():
    """Both sights alike: the smoother of a linear Gaussian model is its regression on all ranges."""
    scenario = simple()
    noise = lb.Gaussian(3.0, 30.0)
    scenario = scenario.replace(links=[lb.Link(a.name, a.measurement, a.sight, (noise, noise)) for a in scenario.links])
    model = double_precision(lower)(scenario)
    F, Q, mean_0, P_0 = (np.asarray(a)[..., 0] for a in double_precision(range_models)(model))
    z = lb.simulate(scenario, runs=1, seed=4).measurements[0, :, 0]
    found = textbook.kim_smoother(
        F, Q, model.transitions[0], model.start[0], mean_0, P_0, np.full(2, 3.0), np.full(2, 900.0), z
    )
    K = len(z)
    mean, covariance = [mean_0], np.zeros((2 * K + 2, 2 * K + 2))
    covariance[:2, :2] = P_0
    for k in range(K):
        mean.append(F[k] @ mean[-1])
        before, now = slice(0, 2 * k + 2), slice(2 * k + 2, 2 * k + 4)
        cross = covariance[before, 2 * k : 2 * k + 2] @ F[k].T
        covariance[before, now], covariance[now, before] = cross, cross.T
        covariance[now, now] = F[k] @ covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] @ F[k].T + Q[k]
    H = np.zeros((K, 2 * K + 2))
    H[np.arange(K), 2 + 2 * np.arange(K)] = 1
    gain = covariance @ H.T @ np.linalg.inv(H @ covariance @ H.T + 900.0 * np.eye(K))
    all_at_once = np.concatenate(mean) + gain @ (z - 3.0 - H @ np.concatenate(mean))
    np.testing.assert_allclose(np.array([a for a, _ in found]), all_at_once.reshape(-1, 2)[1:], rtol=1e-9)


def test_it_says_that_it_sees_the_future(paper):
    scenario, draws = paper
    z = draws.measurements[:2].copy()
    before = lb.ImmKfSmoother()(scenario, z).mean
    z[:, 90:] += 100.0
    assert np.abs(lb.ImmKfSmoother()(scenario, z).mean - before)[:, 80].max() > 1.0
    assert "future-ranges" in lb.ImmKfSmoother.sees
    result = lb.evaluate(lb.ImmKfSmoother(), scenario, runs=8)
    with pytest.raises(lb.RefusedError, match="future-ranges") as refused:
        result.efficiency(lb.enumer(scenario, samples=1))
    assert "horizon='smooth'" in str(refused.value)
