"""Drawing from a scenario, against the laws it states."""

import jax
import numpy as np
import pytest

import locbounds as lb
from scenarios import STEPS, asymmetric, mask

RUNS = 20_000
SIGMAS = 4.5  # at most thirty statistics per test: false alarm below 1e-3 in the whole file


@pytest.fixture(scope="module")
def scenario():
    return asymmetric(reports=mask(STEPS, 2))


@pytest.fixture(scope="module")
def draws(scenario):
    return lb.simulate(scenario, runs=RUNS, seed=2)


def test_the_first_runs_are_the_same_for_any_number(scenario, draws):
    few = lb.simulate(scenario, runs=1500, seed=2)
    for a, b in zip(few, draws, strict=True):
        np.testing.assert_array_equal(a, b[:1500])
    other = lb.simulate(scenario, runs=10, seed=3)
    assert not np.any(other.states == draws.states[:10])


def test_states_have_the_mean_and_covariance_of_the_model(scenario, draws):
    with jax.enable_x64(True):
        F, Q = np.asarray(scenario.transition), np.asarray(scenario.process_noise)
    mean, P = scenario.prior.mean, scenario.prior.covariance
    for k in range(STEPS):
        mean, P = F[k] @ mean, F[k] @ P @ F[k].T + Q[k]
    u = np.linalg.solve(np.linalg.cholesky(P), (draws.states[:, -1] - mean).T)  # white, if all is right
    assert np.all(np.abs(u.mean(1)) < SIGMAS / np.sqrt(RUNS))
    products = (u @ u.T) / RUNS - np.eye(4)
    assert np.all(np.abs(products) < SIGMAS * np.sqrt(2 / RUNS))
    v = draws.states[:, 4] - draws.states[:, 3] @ F[3].T
    white = np.linalg.solve(np.linalg.cholesky(Q[3]), v.T)
    assert np.all(np.abs(white @ white.T / RUNS - np.eye(4)) < SIGMAS * np.sqrt(2 / RUNS))
    assert np.all(np.abs(white @ draws.states[:, 3]) / RUNS < SIGMAS * draws.states[:, 3].std(0) * 2 / np.sqrt(RUNS))


def test_sights_follow_the_chains_and_not_their_transposes(scenario, draws):
    for m, link in enumerate(scenario.links):
        r, T = draws.sight[:, :, m], np.asarray(link.sight.transition)
        law = np.asarray(link.sight.start) @ T
        assert abs((r[:, 0] == 0).mean() - law[0]) < SIGMAS * np.sqrt(law[0] * law[1] / RUNS)
        for i in (0, 1):
            now = r[:, 5] == i
            p = (r[now, 6] == 0).mean()
            assert abs(p - T[i, 0]) < SIGMAS * np.sqrt(T[i, 0] * T[i, 1] / now.sum())
    together = ((draws.sight[:, 6, 0] == 0) & (draws.sight[:, 6, 1] == 0)).mean()
    apart = np.prod((draws.sight[:, 6] == 0).mean(0))
    assert abs(together - apart) < SIGMAS / 2 / np.sqrt(RUNS)  # links are independent


def test_measurements_are_ranges_with_the_noise_of_the_sight(scenario, draws):
    np.testing.assert_array_equal(np.isnan(draws.measurements), np.broadcast_to(~scenario.reports, draws.sight.shape))
    for m, link in enumerate(scenario.links):
        k = np.flatnonzero(scenario.reports[:, m])[3]
        w = draws.measurements[:, k, m] - np.linalg.norm(draws.states[:, k + 1, :2] - link.measurement.anchor, axis=1)
        for mode, noise in enumerate(link.noises):
            u = (w[draws.sight[:, k, m] == mode] - noise.mean) / noise.std
            assert abs(u.mean()) < SIGMAS / np.sqrt(len(u))
            assert abs((u**2).mean() - 1) < SIGMAS * np.sqrt(2 / len(u))


def test_known_sight_is_drawn_as_it_is(scenario):
    modes = np.random.default_rng(0).integers(0, 2, (STEPS, 2))
    draws = lb.simulate(scenario.with_known_sight(modes), runs=5)
    np.testing.assert_array_equal(draws.sight, np.broadcast_to(modes, (5, STEPS, 2)))


def test_a_singular_motion_keeps_to_its_subspace():
    scenario = asymmetric().replace(motion=lb.ConstantVelocity([0.0, 0.3], discrete=True))
    x = lb.simulate(scenario, runs=50).states
    np.testing.assert_allclose(np.diff(x[:, :, 2]), 0.0, atol=1e-9)  # no acceleration along x
    dt = 0.5
    np.testing.assert_allclose(
        np.diff(x[:, :, 1]) - dt * x[:, :-1, 3], dt / 2 * np.diff(x[:, :, 3]), atol=1e-9
    )  # constant acceleration within each step


@pytest.mark.parametrize("runs", [0, -1])
def test_a_number_of_runs_that_is_none_is_an_input_error(scenario, runs):
    with pytest.raises(lb.InputError, match="runs"):
        lb.simulate(scenario, runs=runs)


@pytest.mark.parametrize("seed", [-1, 2**32, True])
def test_a_seed_that_is_none_is_an_input_error(scenario, seed):
    with pytest.raises(lb.InputError, match="seed"):
        lb.simulate(scenario, runs=1, seed=seed)
