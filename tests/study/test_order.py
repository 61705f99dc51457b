"""Every bound lies below the mean square error of every filter that sees no more than the bound assumes."""

import math
from types import SimpleNamespace

import equinox as eqx
import numpy as np
import pytest
from scipy.stats import t

import locbounds as lb

SCENARIOS = 200
STEPS, LINKS, RUNS = 12, 3, 1_024  # one shape for all: compiled once
FALSE_ALARM = 1e-3  # for the whole suite of comparisons
LIMIT = t.ppf(1 - FALSE_ALARM / (SCENARIOS * 7), df=31)  # 32 groups on either side
SEEN = 1.1  # a bound on the RMSE that is too high by this factor


def random_scenario(seed: int) -> lb.Scenario:
    """Geometry from street corner to county, sticky to alternating chains, any start, gentle to rough motion."""
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(1, 4)
    links = []
    for m in range(LINKS):
        los = size * 10 ** rng.uniform(-3, -1)
        nlos = los * rng.uniform(1.0, 5.0)
        bias = los * rng.uniform(0.0, 8.0)
        stay, p = rng.uniform(0.05, 0.98, 2), rng.uniform()
        links.append(
            lb.Link(
                f"a{m}",
                lb.Range(size * rng.uniform(-1, 1, 2)),
                lb.MarkovSight.stay(tuple(stay), start=(p, 1 - p)),
                (lb.Gaussian(0.0, los), lb.Gaussian(bias, nlos)),
                rng.uniform(size=STEPS) < 0.9,
            )
        )
    speed = size * 10 ** rng.uniform(-3, -1.5)
    spread = size * 10 ** rng.uniform(-2, -0.7)
    return lb.Scenario(
        f"random {seed}",
        lb.Times.uniform(step_s=1.0, steps=STEPS),
        lb.ConstantVelocity((speed * rng.uniform(0.05, 1.0)) ** 2),
        lb.GaussianPrior(
            np.append(size * rng.uniform(-1, 1, 2), [0, 0]), np.diag([spread**2, spread**2, speed**2, speed**2])
        ),
        links,
    )


def spread(result) -> float:
    """Standard error of the mean square error averaged over the steps."""
    g = np.asarray(result.replicates).mean(1)
    return math.sqrt((g**2).sum() / (len(g) * (len(g) - 1)))


def excess(bound, filter) -> float:
    """By how many standard errors the bound exceeds the filter's mean square error, averaged over the steps."""
    return float((bound.position_mse.mean() - filter.position_mse.mean()) / math.hypot(spread(bound), spread(filter)))


def seen(bound, filter) -> float:
    """The factor on a filter's RMSE from which on a number is above the limit."""
    return math.sqrt(1 + LIMIT * math.hypot(spread(bound), spread(filter)) / float(filter.position_mse.mean()))


def test_the_statistic_is_in_standard_errors():
    """Results made up from normal groups: equal truths give a t law, a true gap is counted in its units."""
    rng = np.random.default_rng(0)

    def result(mse, std):
        groups = mse + std * rng.normal(size=(32, STEPS))
        return SimpleNamespace(position_mse=groups.mean(0), replicates=groups - groups.mean(0))

    def drawn(ratio):
        return np.array([excess(result(25.0 * ratio, 1.0), result(25.0, 2.0)) for _ in range(4000)])

    error = math.hypot(1.0, 2.0) / math.sqrt(32 * STEPS)
    assert abs(drawn(1.0).mean()) < 4 / math.sqrt(4000)
    assert drawn(1.0).std() == pytest.approx(t(31 + 31).std(), rel=0.06)  # between 31 and 62: at most 2 % apart
    gap = 25.0 * (SEEN**2 - 1) / error
    assert drawn(SEEN**2).mean() == pytest.approx(gap, rel=0.05)


@pytest.mark.slow
def test_no_filter_beats_a_bound_it_is_subject_to():
    comparisons, factors = [], []
    filters = lb.ImmEkf(), lb.FactorisedImmEkf(), lb.ImmKf(), lb.OracleEkf()
    for seed in range(SCENARIOS):
        scenario = random_scenario(seed)
        bounds = [bound(scenario, samples=2048, seed=seed) for bound in (lb.bcrb, lb.enumer)]
        results = [lb.evaluate(f, scenario, runs=RUNS, seed=seed) for f in filters]
        factors.append(seen(bounds[0], results[0]))
        for bound in bounds:
            for result in results:
                if result.sees <= bound.sees:
                    comparisons.append((excess(bound, result), seed, bound.id, result.id))
                else:
                    with pytest.raises(lb.RefusedError):
                        result.efficiency(bound)
    assert len(comparisons) == SCENARIOS * (4 + 3)
    assert [c for c in comparisons if not c[0] < LIMIT] == []
    assert np.median(factors) < SEEN  # more in scenarios where few runs make most of the error


@pytest.mark.slow
def test_a_broken_bound_would_be_caught():
    """The comparison has teeth: an RMSE ten per cent above that of a filter is outside the limit."""
    scenario = random_scenario(0)
    result = lb.evaluate(lb.ImmEkf(), scenario, runs=RUNS, seed=0)
    bound = lb.bcrb(scenario, samples=2048, seed=0)
    scale = SEEN**2 * float(result.position_mse.mean() / bound.position_mse.mean())
    broken = eqx.tree_at(
        lambda r: (r.position_mse, r.replicates), bound, (bound.position_mse * scale, bound.replicates * scale)
    )
    assert excess(broken, result) > LIMIT
    assert seen(broken, result) < SEEN
