"""Scenarios that do not separate link by link: what the dispatch chooses, and that it is right."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from locbounds.scenario import beyond_separation
from models import information, inverse_with_error, log_sum
from scenarios import Linear, asymmetric, kalman, prior

SIGMAS = 4.0
STEPS = 6


@pytest.fixture(scope="module")
def plain():
    return asymmetric(steps=STEPS)


def shared(scenario):
    sight = scenario.links[0].sight
    return scenario.replace(links=[a.replace(sight=sight, chain="door") for a in scenario.links])


def turning(scenario, chain=None, rates=(0.3, -0.2)):
    turns = [lb.CoordinatedTurn(rate, 0.4) for rate in rates]
    return scenario.replace(motion=lb.SwitchingMotion(turns, scenario.links[0].sight, chain))


def reflected(scenario):
    links = [a.replace(measurement=lb.BySight([a.measurement, lb.Range([20.0, 5.0])])) for a in scenario.links]
    return scenario.replace(links=links)


def agree(a, b):
    error = np.hypot(a.mean_position_rmse_stderr(), b.mean_position_rmse_stderr())
    assert error < 0.01 * b.mean_position_rmse()
    assert abs(a.mean_position_rmse() - b.mean_position_rmse()) < SIGMAS * error


BEYOND = {"share a chain": shared, "the motion switches": turning, "depends on the sight": reflected}


@pytest.mark.parametrize(
    "reason", ["share a chain", *(pytest.param(reason, marks=pytest.mark.slow) for reason in list(BEYOND)[1:])]
)
def test_the_engine_is_chosen_and_the_result_says_why(plain, reason):
    scenario = BEYOND[reason](plain)
    assert reason in beyond_separation(scenario)
    bound = lb.bcrb(scenario, samples=1)
    assert "general engine" in bound.provenance.how
    assert reason in bound.provenance.how
    assert str(bound.verdict) == "valid (Gaussian prior and motion; smooth noise)"
    for method in (lb.enumer, lb.los_only):
        with pytest.raises(lb.RefusedError, match=reason):
            method(scenario)
    with pytest.raises(lb.RefusedError, match=reason):
        lb.bcrb_algorithm1(scenario)
    with pytest.raises(lb.RefusedError, match=reason):
        lb.evaluate(lb.ImmEkf(), scenario, runs=2)
    with pytest.raises(lb.InputError, match="own tracks"):
        lb.bcrb(scenario, expectation=lb.AlongTrack(np.zeros((STEPS + 1, 2))))
    draws = lb.simulate(scenario, runs=3)
    assert draws.measurements.shape == (3, STEPS, 2)
    assert (reason == "share a chain") == np.array_equal(draws.sight[..., 0], draws.sight[..., 1])


def test_one_name_for_two_chains_is_an_input_error(plain):
    with pytest.raises(lb.InputError, match="same chain"):
        plain.replace(links=[a.replace(chain="door") for a in plain.links])
    with pytest.raises(lb.InputError, match="same chain"):
        turning(plain.replace(links=[plain.links[1].replace(chain="door")])).replace(
            motion=lb.SwitchingMotion(turning(plain).motion.motions, plain.links[0].sight, "door")
        )


@pytest.mark.slow
def test_names_that_nobody_shares_and_motions_that_are_equal_change_nothing(plain):
    """The general engine on what the separated one can do, by ways that the dispatch cannot see through."""
    separated = lb.bcrb(plain, samples=4096)
    named = plain.replace(links=[a.replace(chain=a.name) for a in plain.links])
    assert np.array_equal(lb.bcrb(named, samples=4096).position_mse, separated.position_mse)
    alike = lb.SwitchingMotion([plain.motion, plain.motion], plain.links[0].sight)
    agree(lb.bcrb(plain.replace(motion=alike), samples=4096), separated)


@pytest.mark.slow
def test_everything_at_once_against_products_of_scores(plain):
    """Motion, one link and its reflections on one chain, the other link apart; four steps, by enumeration."""
    scenario = turning(reflected(asymmetric(steps=4)), "door")
    first = scenario.links[0].replace(chain="door")
    scenario = scenario.replace(links=[first, scenario.links[1]])
    n, sights = 16384, [a.sight for a in scenario.links]
    draws = lb.simulate(scenario, runs=n, seed=5)
    with jax.enable_x64(True):
        F = np.stack([np.asarray(m.transitions(scenario.times.intervals))[0] for m in scenario.motion.motions])
        Q = np.stack([np.asarray(m.covariances(scenario.times.intervals))[0] for m in scenario.motion.motions])
    P, log_det = np.linalg.inv(Q), np.linalg.slogdet(Q)[1]
    anchors = [[m.anchor for m in a.measurement.measurements] for a in scenario.links]
    P0 = np.linalg.inv(scenario.prior.covariance)

    def measured(link, position, z, r):
        noise = scenario.links[link].noises[r]
        w = z - jnp.linalg.norm(position - anchors[link][r])
        return -0.5 * ((w - float(noise.mean)) / float(noise.std)) ** 2 - np.log(float(noise.std))

    def log_density(x, z):
        x = x.reshape(5, 4)

        def moves(k, r):
            v = x[k + 1] - F[r] @ x[k]
            return -0.5 * v @ P[r] @ v - 0.5 * log_det[r] + measured(0, x[k + 1, :2], z[k, 0], r)

        e = x[0] - scenario.prior.mean
        whole = log_sum(moves, sights[0].start, sights[0].transition, 4) - 0.5 * e @ P0 @ e
        apart = log_sum(lambda k, r: measured(1, x[k + 1, :2], z[k, 1], r), sights[1].start, sights[1].transition, 4)
        return whole + apart

    J, groups = information(log_density, draws.states.reshape(n, 20), draws.measurements)
    expected, error = inverse_with_error(J, groups, [16, 17])
    bound = lb.bcrb(scenario, samples=n)
    spread = np.asarray(bound.replicates)[:, -1].std(ddof=1) / np.sqrt(len(bound.replicates))
    # the inverse of an estimated matrix is biased upwards, by about the number of unknowns over the draws
    assert abs(bound.position_mse[-1] - expected * (1 - 20 / n)) < SIGMAS * np.hypot(error, spread)


@pytest.mark.slow
def test_the_window_grows_with_the_precision_and_reports_what_it_cut(plain):
    slow = lb.MarkovSight.stay(0.97)
    scenario = shared(asymmetric(steps=24)).replace(title="slow")
    scenario = scenario.replace(
        links=[a.replace(sight=slow, noises=(lb.Gaussian(0.0, 3.0), lb.Gaussian(3.0, 4.0))) for a in scenario.links]
    )
    short, full = lb.bcrb(scenario, samples=2048, window=4), lb.bcrb(scenario, samples=2048, window=24)
    cut = np.abs(np.sqrt(short.position_mse / full.position_mse) - 1).max()
    assert cut > 1e-3
    assert full.diagnostics["truncation"] == 0
    assert np.isnan(short.diagnostics["truncation"])
    assert "window of 4 of 24 steps" in str(short.verdict)
    assert full.verdict.status.value == "valid"
    automatic = lb.bcrb(scenario, rtol=0.05)
    left = np.abs(np.sqrt(automatic.position_mse / full.position_mse) - 1).max()
    assert automatic.diagnostics["truncation"] <= 5e-3
    assert left < 0.05 * SIGMAS


def test_motion_matrices_step_by_step_in_a_scenario(plain):
    """LinearMotion in the separated engine: the Kalman covariance where nothing switches."""
    rng = np.random.default_rng(0)
    F = np.eye(4) + 0.2 * rng.normal(size=(STEPS, 4, 4))
    Q = np.array([A @ A.T for A in rng.normal(size=(STEPS, 4, 2))])  # singular
    link = lb.Link(
        "a", Linear([1.0, -0.5]), lb.KnownSight(np.zeros(STEPS, int)), (lb.Gaussian(0, 2), lb.Gaussian(0, 2))
    )
    scenario = plain.replace(motion=lb.LinearMotion(F, Q), prior=prior(), links=[link])
    expected = kalman(F, Q, prior().covariance, [[(np.array([1.0, -0.5, 0, 0]), 4.0)]] * STEPS)
    np.testing.assert_allclose(lb.bcrb(scenario, samples=1).covariance, expected, rtol=1e-9, atol=1e-9)
