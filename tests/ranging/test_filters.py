"""Filters of a distance: moments, the regular model's bound, hard edges, information sets."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from distances import STEPS, cut, model, rss, toa, track
from locbounds.filters import Estimates
from locbounds.noise import Epoch
from locbounds.precision import double_precision
from locbounds.ranging import (
    DistanceEkf,
    DistanceParticles,
    distance_bcrb,
    distance_wwb,
    evaluate_distance,
    measure,
)
from locbounds.ranging.likelihood import table

SIGMAS, RUNS, PARTICLES = 4.0, 160, 1_500


def mean_mse(result):
    """Mean square error over steps 1..K, its standard error, and every run's own."""
    runs = np.mean(np.asarray(result.diagnostics["error_m"])[:, 1:] ** 2, axis=1)
    return runs.mean(), runs.std(ddof=1) / np.sqrt(len(runs)), runs


def test_an_ekf_that_is_linear_has_the_error_it_says():
    """The best linear filter depends on the moments of the noise only: its own variance is its error, exactly."""
    one = model(toa(noise=cut(3.5), common=True))
    result = evaluate_distance(DistanceEkf(), one, runs=RUNS)
    variance = 3.5**2 * 0.7737 / 10 + 9 / 12  # a Gaussian cut at two deviations keeps 77.37 % of its variance
    exact = distance_bcrb(model(toa(bias=None)), given=np.full(STEPS, toa().cycles_per_m ** 2 / variance)).position_mse[
        1:
    ]
    z = measure(one.sensors, np.full((1, STEPS), 20.0))
    np.testing.assert_allclose(DistanceEkf()(one, z).covariance[0, 1:, 0, 0], exact, rtol=1e-4)
    found, error, _ = mean_mse(result)
    assert abs(found - exact.mean()) < SIGMAS * error


@pytest.mark.slow
def test_particles_reach_the_bound_of_the_regular_model():
    """Tracks drawn from the model; the linear filter, whose error is known exactly, takes most of the noise away."""
    regular = model(toa())
    bound = np.mean(distance_bcrb(regular).position_mse[1:])
    _, _, particles = mean_mse(evaluate_distance(DistanceParticles(PARTICLES), regular, runs=RUNS))
    _, _, linear = mean_mse(evaluate_distance(DistanceEkf(), regular, runs=RUNS))
    z = measure(regular.sensors, np.full((1, STEPS), 20.0))
    known = np.mean(DistanceEkf()(regular, z).covariance[0, 1:, 0, 0])
    controlled = particles - (linear - known)
    found, error = controlled.mean(), controlled.std(ddof=1) / np.sqrt(RUNS)
    assert abs(found - bound) < 0.01 * bound + SIGMAS * error
    assert error < 0.02 * bound


def test_particles_of_cut_noise_lie_between_weiss_weinstein_and_the_ekf():
    sharp = model(toa(noise=cut(3.5)))
    particles = evaluate_distance(DistanceParticles(PARTICLES), sharp, runs=RUNS)
    _, _, each = mean_mse(particles)
    _, _, linear = mean_mse(evaluate_distance(DistanceEkf(), sharp, runs=RUNS))
    gain = linear - each
    assert gain.mean() > SIGMAS * gain.std() / np.sqrt(RUNS)
    z = measure(sharp.sensors, np.full((1, STEPS), 20.0))
    known = np.mean(DistanceEkf()(sharp, z).covariance[0, 1:, 0, 0])
    bound = np.mean(distance_wwb(sharp).position_mse[1:])
    assert known - gain.mean() > bound - SIGMAS * gain.std() / np.sqrt(RUNS)
    assert particles.diagnostics["stranded"].shape == (RUNS,)


