"""Bounds for known sight and their averages, against NumPy loops over textbook recursions."""

import jax
import numpy as np
import pytest

import locbounds as lb
from scenarios import STEPS, asymmetric, mask, sequence_probabilities, sequences

ROUNDING = 1e-9
SIGMAS = 4.0


@pytest.fixture(scope="module")
def scenario():
    return asymmetric(reports=mask(STEPS, 2))


def matrices(scenario):
    """F and Q of :func:`asymmetric`'s equal steps."""
    with jax.enable_x64(True):
        return np.asarray(scenario.transition), np.asarray(scenario.process_noise)


def information_filter(scenario, gradients, variances, F_and_Q=None):
    """Position mse at steps 0..K; gradients and variances by step and link, infinite variance where unused."""
    F, Q = matrices(scenario) if F_and_Q is None else F_and_Q
    P, out = scenario.prior.covariance, []
    out.append(P[0, 0] + P[1, 1])
    J = np.sum(gradients / variances[..., None, None], axis=1)
    for k in range(scenario.steps):
        Y = np.linalg.inv(F[k] @ P @ F[k].T + Q[k])
        Y[:2, :2] += J[k]
        P = np.linalg.inv(Y)
        out.append(P[0, 0] + P[1, 1])
    return np.array(out)


def outer(x, anchors):
    """Mean of ``grad h grad h^T`` over tracks, [steps, links, 2, 2]; x [runs, steps, 2]."""
    u = x[:, :, None] - anchors
    u = u / np.linalg.norm(u, axis=-1, keepdims=True)
    return np.einsum("nkma,nkmb->kmab", u, u) / len(x)


def variances(scenario, modes):
    law = np.array([[float(n.std) ** 2 for n in a.noises] for a in scenario.links])
    return np.where(scenario.reports, law[np.arange(len(law)), modes], np.inf)


def test_known_sight_along_a_track_is_an_information_filter_and_exact(scenario):
    modes = np.random.default_rng(0).integers(0, 2, (STEPS, 2))
    track = np.cumsum(np.random.default_rng(1).normal(size=(STEPS + 1, 2)), axis=0)
    along = lb.AlongTrack(track, label="a walk")
    known = scenario.with_known_sight(modes)
    expected = information_filter(scenario, outer(track[None, 1:], scenario.anchors), variances(scenario, modes))
    for bound in (lb.known_sight(known, expectation=along), lb.enumer(known, expectation=along)):
        np.testing.assert_allclose(bound.position_mse, expected, rtol=ROUNDING)
        assert bound.mean_position_rmse_stderr() < ROUNDING
        assert bound.track == "a walk"
        assert "conditional on a walk" in str(bound.verdict)
    again = lb.known_sight(known, expectation=along, seed=5)
    assert np.array_equal(again.position_mse, lb.known_sight(known, expectation=along).position_mse)


def test_known_sight_is_enumer_of_the_only_sequence(scenario):
    modes = np.random.default_rng(0).integers(0, 2, (STEPS, 2))
    known = scenario.with_known_sight(modes)
    a, b = lb.known_sight(known, samples=8192), lb.enumer(known, samples=8192)
    x = lb.simulate(scenario, runs=20_000, seed=3).states[:, 1:, :2]
    exact = information_filter(scenario, outer(x, scenario.anchors), variances(scenario, modes))
    for bound in (a, b):
        assert 0 < bound.mean_position_rmse_stderr() < 0.002 * bound.mean_position_rmse()
        gap = bound.mean_position_rmse() - np.sqrt(exact).mean()
        assert abs(gap) < SIGMAS * 1.5 * bound.mean_position_rmse_stderr()  # the reference has errors of that size, too


@pytest.mark.parametrize("id", ["enumer", "los-only"])
def test_average_over_schedules_against_an_independent_loop(scenario, id):
    method = {"enumer": lb.enumer, "los-only": lb.los_only}[id]
    bound = method(scenario, samples=16384)
    draws = lb.simulate(scenario, runs=3000, seed=3)
    G = outer(draws.states[:, 1:, :2], scenario.anchors)
    rows, F_and_Q = [], matrices(scenario)
    for sight in draws.sight:
        R = variances(scenario, sight)
        R = np.where(sight == 1, np.inf, R) if id == "los-only" else R
        rows.append(information_filter(scenario, G, R, F_and_Q))
    mse = np.mean(rows, axis=0)
    influence = ((np.array(rows) - mse) / (2 * np.sqrt(mse))).mean(1)
    error = np.hypot(influence.std() / np.sqrt(len(rows)), 1.5 * bound.mean_position_rmse_stderr())
    assert abs(bound.mean_position_rmse() - np.sqrt(mse).mean()) < SIGMAS * error


def test_enumer_of_four_steps_is_the_sum_over_all_sequences():
    """Along a track there is nothing to draw but the sight, and all 256 joint sequences can be summed."""
    scenario = asymmetric(steps=4)
    track = np.array([[5.0, 10.0], [5.0, 9.0], [6.0, 8.0], [6.0, 7.0], [7.0, 7.0]])
    G = outer(track[None, 1:], scenario.anchors)
    T = [np.broadcast_to(a.sight.transition, (4, 2, 2)) for a in scenario.links]
    p = [sequence_probabilities(a.sight.start, t) for a, t in zip(scenario.links, T, strict=True)]
    r, expected, F_and_Q = sequences(4), np.zeros(5), matrices(scenario)
    for i in range(16):
        for j in range(16):
            R = variances(scenario, np.stack([r[i], r[j]], -1))
            expected += p[0][i] * p[1][j] * information_filter(scenario, G, R, F_and_Q)
    bound = lb.enumer(scenario, expectation=lb.AlongTrack(track), samples=2**17)
    assert bound.mean_position_rmse_stderr() < 1e-3 * bound.mean_position_rmse()
    assert abs(bound.mean_position_rmse() - np.sqrt(expected).mean()) < SIGMAS * bound.mean_position_rmse_stderr()


def test_throwing_nlos_ranges_away_never_helps(scenario):
    full, los = lb.enumer(scenario, samples=4096), lb.los_only(scenario, samples=4096)
    heard = 1 + np.argmax(scenario.reports.any(1))  # the first step with a range
    np.testing.assert_allclose(los.position_mse[:heard], full.position_mse[:heard], rtol=ROUNDING)
    assert np.all(los.position_mse[heard:] > full.position_mse[heard:])
    assert los.verdict.status.value == "valid under"


def test_rtol_is_reached_and_reported(scenario):
    looks = []
    bound = lb.enumer(scenario, rtol=2e-3, progress=lambda *look: looks.append(look))
    assert bound.relative_stderr() <= 2e-3
    samples, reached, target = looks[-1]
    assert target == 2e-3
    assert samples == bound.provenance.samples
    assert reached == pytest.approx(bound.relative_stderr(), rel=1e-6)


def test_along_track_that_does_not_fit_is_an_input_error(scenario):
    with pytest.raises(lb.InputError, match="shape"):
        lb.enumer(scenario, expectation=lb.AlongTrack(np.zeros((STEPS, 2))))
    track = np.ones((STEPS + 1, 2))
    track[4] = scenario.anchors[1]
    with pytest.raises(lb.InputError, match="at step 4 the track is exactly at anchor a1"):
        lb.bcrb(scenario, expectation=lb.AlongTrack(track))
