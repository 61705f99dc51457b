import numpy as np
import pytest
from scipy.optimize import least_squares

import locbounds as lb
import textbook_filters as textbook
from filter_scenarios import awkward, with_gaps
from locbounds.filters import ImmKf
from locbounds.filters.lowering import lower
from locbounds.precision import double_precision

CONVERGED = 1e-3  # metres; both least squares stop before rounding does


def smoothed_ranges(model, z, link):
    """IMM Kalman filter on [range, range rate] of one link, one track z [steps]; mean and covariance per step."""
    dim = model.anchors.shape[1]
    offset = model.m0[:dim] - model.anchors[link]
    distance = np.linalg.norm(offset)
    W = np.kron(np.eye(2), offset[:, None] / distance)
    x = np.tile([distance, W[dim:, 1] @ model.m0[dim:]], (2, 1))
    P, mu, H = np.tile(W.T @ model.P0 @ W, (2, 1, 1)), model.start[link], np.array([[1.0, 0.0]])
    for k in range(len(z)):
        T, F, Q = model.transitions[link, k], W.T @ model.F[k] @ W, W.T @ model.Q[k] @ W
        c = mu @ T
        mixed = [textbook.moment_match(T[:, j] * mu / c[j], x, P) for j in range(2)]
        parts = []
        for j, (a, b) in enumerate(mixed):
            a, b = F @ a, F @ b @ F.T + Q
            if np.isnan(z[k]):
                parts.append((a, b, 1.0))
                continue
            h = a[:1] + model.means[link, j]
            parts.append(textbook.gain_form(a, b, z[[k]], h, H, model.variances[link, j][None]))
        x, P = np.array([p[0] for p in parts]), np.array([p[1] for p in parts])
        mu = c * [p[2] for p in parts]
        mu = mu / mu.sum()
        yield textbook.moment_match(mu, x, P)


@pytest.mark.parametrize("dim, weighted", [(2, True), pytest.param(3, False, marks=pytest.mark.slow)])
def test_smooths_like_the_textbook_and_locates_like_scipy(dim, weighted):
    scenario = awkward(dim)
    scenario = scenario.replace(prior=lb.GaussianPrior(scenario.prior.mean, np.diag(np.repeat([400.0, 1.0], dim))))
    model = double_precision(lower)(scenario)
    z = with_gaps(lb.simulate(scenario, runs=2, seed=4).measurements)
    ours = ImmKf(weighted=weighted)(scenario, z)
    for track, mean, covariance in zip(z, ours.mean, np.asarray(ours.covariance), strict=True):
        per_link = [list(smoothed_ranges(model, track[:, m], m)) for m in range(3)]
        position = model.m0[:dim]
        for k in range(scenario.steps):
            r, V = np.array([a[k][0] for a in per_link]), np.array([a[k][1] for a in per_link])
            w = 1 / np.diagonal(V, axis1=1, axis2=2) if weighted else np.ones((3, 2))

            def residual(p, r=r, w=w):
                return np.sqrt(w[:, 0]) * (r[:, 0] - np.linalg.norm(p - model.anchors, axis=1))

            position = least_squares(residual, position, xtol=1e-12, ftol=1e-12, gtol=1e-12).x
            u = textbook.ranges(position, model.anchors, dim)[1]
            B = [np.linalg.solve((u * w[:, [i]]).T @ u, (u * w[:, [i]]).T) for i in range(2)]
            np.testing.assert_allclose(mean[k + 1], np.r_[position, B[1] @ r[:, 1]], atol=CONVERGED)
            expected = np.block([[(B[i] * V[:, i, j]) @ B[j].T for j in range(2)] for i in range(2)])
            np.testing.assert_allclose(covariance[k + 1], expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())


def test_it_is_causal(paper):
    scenario, draws = paper
    z = draws.measurements[:2].copy()
    before = ImmKf()(scenario, z).mean
    z[:, 60:] += 100.0
    after = ImmKf()(scenario, z).mean
    np.testing.assert_array_equal(after[:, :61], before[:, :61])
    assert np.abs(after[:, 61:] - before[:, 61:]).min() > 0


@pytest.mark.slow
def test_a_second_start_finds_the_position_across_the_base_line():
    """Started at the prior, on the wrong side of the anchors, the descent alone ends in a local minimum."""
    anchors = np.array([[0.0, 0.0], [100.0, 0.0], [50.0, 10.0]])
    noise = lb.Gaussian(0.0, 0.1)
    scenario = lb.Scenario(
        title="mirror",
        times=lb.Times.uniform(step_s=1.0, steps=3),
        motion=lb.ConstantVelocity(0.01),
        prior=lb.GaussianPrior([50.0, -60.0, 0, 0], np.diag([1e4, 1e4, 0.01, 0.01])),
        links=[lb.Link(f"a{m}", lb.Range(a), lb.MarkovSight.stay(0.9), (noise, noise)) for m, a in enumerate(anchors)],
    )
    truth = np.array([50.0, 70.0])
    z = np.broadcast_to(np.linalg.norm(truth - anchors, axis=1), (1, 3, 3))
    np.testing.assert_allclose(ImmKf()(scenario, z).mean[0, 1:, :2], np.tile(truth, (3, 1)), atol=1.0)


@pytest.mark.slow
def test_collinear_anchors_stay_on_the_side_where_the_track_began():
    scenario = awkward(2)
    noise = lb.Gaussian(0.0, 5.0)
    links = [lb.Link(f"a{m}", lb.Range([100.0 * m, 0.0]), lb.MarkovSight.stay(0.9), (noise, noise)) for m in range(3)]
    prior = lb.GaussianPrior([100.0, 80.0, 0, 0], np.diag([25.0, 25.0, 0.01, 0.01]))
    scenario = scenario.replace(prior=prior, links=links, motion=lb.ConstantVelocity(0.001))
    draws = lb.simulate(scenario, runs=50, seed=1)
    assert (ImmKf()(scenario, draws.measurements).mean[..., 1] > 0).all()


def test_refuses_what_it_cannot_locate(paper):
    scenario, draws = paper
    one = scenario.replace(links=scenario.links[:1])
    with pytest.raises(lb.InputError, match="cannot locate"):
        ImmKf()(one, draws.measurements[:1, :, :1])


@pytest.mark.slow
@pytest.mark.parametrize("weighted", [True, False])
@pytest.mark.parametrize("stay", lb.papers.fritsche2013.STAY)
def test_table_1(stay, weighted):
    """The paper only cites the algorithm: within 1.5 m of what it published."""
    published = dict(zip(lb.papers.fritsche2013.STAY, lb.papers.fritsche2013.TABLE1_M["IMM-KF"], strict=True))[stay]
    scenario = lb.papers.fritsche2013.scenario(stay)
    draws = lb.simulate(scenario, runs=8192, seed=11)
    error = ImmKf(weighted=weighted, covariance=False)(scenario, draws.measurements).mean - draws.states
    rmse = np.sqrt((error[..., :2] ** 2).sum(-1).mean(0)).mean()
    assert abs(rmse - published) < 1.5
