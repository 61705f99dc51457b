"""The general engine: exact cases, quadrature, and sums over all mode sequences that know nothing of it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from models import CHAIN, START, STEPS, bent, gaussian, information, inverse_with_error, linear, log_step, log_sum
from models import switching as switching_model
from scenarios import asymmetric

EXACT = 1e-9  # relative
SIGMAS = 4.0  # one statistic per test
PRECISION = 0.02  # largest relative standard error of a comparison with an estimate
SAMPLES = 2048  # one block


def stderr(bound, k=-1):
    groups = np.asarray(bound.replicates)[:, k]
    return groups.std(ddof=1) / np.sqrt(len(groups))


def agree(value, error, expected, expected_error=0.0):
    both = np.hypot(error, expected_error)
    assert both < PRECISION * expected
    assert abs(value - expected) < SIGMAS * both + EXACT * expected


# --- one step: x_1 ~ N(+-1/2, 1), z = x_1 +- 1 + w, the two signs together, each with probability 1/2 ---------------

DRIFT, BIAS = 0.5, 1.0


def one_step_by_quadrature():
    """(wrong recipe, bound, MMSE) by two-dimensional trapezoidal sums, which converge exponentially here."""
    x, dx = np.linspace(-10, 10, 401, retstep=True)
    z, dz = np.linspace(-14, 14, 401, retstep=True)
    x, z = x[:, None], z[None, :]
    p = np.array([0.5 * np.exp(-0.5 * ((x - s * DRIFT) ** 2 + (z - x - s * BIAS) ** 2)) / (2 * np.pi) for s in (1, -1)])
    s_x = np.array([-(x - s * DRIFT) + 0 * z for s in (1, -1)])
    s_z = np.array([z - x - s * BIAS for s in (1, -1)])
    both = p.sum(0)
    posterior = p / both
    mean = (x * both).sum(0) / both.sum(0)

    def expect(f):
        return np.sum(f * both) * dx * dz

    wrong = 1.0 + expect(np.sum(posterior * s_z, 0) ** 2)  # information of the known-mode prior plus that of s_z
    right = expect(np.sum(posterior * (s_x + s_z), 0) ** 2)
    return 1 / wrong, 1 / right, expect((x - mean) ** 2)


def test_the_prior_of_the_known_mode_model_plus_the_measurements_score_is_no_bound():
    wrong, right, mmse = one_step_by_quadrature()
    assert (round(wrong, 3), round(mmse, 3)) == (0.617, 0.526)
    assert right < mmse < wrong
    model = switching_model(
        steps=1,
        f=(DRIFT, -DRIFT),
        q=(1.0, 1.0),
        h=lambda x, mode, k: x[0] + (BIAS if mode == 0 else -BIAS),
        noises=(lb.Gaussian(0, 1), lb.Gaussian(0, 1)),
        start=[0.5, 0.5],
        chain=np.full((2, 2), 0.5),
        prior=lb.GaussianPrior([1.0], [[0.0]]),
    )
    bound = lb.bcrb(model, samples=8192)
    agree(bound.position_mse[1], stderr(bound), right)
    assert bound.position_mse[1] < mmse


# --- sums over all sequences ------------------------------------------------------------------------------------------


def test_mode_dependent_dynamics_against_the_sum_over_all_mode_sequences():
    model, n = switching_model(), 16384
    draws = lb.simulate(model, runs=n, seed=7)

    def log_density(x, z):
        whole = log_sum(lambda n, r: log_step(x[n + 1], x[n], z[n], r), START, CHAIN, STEPS)
        return whole + gaussian(x[0], 0.5, np.sqrt(0.8))

    J, groups = information(log_density, draws.states[..., 0], draws.measurements[..., 0])
    bound = lb.bcrb(model, samples=n)
    agree(bound.position_mse[-1], stderr(bound), *inverse_with_error(J, groups, [STEPS]))
    assert "JumpMarkov" in bound.provenance.how


TURN = np.array([[0.8, 0.15, 0.05], [0.1, 0.7, 0.2], [0.3, 0.0, 0.7]])
LAW = np.array([0.6, 0.1, 0.3])
SCALES, SHIFTS = np.array([[1.0, 2.0, 0.7], [0.5, 1.5, 3.0]]), np.array([[0.0, 2.0, -1.0], [0.0, -3.0, 1.0]])


def three_modes():
    """A chain of three modes that two channels share; the motion does not know it."""
    laws = [[lb.Gaussian(m, s) for m, s in zip(*pair, strict=True)] for pair in zip(SHIFTS, SCALES, strict=True)]
    channels = [lb.AdditiveChannel(bent, laws[0]), lb.AdditiveChannel(lambda x, mode, k: 2 * x[0], laws[1])]
    return lb.JumpMarkov(
        times=lb.Times.uniform(step_s=1.0, steps=STEPS),
        prior=lb.GaussianPrior([0.5], [[0.8]]),
        motion=linear(0.9, 0.6),
        channels=channels,
        chains=lb.MarkovSight(LAW, TURN),
    )


@pytest.mark.slow
def test_three_modes_shared_by_two_channels_against_joint_enumeration():
    model, n = three_modes(), 16384
    draws = lb.simulate(model, runs=n, seed=3)
    assert np.array_equal(draws.sight[..., 0], draws.sight[..., 1])

    def log_density(x, z):
        def step(n, r):
            first = gaussian(z[n, 0], bent(x[n + 1][None], r, 0) + SHIFTS[0, r], SCALES[0, r])
            return first + gaussian(z[n, 1], 2 * x[n + 1] + SHIFTS[1, r], SCALES[1, r])

        moves = jnp.sum(gaussian(x[1:], 0.9 * x[:-1], np.sqrt(0.6))) + gaussian(x[0], 0.5, np.sqrt(0.8))
        return log_sum(step, LAW, TURN, STEPS) + moves

    J, groups = information(log_density, draws.states[..., 0], draws.measurements)
    bound = lb.bcrb(model, samples=n)
    agree(bound.position_mse[-1], stderr(bound), *inverse_with_error(J, groups, [STEPS]))


def test_independent_chains_add_up_to_their_joint_chain():
    """Two channels with two modes each, or four joint modes."""
    chains = [lb.MarkovSight([0.2, 0.8], CHAIN), lb.MarkovSight.stay((0.7, 0.9))]
    laws = [(lb.Gaussian(0, 1), lb.Gaussian(2, 2)), (lb.Gaussian(0, 0.5), lb.Gaussian(-1, 2))]
    apart = [lb.AdditiveChannel(lambda x, mode, k: x[0], law, chain=c) for c, law in enumerate(laws)]
    together = [
        lb.AdditiveChannel(lambda x, mode, k: x[0], [laws[0][r // 2] for r in range(4)]),
        lb.AdditiveChannel(lambda x, mode, k: x[0], [laws[1][r % 2] for r in range(4)]),
    ]
    joint = lb.MarkovSight(*(np.kron(*pair) for pair in zip(*[(c.start, c.transition) for c in chains], strict=True)))
    a, b = (
        lb.bcrb(
            lb.JumpMarkov(
                times=lb.Times.uniform(step_s=1.0, steps=STEPS),
                prior=lb.GaussianPrior([0.5], [[0.8]]),
                motion=linear(0.9, 0.6),
                channels=channels,
                chains=c,
            ),
            samples=8192,
        )
        for channels, c in ((apart, chains), (together, joint))
    )
    agree(a.position_mse[-1], stderr(a), b.position_mse[-1], stderr(b))


# --- exact cases ------------------------------------------------------------------------------------------------------


def scalar_kalman(f, q, h, r, P):
    out = [P]
    for k in range(len(f)):
        P = f[k] ** 2 * P + q[k]
        P = 1 / (1 / P + h[k] ** 2 / r[k])
        out.append(P)
    return np.array(out)


def test_known_modes_give_the_kalman_covariance_of_the_motion_that_they_choose():
    modes = np.array([0, 1, 1, 0])
    model = switching_model(h=lambda x, mode, k: (1.0 + mode) * x[0])
    model = lb.JumpMarkov(
        times=model.times,
        prior=model.prior,
        motion=model.motion,
        channels=model.channels,
        chains=lb.KnownSight(modes),
    )
    f, q, h, r = (np.array(pair)[modes] for pair in ((0.9, 0.5), (0.4, 1.5), (1.0, 2.0), (0.49, 2.25)))
    bound = lb.bcrb(model, samples=1)
    np.testing.assert_allclose(bound.position_mse, scalar_kalman(f, q, h, r, 0.8), rtol=EXACT)
    assert stderr(bound) < EXACT


def test_modes_drawn_afresh_are_a_mixture_noise():
    """Independent modes in a linear model: the noise is a Gaussian mixture, and its information a quadrature."""
    law = [0.3, 0.5, 0.2]
    mixture = lb.GaussianMixture(law, [0.0, 2.0, -3.0], [1.0, 1.5, 0.5])
    with jax.enable_x64(True):
        accuracy = float(mixture.information())
    channel = lb.AdditiveChannel(lambda x, mode, k: x[0], [lb.Gaussian(m, s) for m, s in ((0, 1), (2, 1.5), (-3, 0.5))])
    model = lb.JumpMarkov(
        times=lb.Times.uniform(step_s=1.0, steps=STEPS),
        prior=lb.GaussianPrior([0.5], [[0.8]]),
        motion=linear(0.9, 0.6),
        channels=channel,
        chains=lb.MarkovSight.independent(law),
    )
    bound = lb.bcrb(model, samples=8192)
    expected = scalar_kalman(
        np.full(STEPS, 0.9), np.full(STEPS, 0.6), np.ones(STEPS), np.full(STEPS, 1 / accuracy), 0.8
    )
    agree(bound.position_mse[-1], stderr(bound), expected[-1])


def test_modes_of_a_motion_that_all_move_alike_are_no_modes():
    a = lb.bcrb(switching_model(f=(0.9, 0.9), q=(0.4, 0.4)), samples=SAMPLES)
    model = switching_model()
    b = lb.bcrb(
        lb.JumpMarkov(
            times=model.times,
            prior=model.prior,
            motion=linear(0.9, 0.4),
            channels=model.channels,
            chains=model.chains,
        ),
        samples=SAMPLES,
    )
    agree(a.position_mse[-1], stderr(a), b.position_mse[-1], stderr(b))


def test_densities_by_hand_are_the_gaussians_that_they_describe():
    """Motion and prior as functions; the channel, too, is the user's own."""
    model = switching_model()
    motion = lb.DensityMotion(
        lambda new, old, mode, k: gaussian(new[0], (0.9, 0.5)[mode] * old[0], np.sqrt((0.4, 1.5)[mode])),
        lambda key, old, mode, k: (0.9, 0.5)[mode] * old + np.sqrt((0.4, 1.5)[mode]) * jax.random.normal(key, (1,)),
        state_names=("x",),
        position_index=(0,),
        switching=True,
    )
    prior = lb.DensityPrior(
        lambda x: gaussian(x[0], 0.5, np.sqrt(0.8)), lambda key: 0.5 + np.sqrt(0.8) * jax.random.normal(key, (1,))
    )
    channel = lb.DensityChannel(
        lambda z, x, mode, k: gaussian(z, bent(x, mode, k) + (0.0, 1.0)[mode], (0.7, 1.5)[mode]),
        lambda key, x, mode, k: bent(x, mode, k) + (0.0, 1.0)[mode] + (0.7, 1.5)[mode] * jax.random.normal(key),
    )
    own = lb.JumpMarkov(times=model.times, prior=prior, motion=motion, channels=channel, chains=model.chains)
    a, b = lb.bcrb(own, samples=16384), lb.bcrb(model, samples=16384)
    agree(a.position_mse[-1], stderr(a), b.position_mse[-1], stderr(b))
    agree(a.position_mse[0], stderr(a, 0), 0.8)
    assert a.verdict.status.value == "valid under"
    assert "channel 0, the motion, the prior" in str(a.verdict)
    assert a.diagnostics["largest_mean_score"] < 6


