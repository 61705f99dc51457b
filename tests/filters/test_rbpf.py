import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
import textbook_trackers as textbook
from filter_scenarios import awkward, with_gaps
from locbounds.filters.lowering import lower
from locbounds.filters.resampling import systematic
from locbounds.precision import double_precision

PARTICLES, REPEATS = 2048, 24
STEPS = 4


def short(far: float) -> lb.Scenario:
    """Two links, ranges linear where the anchors are far."""
    scenario = awkward(2, links=2)
    links = [
        lb.Link(a.name, lb.Range(far * np.asarray(a.measurement.anchor)), a.sight, a.noises) for a in scenario.links
    ]
    return scenario.replace(times=lb.Times.uniform(step_s=0.7, steps=STEPS), links=links)


@pytest.mark.parametrize("far", [1.0, 1e5])
def test_converges_to_the_mixture_over_all_sight_sequences(far):
    """With far anchors (ranges linear to 1e-4 m) that is the exact posterior, with near ones the mixture of EKFs."""
    scenario = short(far)
    model = double_precision(lower)(scenario)
    z = lb.simulate(scenario, runs=1, seed=6).measurements
    mean, covariance = textbook.every_sequence(model, z[0])
    found = lb.Rbpf(PARTICLES)(scenario, np.repeat(z, REPEATS, axis=0), seed=2)
    for ours, exact in ((found.mean, mean), (found.covariance, covariance)):
        spread = np.std(ours, axis=0, ddof=1) / np.sqrt(REPEATS)
        scale = np.abs(exact).max(axis=0)
        z_score = np.abs(ours.mean(axis=0) - exact)[1:] / (spread + 1e-6 * scale)[1:]
        assert z_score.max() < 5
        assert np.max(spread[1:] / np.maximum(scale, 1e-9)) < 0.02, "too noisy to see a difference"


def test_agrees_with_particles_one_after_the_other():
    """On average over the particles, with few of them and missing ranges."""
    scenario = short(1.0)
    model = double_precision(lower)(scenario)
    z = with_gaps(lb.simulate(awkward(2, links=2), runs=1, seed=3).measurements)[:, :STEPS]
    rng = np.random.default_rng(8)
    theirs = np.array([textbook.rbpf(model, z[0], 8, rng) for _ in range(60)])
    ours = lb.Rbpf(8)(scenario, np.repeat(z, 400, axis=0)).mean
    centre = ours.mean(0)
    for power in (1, 2):  # resampling shows in the spread
        a, b = (theirs - centre) ** power, (ours - centre) ** power
        error = np.hypot(a.std(0) / np.sqrt(len(a)), b.std(0) / np.sqrt(len(b)))[1:]
        assert np.max(np.abs(a.mean(0) - b.mean(0))[1:] / error) < 5


@pytest.mark.slow
def test_a_track_does_not_depend_on_the_others():
    scenario = awkward(2)
    z = lb.simulate(scenario, runs=20, seed=4).measurements
    filter = lb.Rbpf(16, covariance=False)
    np.testing.assert_allclose(filter(scenario, z[:3], seed=1).mean, filter(scenario, z, seed=1).mean[:3], rtol=1e-9)
    assert np.abs(filter(scenario, z[:3], seed=2).mean - filter(scenario, z[:3], seed=1).mean).max() > 0


def test_systematic_resampling_copies_the_expected_number_rounded_up_or_down():
    rng = np.random.default_rng(0)
    w = rng.dirichlet(np.full(50, 0.2), size=200).T
    w[7] = 0.0
    w /= w.sum(0)
    index = np.asarray(double_precision(lambda w, u: systematic(jnp.asarray(w), jnp.asarray(u)))(w, rng.random(200)))
    copies = np.stack([np.bincount(column, minlength=50) for column in index.T], axis=1)
    assert (np.abs(copies - 50 * w) < 1).all()
    assert (copies[7] == 0).all()
    assert (np.diff(index, axis=0) >= 0).all()
    mean, error = (copies - 50 * w).mean(axis=1), (copies - 50 * w).std(axis=1) / np.sqrt(200)
    assert np.max(np.abs(mean) / np.maximum(error, 1e-9)) < 4.5


@pytest.mark.parametrize("particles", [1, 0, True])
def test_refuses_too_few_particles(particles):
    with pytest.raises(lb.InputError, match="particles"):
        lb.Rbpf(particles)
