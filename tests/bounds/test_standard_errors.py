"""Reported standard errors against the spread over seeds."""

import numpy as np
import pytest
from scipy import stats

import locbounds as lb
from scenarios import STEPS, asymmetric, mask

SEEDS = 40
FALSE_ALARM = 2e-4  # two-sided, for each of four methods: below 1e-3 together
ROUNDING = 1e-9


@pytest.fixture(scope="module")
def scenario():
    return asymmetric(reports=mask(STEPS, 2))


@pytest.mark.parametrize(
    "bound",
    [
        lambda s, seed: lb.bcrb(s, samples=1, window=STEPS, seed=seed),
        lambda s, seed: lb.enumer(s, samples=1, seed=seed),
        lambda s, seed: lb.los_only(s, samples=1, seed=seed),
        lambda s, seed: lb.bcrb_algorithm1(s, samples=1, seed=seed),
    ],
    ids=["bcrb", "enumer", "los-only", "algorithm 1"],
)
def test_spread_over_seeds_is_the_standard_error(scenario, bound):
    results = [bound(scenario, seed) for seed in range(SEEDS)]
    values = np.array([r.mean_position_rmse() for r in results])
    errors = np.array([r.mean_position_rmse_stderr() for r in results])
    # each error has 31 degrees of freedom itself: an F law
    ratio = values.var(ddof=1) / np.mean(errors**2)
    law = stats.f(SEEDS - 1, SEEDS * 31)
    assert law.ppf(FALSE_ALARM / 2) < ratio < law.ppf(1 - FALSE_ALARM / 2)
    for r in results[:3]:
        assert r.replicates.shape == (32, STEPS + 1)
        spread = np.abs(r.replicates).max()
        assert np.abs(r.replicates.mean(0)).max() < 0.02 * spread  # deviations from the mean, up to second order
        assert np.all(r.replicates[:, 0] == 0)
        assert r.mean_position_rmse_stderr() <= r.position_rmse_stderr.values.mean() * (1 + ROUNDING)


def test_sixteen_times_the_samples_quarter_the_error(scenario):
    few, many = lb.bcrb(scenario, samples=2048, window=STEPS), lb.bcrb(scenario, samples=32768, window=STEPS)
    ratio = few.mean_position_rmse_stderr() / many.mean_position_rmse_stderr()
    # ratio of two deviations with 31 degrees of freedom each, whose truth is 4
    assert stats.f(31, 31).cdf((ratio / 4) ** 2) == pytest.approx(0.5, abs=0.4999)