def test_a_sampler_of_another_law_is_found_out():
    channel = lb.DensityChannel(
        lambda z, x, mode, k: gaussian(z, x[0], 1.0), lambda key, x, mode, k: 0.3 + x[0] + jax.random.normal(key)
    )
    model = switching_model()
    wrong = lb.JumpMarkov(
        times=model.times, prior=model.prior, motion=model.motion, channels=channel, chains=model.chains
    )
    assert "away from zero" in str(lb.bcrb(wrong, samples=SAMPLES).verdict)


# --- against the other engines ----------------------------------------------------------------------------------------


def test_general_against_separated_engine():
    scenario = asymmetric()
    a = lb.bcrb(lb.jump_markov(scenario), samples=8192, window=12)
    b = lb.bcrb(scenario, samples=8192, window=12)
    error = np.hypot(a.mean_position_rmse_stderr(), b.mean_position_rmse_stderr())
    assert error < 5e-3 * b.mean_position_rmse()
    assert abs(a.mean_position_rmse() - b.mean_position_rmse()) < SIGMAS * error
    assert "separated" in b.provenance.how


@pytest.mark.slow
def test_three_engines_on_table_1():
    scenario = lb.papers.fritsche2013.scenario(stay=0.9)
    bounds = [
        lb.bcrb(lb.jump_markov(scenario), rtol=2e-3),
        lb.bcrb(scenario, rtol=2e-3),
        lb.bcrb_algorithm1(scenario, samples=4096),
    ]
    for other in bounds[1:]:
        error = np.hypot(bounds[0].mean_position_rmse_stderr(), other.mean_position_rmse_stderr())
        assert abs(bounds[0].mean_position_rmse() - other.mean_position_rmse()) < SIGMAS * error


def test_standard_errors_are_the_spread_over_seeds():
    model = switching_model()
    bounds = [lb.bcrb(model, samples=SAMPLES, seed=seed) for seed in range(24)]
    spread = np.std([b.position_mse[-1] for b in bounds], ddof=1)
    claimed = np.sqrt(np.mean([stderr(b) ** 2 for b in bounds]))
    assert 0.55 < spread / claimed < 1.5  # chi^2 with 23 degrees of freedom: false alarm below 1e-3


def test_noise_without_information_is_refused_in_any_model():
    model = switching_model(noises=(lb.Gaussian(0, 1), lb.Uniform(-1, 1)))
    with pytest.raises(lb.RefusedError, match="channel 0 has no finite Fisher information"):
        lb.bcrb(model)
