"""Every bound lies below the mean square error of every filter that sees no more than the bound assumes."""

import math

import numpy as np
import pytest

import locbounds as lb

SCENARIOS = 200
STEPS, LINKS, RUNS = 12, 3, 1_024  # one shape for all: compiled once
FALSE_ALARM = 1e-3  # for the whole suite of comparisons


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


def excess(bound: lb.Result, filter: lb.Result) -> float:
    """By how many standard errors the bound exceeds the filter's mean square error, averaged over the steps."""
    gap = bound.position_mse.mean() - filter.position_mse.mean()
    groups = [np.asarray(r.replicates).mean(1) for r in (bound, filter)]
    variance = sum((g**2).sum() / (len(g) * (len(g) - 1)) for g in groups)
    return float(gap / math.sqrt(variance))


@pytest.mark.slow
def test_no_filter_beats_a_bound_it_is_subject_to():
    from scipy.stats import t

    comparisons = []
    filters = lb.ImmEkf(), lb.FactorisedImmEkf(), lb.ImmKf(), lb.OracleEkf()
    for seed in range(SCENARIOS):
        scenario = random_scenario(seed)
        bounds = [bound(scenario, samples=2048, seed=seed) for bound in (lb.bcrb, lb.enumer)]
        results = [lb.evaluate(f, scenario, runs=RUNS, seed=seed) for f in filters]
        for bound in bounds:
            for result in results:
                if result.sees <= bound.sees:
                    comparisons.append((excess(bound, result), seed, bound.id, result.id))
                else:
                    with pytest.raises(lb.RefusedError):
                        result.efficiency(bound)
    limit = t.ppf(1 - FALSE_ALARM / len(comparisons), df=31)  # 32 groups on either side
    assert len(comparisons) == SCENARIOS * (4 + 3)
    assert [c for c in comparisons if not c[0] < limit] == []


@pytest.mark.slow
def test_a_broken_bound_would_be_caught():
    """The comparison has teeth: ten per cent above the error of a filter is far outside."""
    scenario = random_scenario(0)
    result = lb.evaluate(lb.ImmEkf(), scenario, runs=RUNS, seed=0)
    bound = lb.bcrb(scenario, samples=2048, seed=0)
    scale = 1.5 * float(result.position_mse.mean() / bound.position_mse.mean())
    import equinox as eqx

    broken = eqx.tree_at(lambda r: r.position_mse, bound, bound.position_mse * scale)
    assert excess(broken, result) > 6