@pytest.mark.slow
def test_particles_agree_with_a_grid_on_one_signal_strength():
    """One step, cut noise, a curved measurement: the posterior mean on a grid of distances."""
    noise, bias = cut(1.6), cut(3.0)
    one = model(rss(noise=noise, bias=bias, samples=4), times=lb.Times.uniform(step_s=1.0, steps=1))
    z = measure(one.sensors, np.full((32, 1), 18.0), seed=3)
    got = DistanceParticles(PARTICLES)(one, z, 0)
    x = np.linspace(5.0, 45.0, 4_001)
    prior = np.exp(-((x - 20.0) ** 2) / 2 / (4.0 + 0.25 + 0.25 * 0.5625 + 1 / 36))
    values = double_precision(lambda e: (noise + bias).log_prob(jnp.asarray(e)))
    for run in range(8):
        e = z[0][run, 0][:, None] + 25 * np.log10(x)
        p = prior * np.exp(np.asarray(values(e)).sum(0))
        p /= p.sum()
        mean = p @ x
        std = np.sqrt(p @ (x - mean) ** 2)
        assert abs(got.mean[run, 1, 0] - mean) < 5 * std / np.sqrt(PARTICLES * 0.3)
        assert got.covariance[run, 1, 0, 0] == pytest.approx(std**2, rel=0.2)


def test_steps_without_a_particle_in_the_support_are_counted_and_recovered():
    """Truth far outside of what the prior expects: all particles contradict the first samples."""
    sharp = model(toa(noise=cut(0.2), bias=lb.Uniform(0.0, 0.3)))
    far = 20.0 + 30.0 + 0.0 * track()
    result = evaluate_distance(DistanceParticles(PARTICLES), sharp, runs=RUNS, track=far)
    assert np.all(result.diagnostics["stranded"] >= 1)
    assert np.all(np.isfinite(result.diagnostics["error_m"]))
    assert np.all(result.diagnostics["error_m"][:, 1] < 2.0)


@pytest.mark.slow
def test_particles_see_a_common_bias_through_the_mean_of_the_samples():
    shared = model(toa(common=True))
    law = Epoch(lb.Gaussian(0.0, 3.5), lb.Uniform(0.0, 3.0), 10, common=True).as_noise()
    alone = model(toa(noise=law, bias=None, samples=1))
    z = measure(shared.sensors, np.full((32, STEPS), 20.0))
    a = DistanceParticles(200)(shared, z, 1)
    b = DistanceParticles(200)(alone, tuple(s.mean(-1, keepdims=True) for s in z), 1)
    np.testing.assert_allclose(a.mean, b.mean, rtol=1e-6)
    with pytest.raises(lb.RefusedError, match="mean of these samples is not sufficient"):
        DistanceParticles(200)(model(toa(noise=cut(3.5), common=True)), z, 1)


def test_tables_of_likelihoods_keep_hard_edges():
    law = cut(3.5) + lb.Uniform(0.0, 3.0)
    e = np.array([-7.001, -6.9, 0.0, 9.9, 10.001])
    got = np.asarray(double_precision(lambda: table(law).log_prob(jnp.asarray(e)))())
    exact = np.asarray(double_precision(lambda: law.log_prob(jnp.asarray(e)))())
    np.testing.assert_array_equal(np.isfinite(got), [False, True, True, True, False])
    np.testing.assert_allclose(got[1:4], exact[1:4], rtol=1e-3)


class Hindsight:
    """Sees the whole record."""

    id: ClassVar[str] = "hindsight"
    name: ClassVar[str] = "hindsight"
    sees: ClassVar[frozenset[str]] = frozenset({"ranges", "future-ranges"})

    def __call__(self, model, z, seed=0):
        return Estimates(np.zeros((len(z[0]), model.steps + 1, model.size)) + 20.0, None)


def test_a_smoother_is_not_compared_with_a_filtering_bound():
    one = model(toa())
    result = evaluate_distance(Hindsight(), one, runs=4)
    with pytest.raises(lb.RefusedError, match="future"):
        result.efficiency(distance_bcrb(one))
    assert 0 < result.efficiency(distance_bcrb(one, horizon="smooth")).value < 1


def test_bad_numbers_of_runs_and_particles():
    with pytest.raises(lb.InputError, match="number of runs"):
        evaluate_distance(DistanceEkf(), model(toa()), runs=1)
    with pytest.raises(lb.InputError, match="number of particles"):
        DistanceParticles(1)
    with pytest.raises(lb.InputError, match="shape"):
        evaluate_distance(DistanceEkf(), model(toa()), runs=2, track=track()[:-2])
