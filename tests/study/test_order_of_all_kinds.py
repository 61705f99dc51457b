"""Random scenarios of all kinds: the bound lies below the mean square error of an estimator, whatever the model.

One statistic per scenario, the average over the steps; estimators that are nearly efficient give the comparison its
teeth, and any estimator is admissible.
"""

import math
from typing import NamedTuple

import jax
import numpy as np
import pytest
from scipy.stats import t

import locbounds as lb
import random_scenarios as random
from joint_filters import imm, particles
from locbounds.blocks import GROUPS
from locbounds.bounds.general.engine import PATHS
from locbounds.model import jump_markov
from locbounds.paths import draw_paths

FALSE_ALARM = 1e-3  # for all comparisons of a test together
SAMPLES = GROUPS * PATHS


class Comparison(NamedTuple):
    """A bound and an estimator's mean square error, averaged over steps 1..K, with standard errors."""

    seed: int
    bound: float
    bound_error: float
    mse: float
    mse_error: float

    def excess(self, scale=1.0):
        """By how many standard errors the bound, multiplied by a number, exceeds the mean square error."""
        return (scale * self.bound - self.mse) / math.hypot(scale * self.bound_error, self.mse_error)


def drawn(model, runs, seed):
    """Tracks as the engine draws them, of blocks that it does not use: nothing more is compiled."""
    blocks = [draw_paths(model, np.uint32(seed), np.uint32(1 + b), SAMPLES) for b in range(-(-runs // SAMPLES))]
    x = np.concatenate([np.asarray(block.x) for block in blocks], 1)[:, :runs]
    z = np.concatenate([np.stack(block.z, -1) for block in blocks], 1)[:, :runs]
    reports = np.stack([channel.reports for channel in model.channels], -1)
    return np.moveaxis(x, 1, 0), np.moveaxis(np.where(reports[:, None], z, np.nan), 1, 0)


def of_links(scenario, model, runs, seed):
    """Links that separate, and the library's filter."""
    draws = lb.simulate(scenario, runs=runs, seed=seed)
    return scenario, draws.states, lb.ImmEkf(covariance=False)(scenario, draws.measurements).mean[:, 1:]


def of_joint_modes(scenario, model, runs, seed):
    """The general engine, and the IMM over joint modes."""
    states, z = drawn(model, runs, seed)
    return model, states, imm(model, z)


def of_particles(scenario, model, runs, seed):
    """The engine that the scenario itself chooses, and a particle filter on fewer tracks."""
    states, z = drawn(model, runs // 2, seed)
    return scenario, states, particles(model, z, seed=seed)


KINDS = {
    random.nearly_constant_velocity: of_links,
    random.accelerating: of_links,
    random.heavy_tails: of_particles,
    random.reflected: of_joint_modes,
    random.common_door: of_particles,
    random.manoeuvring: of_joint_modes,
    random.calm_or_rough: of_joint_modes,
}


def compared(kind, seed, runs):
    scenario = kind(seed)
    with jax.enable_x64(True):
        model, states, means = KINDS[kind](scenario, jump_markov(scenario.anonymous()), runs, seed)
    bound = lb.bcrb(model, samples=SAMPLES, window=random.STEPS, seed=seed)
    assert bound.verdict.status.value == "valid"
    error = np.square(scenario.motion.position(means - states[:, 1:])).sum(-1).mean(1)
    groups = [np.asarray(bound.replicates)[:, 1:].mean(1), error.reshape(GROUPS, -1).mean(1) - error.mean()]
    bound_error, mse_error = (math.sqrt((g**2).sum() / (len(g) * (len(g) - 1))) for g in groups)
    return Comparison(seed, float(bound.position_mse[1:].mean()), bound_error, float(error.mean()), mse_error)


def check(kinds, *, runs, broken):
    """No bound is above; and in every kind some would be, if all of them were larger by a constant factor."""
    limit = t.isf(FALSE_ALARM / sum(kinds.values()), df=GROUPS - 1)
    for kind, count in kinds.items():
        comparisons = [compared(kind, seed, runs) for seed in range(count)]
        largest = max(c.excess() for c in comparisons)
        print(f"{kind.__name__}: largest of {count} excesses {largest:.1f}, limit {limit:.1f}")
        assert [c for c in comparisons if not c.excess() < limit] == [], kind.__name__
        assert any(c.excess(broken) > limit for c in comparisons), kind.__name__


def test_the_bound_is_below_the_error_in_40_random_scenarios():
    kinds = {random.nearly_constant_velocity: 30, random.common_door: 10}
    check(kinds, runs=1024, broken=1.2)


@pytest.mark.slow
def test_the_bound_is_below_the_error_in_1000_random_scenarios():
    check(dict.fromkeys(KINDS, 143), runs=4096, broken=1.2)
