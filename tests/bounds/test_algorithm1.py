"""The separated engine, Algorithm 1 and an explicit sum over all mode sequences: three independent computations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from scenarios import STEPS, asymmetric, mask, one_link, prior, sequence_probabilities, sequences

SIGMAS = 4.0  # one statistic per scenario: the time-averaged RMSE
SAMPLES = 8192
PRECISION = 6e-3  # largest relative standard error of the comparison; single edges and lags: test_separated_draws.py

OUTLIERS = lb.GaussianMixture([0.8, 0.2], [0.0, 4.0], [2.0, 6.0])


def irregular():
    """Dwell times with irregular steps, outliers in one sight, a third coordinate, missing ranges."""
    motion = lb.ConstantVelocity([0.4, 0.3, 0.05], dim=3)
    start = lb.GaussianPrior([5.0, 10.0, 1.0, 1.0, -1.0, 0.0], np.diag([64.0, 100.0, 4.0, 1.0, 4.0, 0.1]))
    times = lb.Times(np.cumsum([0.0, 0.3, 1.0, 0.1, 0.4, 2.0, 0.2, 0.6, 0.5, 0.1, 0.1, 1.5, 0.3]))
    reports = mask(STEPS, 2)
    links = [
        lb.Link(
            "a0",
            lb.Range([-60.0, -20.0, 15.0]),
            lb.DwellSight([0.9, 0.1], [3.0, 0.8]),
            (OUTLIERS, lb.Gaussian(10.0, 8.0)),
            reports[:, 0],
        ),
        lb.Link(
            "a1",
            lb.Range([30.0, 90.0, 3.0]),
            lb.DwellSight(None, [1.0, 5.0]),
            (lb.Gaussian(1.0, 2.0), lb.Gaussian(6.0, 3.0)),
            reports[:, 1],
        ),
    ]
    return lb.Scenario("irregular", times, motion, start, links)


SCENARIOS = {
    "asymmetric, away from stationarity": lambda: asymmetric(),
    "missing ranges": lambda: asymmetric(reports=mask(STEPS, 2)),
    "sticky against alternating": lambda: asymmetric(stay=((0.98, 0.98), (0.05, 0.1)), start=((0.5, 0.5), (1, 0))),
    "one chain cannot return": lambda: asymmetric(stay=((0.8, 1.0), (0.5, 0.5)), start=((1, 0), (0, 1))),
    "dwell times, irregular steps, outliers, space": irregular,
}


@pytest.mark.parametrize("name", [*list(SCENARIOS)[:-1], pytest.param(list(SCENARIOS)[-1], marks=pytest.mark.slow)])
def test_separated_engine_against_algorithm_1(name):
    scenario = SCENARIOS[name]()
    a = lb.bcrb(scenario, samples=SAMPLES, window=STEPS)
    b = lb.bcrb_algorithm1(scenario, samples=SAMPLES)
    error = np.hypot(a.mean_position_rmse_stderr(), b.mean_position_rmse_stderr())
    assert error < PRECISION * a.mean_position_rmse()
    assert abs(a.mean_position_rmse() - b.mean_position_rmse()) < SIGMAS * error
    assert a.mean_position_rmse_stderr() < b.mean_position_rmse_stderr()  # what Louis' identity is for


def enumerated_score(scenario, states, z):
    """``grad log p(z_{1:K} | x_{0:K})`` by differentiating an explicit sum over the joint sequences of all links.

    Joint sequences, not a product over links: independence of the links is tested, too.
    """
    K, links = scenario.steps, scenario.links
    with jax.enable_x64(True):
        p = [np.asarray(a.sight.transitions(scenario.times.intervals)) for a in links]
        p = [sequence_probabilities(a.sight.start, T) for a, T in zip(links, p, strict=True)]
        law = np.array([[(float(n.mean), float(n.std)) for n in a.noises] for a in links])
        r = sequences(K)
        first, second = np.divmod(np.arange(len(r) ** 2), len(r))
        log_p = jnp.log(jnp.asarray(p[0][first] * p[1][second]))
        joint = np.stack([r[first], r[second]], -1)  # [sequences, K, links]
        mean, std = law[[0, 1], joint, 0], law[[0, 1], joint, 1]

        def log_density(x, z):
            distance = jnp.stack([jnp.linalg.norm(x[1:, :2] - a.measurement.anchor, axis=-1) for a in links], -1)
            u = (z - distance - mean) / std
            return jax.scipy.special.logsumexp(log_p + jnp.sum(-0.5 * u**2 - jnp.log(std), (1, 2)))

        score = jax.jit(lambda x, z: jax.lax.map(lambda a: jax.grad(log_density)(*a), (x, z), batch_size=64))
        return np.asarray(score(states, z)).reshape(len(z), -1)


def test_against_the_sum_over_all_mode_sequences():
    """Four steps, two links: 256 joint sequences; the whole information matrix inverted; last step's bound."""
    scenario, n = asymmetric(steps=4), 4
    draws = lb.simulate(scenario, runs=8192, seed=11)
    score = enumerated_score(scenario, draws.states, draws.measurements)
    with jax.enable_x64(True):
        F, Q = np.asarray(scenario.transition), np.asarray(scenario.process_noise)
    J = np.zeros((5 * n, 5 * n))
    J[:n, :n] = np.linalg.inv(prior().covariance)
    for k in range(4):
        T = np.hstack([-F[k], np.eye(n)])
        J[n * k : n * (k + 2), n * k : n * (k + 2)] += T.T @ np.linalg.inv(Q[k]) @ T

    def position_mse(score):
        P = np.linalg.inv(J + score.T @ score / len(score))[-n:, -n:]
        return P[0, 0] + P[1, 1]

    groups = np.split(score, 32)  # jackknife
    left_out = np.array([position_mse(np.concatenate(groups[:g] + groups[g + 1 :])) for g in range(32)])
    enumerated, stderr = position_mse(score), np.sqrt(31 / 32 * np.sum(np.square(left_out - np.mean(left_out))))
    bound = lb.bcrb(scenario, samples=32768, window=4)
    error = np.hypot(stderr, bound.position_mse[-1] * 2 * bound.relative_stderr())
    assert error < 0.02 * enumerated
    assert abs(bound.position_mse[-1] - enumerated) < SIGMAS * error


@pytest.mark.slow
def test_algorithm_1_does_not_underflow():
    """As printed it does near step 35."""
    scenario = one_link(steps=60)
    reference, bound = lb.bcrb_algorithm1(scenario, samples=8192), lb.bcrb(scenario, rtol=2e-3)
    assert np.all(np.isfinite(reference.position_mse))
    error = np.hypot(reference.mean_position_rmse_stderr(), bound.mean_position_rmse_stderr())
    assert abs(reference.mean_position_rmse() - bound.mean_position_rmse()) < SIGMAS * error


def test_algorithm_1_refuses_what_it_cannot_do():
    scenario = asymmetric()
    with pytest.raises(lb.RefusedError, match="invertible"):
        lb.bcrb_algorithm1(scenario.replace(motion=lb.ConstantVelocity(0.4, discrete=True)))
    with pytest.raises(lb.InputError, match="samples is 0"):
        lb.bcrb_algorithm1(scenario, samples=0)
    links = [lb.Link(f"a{i}", a.measurement, a.sight, a.noises) for i, a in enumerate(scenario.links * 6)]
    with pytest.raises(lb.RefusedError, match="4096 joint modes"):
        lb.bcrb_algorithm1(scenario.replace(links=links))
