"""The expectation along one track and over the Gaussians of a filter."""

import jax
import numpy as np
import pytest

import locbounds as lb
from filter_scenarios import awkward
from locbounds.precision import double_precision
from locbounds.verdict import Status

EXACT = 1e-9  # relative: the issue is linear algebra only


def known(scenario: lb.Scenario, seed: int = 0) -> lb.Scenario:
    return scenario.with_known_sight(np.random.default_rng(seed).integers(0, 2, (scenario.steps, len(scenario.links))))


@pytest.mark.parametrize("discrete", [False, True])
def test_along_a_track_it_is_the_whole_information_matrix_of_start_and_noise(discrete):
    """In the coordinates (x_0, noise) nothing is singular, also where the process noise of the state is."""
    scenario = known(awkward(2, discrete=discrete))
    track = np.cumsum(np.random.default_rng(1).normal(3.0, 5.0, (scenario.steps + 1, 2)), axis=0)
    found = lb.known_sight(scenario, expectation=lb.AlongTrack(track))

    dt, q = 0.7, 0.4
    F = np.kron([[1, dt], [0, 1]], np.eye(2))
    if discrete:  # one acceleration per axis and step
        G, v = np.kron([[dt**2 / 2], [dt]], np.eye(2)), q * np.eye(2)
    else:
        G, v = np.eye(4), q * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(2))
    n, K = G.shape[1], scenario.steps
    J = np.zeros((4 + n * K, 4 + n * K))
    J[:4, :4] = np.linalg.inv(scenario.prior.covariance)
    for k in range(K):
        J[4 + n * k : 4 + n * (k + 1), 4 + n * k : 4 + n * (k + 1)] = np.linalg.inv(v)
    A = np.zeros((4, 4 + n * K))  # x_k = A theta
    A[:, :4] = np.eye(4)
    for k in range(1, K + 1):
        A = F @ A
        A[:, 4 + n * (k - 1) : 4 + n * k] = G
        for link in scenario.links:
            d = track[k] - link.measurement.anchor
            u = np.r_[d / np.linalg.norm(d), 0, 0] @ A
            J += np.outer(u, u) / link.noises[link.sight.modes[k - 1]].variance
        np.testing.assert_allclose(found.covariance[k], A @ np.linalg.solve(J, A.T), rtol=EXACT, atol=1e-9)
    assert found.verdict.status is Status.CONDITIONAL


def test_sigma_points_have_the_moments_of_their_gaussian():
    scenario = awkward(2)
    rng = np.random.default_rng(2)
    mean = rng.normal(size=(13, 4))
    roots = rng.normal(size=(13, 4, 4))
    roots[:, :, 3] = 0  # singular
    P = roots @ roots.transpose(0, 2, 1)
    points = np.asarray(double_precision(lb.Gaussians(mean, P).positions)(scenario, jax.random.key(0), 1))
    assert points.shape == (8, 12, 2)
    np.testing.assert_allclose(points.mean(axis=0), mean[1:, :2], atol=1e-12)
    d = points - points.mean(axis=0)
    np.testing.assert_allclose(np.einsum("pka,pkb->kab", d, d) / 8, P[1:, :2, :2], atol=1e-10)


def test_gaussians_without_spread_are_a_track():
    scenario = known(awkward(2))
    states = np.cumsum(np.random.default_rng(1).normal(3.0, 5.0, (scenario.steps + 1, 4)), axis=0)
    point = lb.known_sight(scenario, expectation=lb.Gaussians(states, np.zeros((scenario.steps + 1, 4, 4))))
    track = lb.known_sight(scenario, expectation=lb.AlongTrack(states[:, :2]))
    np.testing.assert_allclose(point.covariance, track.covariance, rtol=1e-9)
    assert point.track != track.track
    wide = np.broadcast_to(np.diag([900.0, 900.0, 1.0, 1.0]), (scenario.steps + 1, 4, 4))
    spread = lb.known_sight(scenario, expectation=lb.Gaussians(states, wide))
    assert np.abs(spread.position_mse / track.position_mse - 1).max() > 1e-3


def test_bad_gaussians_are_refused():
    scenario = known(awkward(2))
    times = scenario.steps + 1
    good = np.ones((times, 4)), np.broadcast_to(np.eye(4), (times, 4, 4))
    with pytest.raises(lb.InputError, match="shape"):
        lb.Gaussians(good[0], np.ones(times))
    with pytest.raises(lb.InputError, match="not finite"):
        lb.Gaussians(good[0] * np.nan, good[1])
    with pytest.raises(lb.InputError, match="no covariance"):
        lb.Gaussians(good[0], -good[1])
    with pytest.raises(lb.InputError, match="scenario needs"):
        lb.known_sight(scenario, expectation=lb.Gaussians(good[0][:5], good[1][:5]))
    at_anchor = np.r_[scenario.anchors[0], 0, 0] * np.ones((times, 1))
    with pytest.raises(lb.InputError, match="exactly at anchor a0"):
        lb.known_sight(scenario, expectation=lb.Gaussians(at_anchor, 0 * good[1]))


@pytest.mark.parametrize(
    ("schedule", "words"),
    [
        (np.zeros(5, int), "shape"),
        (np.zeros((12, 2), int), "shape"),
        ({"a0": [0] * 12, "a1": [0] * 12, "b": [0] * 12}, "unknown anchors"),
        ({"a0": [0] * 12, "a1": [0] * 12}, "nothing for the anchors"),
        ({"a0": [0] * 12, "a1": [0] * 12, "a2": [0] * 3}, "steps"),
        ({"a0": [0] * 12, "a1": [0] * 12, "a2": [7] * 12}, "0"),
    ],
)
def test_bad_schedules_are_refused(schedule, words):
    with pytest.raises(lb.InputError, match=words):
        awkward(2).with_known_sight(schedule)


def test_schedules_by_anchor_name():
    by_name = awkward(2).with_known_sight({"a2": [1] * 12, "a0": [0] * 12, "a1": [0, 1] * 6})
    assert [link.sight.modes.tolist() for link in by_name.links] == [[0] * 12, [0, 1] * 6, [1] * 12]
