"""Reported standard errors against the spread over seeds: many seeds of a tiny scenario, one compiled shape each."""

from functools import partial

import numpy as np
import pytest
from scipy import stats

import locbounds as lb
from scenarios import asymmetric

SEEDS = 480
GROUPS = 32
BLOCK = 2048  # noise paths
STEPS = 3
FALSE_ALARM = 1e-4  # two-sided, for each comparison: below 1e-3 together
SEEN = 1.15  # an error that is wrong by this factor is outside, whatever the method
ROUNDING = 1e-9

REPORTS = np.array([[1, 1], [1, 0], [1, 1]], bool)


@pytest.fixture(scope="module")
def scenario():
    return asymmetric(steps=STEPS, reports=REPORTS)


def errors(results):
    return np.array([float(r.mean_position_rmse_stderr()) for r in results])


def limits(of_spread, of_errors):
    """Of the ratio of two deviations that estimate the same, by their degrees of freedom."""
    law = stats.f(of_spread, of_errors)
    low, high = np.sqrt(law.ppf([FALSE_ALARM / 2, 1 - FALSE_ALARM / 2]))
    assert 1 / SEEN < low < high < SEEN
    return low, high


def calibrated(results, groups=GROUPS):
    values = np.array([float(r.mean_position_rmse()) for r in results])
    assert len(set(values)) == len(results)
    ratio = values.std(ddof=1) / np.sqrt(np.mean(errors(results) ** 2))
    low, high = limits(SEEDS - 1, SEEDS * (groups - 1))
    assert low < ratio < high


BOUNDS = {  # functions of the seed; the model is the same one for all, so that nothing is compiled anew
    "bcrb": lambda s: partial(lb.bcrb, s, samples=1, window=STEPS),
    "enumer": lambda s: partial(lb.enumer, s, samples=1),
    "los-only": lambda s: partial(lb.los_only, s, samples=1),
    "algorithm 1": lambda s: partial(lb.bcrb_algorithm1, s, samples=1),
    "corrected": lambda s: partial(lb.bcrb, s, samples=1, window=2, engine="corrected"),
    "predict": lambda s: partial(lb.bcrb, s, samples=1, window=STEPS, horizon="predict:1"),
    "smooth": lambda s: partial(lb.bcrb, s, samples=1, window=STEPS, horizon="smooth"),
    "general": lambda s: partial(lb.bcrb, lb.jump_markov(s), samples=1, window=STEPS),
}


def results(method, scenario):
    bound = BOUNDS[method](scenario)
    return [bound(seed=seed) for seed in range(SEEDS)]


@pytest.fixture(scope="module")
def many(scenario):
    return results("bcrb", scenario)


def test_spread_over_seeds_is_the_standard_error(many):
    calibrated(many)


@pytest.mark.slow
@pytest.mark.parametrize("method", list(BOUNDS)[1:])
def test_spread_over_seeds_is_the_standard_error_of_every_bound(scenario, method):
    calibrated(results(method, scenario))


@pytest.mark.parametrize("method", [*list(BOUNDS)[:3], pytest.param("algorithm 1", marks=pytest.mark.slow)])
def test_replicates_are_deviations_from_the_mean(scenario, method):
    r = BOUNDS[method](scenario)(seed=0)
    assert r.replicates.shape == (GROUPS, STEPS + 1)
    assert np.abs(r.replicates.mean(0)).max() < 0.02 * np.abs(r.replicates).max()  # up to second order
    assert np.all(r.replicates[:, 0] == 0)
    assert r.mean_position_rmse_stderr() <= r.position_rmse_stderr.values.mean() * (1 + ROUNDING)


def test_sixteen_times_the_samples_quarter_the_error(scenario, many):
    """Mean squares of the errors of many seeds, so that one that falls by three or by five is outside."""
    more = [lb.bcrb(scenario, samples=16 * BLOCK, window=STEPS, seed=seed) for seed in range(SEEDS, SEEDS + 25)]
    ratio = np.sqrt(np.mean(errors(many) ** 2) / np.mean(errors(more) ** 2)) / 4
    low, high = limits(SEEDS * (GROUPS - 1), len(more) * (GROUPS - 1))
    assert low < ratio < high


@pytest.mark.slow
def test_spread_over_seeds_is_the_standard_error_of_the_least_error():
    plan = lb.toa([[-10.0, 0.0], [10.0, 3.0]], 2.0, prior=lb.UniformDisc([0.0, 0.0], 6.0))
    calibrated([lb.mmse(plan, draws=256, seed=seed) for seed in range(SEEDS)], groups=16)
