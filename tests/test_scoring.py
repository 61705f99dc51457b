"""Scores of estimates that were made elsewhere: the same numbers as ``evaluate``, and readable refusals."""

import numpy as np
import pytest

import locbounds as lb
from locbounds.evaluation import evaluate_on
from locbounds.result import Efficiency
from locbounds.scoring import verdict
from scenarios import STEPS, asymmetric

RUNS = 60


@pytest.fixture(scope="module")
def scenario():
    return asymmetric()


@pytest.fixture(scope="module")
def bound(scenario):
    return lb.bcrb(scenario, samples=1)


@pytest.fixture(scope="module")
def draws(scenario):
    return lb.simulate(scenario, runs=RUNS, seed=4)


@pytest.fixture(scope="module")
def imm(scenario, draws):
    return lb.ImmEkf()(scenario, draws.measurements)


def test_a_score_is_what_evaluate_says_of_the_same_runs(scenario, bound, draws, imm):
    mine = lb.score(imm.mean, draws, bound, scenario=scenario, covariance=imm.covariance)
    theirs = lb.evaluate(lb.ImmEkf(), scenario, runs=RUNS, seed=4)
    np.testing.assert_allclose(mine.result.position_mse, theirs.position_mse, rtol=1e-12)
    np.testing.assert_allclose(mine.result.diagnostics["nees"], theirs.diagnostics["nees"], rtol=1e-9)
    assert str(mine.efficiency) == str(theirs.efficiency(bound))


def test_numbers_of_different_scenarios_are_not_compared(scenario, bound, draws, imm):
    theirs = lb.evaluate(lb.ImmEkf(), scenario, runs=RUNS, seed=4)
    links = [lb.Link(f"x{m}", a.measurement, a.sight, a.noises, a.reports) for m, a in enumerate(scenario.links)]
    again = scenario.replace(title="the same", links=links, times=lb.Times(np.array(scenario.times.time_s)))
    assert lb.bcrb(again, samples=1).scenario == bound.scenario == theirs.scenario != ""
    assert bound.to_dataset().attrs["scenario"] == bound.scenario
    always_nlos = scenario.with_known_sight(np.ones(STEPS, int))
    oracle = lb.evaluate(lb.OracleEkf(), scenario, runs=RUNS, seed=4)
    with pytest.raises(lb.RefusedError, match="another scenario"):
        oracle.efficiency(lb.known_sight(always_nlos, samples=1))
    told = lb.evaluate(lb.OracleEkf(), always_nlos, runs=RUNS, seed=4)
    told.efficiency(lb.known_sight(always_nlos, samples=1))
    draws_of_nlos = lb.simulate(always_nlos, runs=RUNS, seed=4)
    evaluate_on(lb.OracleEkf(), scenario, draws_of_nlos).efficiency(lb.known_sight(always_nlos, samples=1))
    other = scenario.replace(links=[a.replace(sight=lb.MarkovSight.stay(0.2)) for a in scenario.links])
    with pytest.raises(lb.RefusedError, match="another scenario"):
        theirs.efficiency(lb.bcrb(other, samples=1))
    with pytest.raises(lb.RefusedError, match="another scenario"):
        lb.score(imm.mean, draws, bound, scenario=other)


def test_efficiency_by_hand(bound, draws, imm):
    mine = lb.score(imm.mean[..., :2], draws.states[..., :2], bound)
    square = ((imm.mean - draws.states)[..., :2] ** 2).sum(-1)
    assert mine.efficiency.value == pytest.approx(np.mean(bound.position_mse) / square.mean(), rel=1e-12)
    groups = np.array([part.mean() for part in np.array_split(square, 32)])
    spread = groups.std(ddof=1) / np.sqrt(32) / square.mean()
    assert np.log(mine.efficiency.high / mine.efficiency.value) == pytest.approx(1.96 * spread, rel=0.1)


def test_step_0_may_be_left_out(scenario, bound, draws, imm):
    whole = lb.score(imm.mean, draws, bound, scenario=scenario).result
    short = lb.score(imm.mean[:, 1:], draws, bound, scenario=scenario).result
    np.testing.assert_allclose(short.position_mse, whole.position_mse, rtol=1e-12)
    guessed = lb.score(imm.mean[:, 1:, :2], draws.states[..., :2], bound).result  # the mean of the truth instead
    np.testing.assert_array_equal(guessed.position_mse[1:], whole.position_mse[1:])
    assert guessed.position_mse[0] == pytest.approx(whole.position_mse[0], rel=0.2)


def test_one_that_sees_the_truth_is_caught(scenario, bound, draws):
    cheat = draws.states + np.random.default_rng(0).normal(0, 0.1, draws.states.shape)
    assert "BELOW" in lb.score(cheat, draws, bound, scenario=scenario).verdict


def test_one_that_looks_at_other_runs_is_warned(scenario, bound, draws, imm):
    (warning,) = lb.score(imm.mean[::-1], draws, bound, scenario=scenario).result.verdict.warnings
    assert "worse than never looking at the ranges" in warning


def test_verdicts_say_what_the_interval_says(bound, draws, imm):
    result = lb.score(imm.mean[..., :2], draws.states[..., :2], bound).result
    cases = {"as good as": (0.95, 0.9, 1.01), "close to": (0.95, 0.92, 0.98), "at most 60%": (0.5, 0.4, 0.6)}
    for words, numbers in cases.items():
        assert words in verdict(result, bound, Efficiency(*numbers))


def nan_at(values, *where):
    values = np.array(values)
    values[where] = np.nan
    return values


@pytest.mark.parametrize(
    ("change", "options", "match"),
    [
        (lambda m: m[:-1], {}, "estimates of 59 runs, but 60 true tracks"),
        (lambda m: np.swapaxes(m, 0, 1), {}, "swap the first two"),
        (lambda m: m[:, 2:], {}, f"have {STEPS - 1} steps, the bound the steps 0..{STEPS}"),
        (lambda m: m[..., :3], {}, "3 components.*states .4: x_m, y_m, vx_m_s, vy_m_s"),
        (lambda m: m[0], {}, r"for one run add an axis in front"),
        (lambda m: nan_at(m, 7, 3, 0), {}, "estimates at run 7, step 3 are not finite"),
        (lambda m: nan_at(m, slice(7, 9), 3, 0)[:, 1:], {}, r"run 7, step 3 \(and 1 more\) are not finite"),
        (lambda m: 1e3 * m, {}, "look like millimetres"),
        (lambda m: m / 1e3, {}, "look like kilometres"),
        (lambda m: m / 0.3048, {}, "look like feet"),
        (lambda m: m[..., [1, 0]], {}, "x and y swapped"),
        (lambda m: [["a"]], {}, "not an array of numbers"),
        (lambda m: m, {"sees": ("sight",)}, "sees .*ranges"),
        (lambda m: m, {"sees": "ranges"}, "sees 'ranges'"),
        (lambda m: m, {"covariance": np.ones((2, 2))}, r"covariances have the shape \(2, 2\)"),
        (lambda m: m[..., :2], {"covariance": np.ones((2, 2))}, "whole states"),
    ],
)
def test_bad_estimates_are_named(scenario, bound, draws, change, options, match):
    good = draws.states + np.random.default_rng(0).normal(0, 0.01, draws.states.shape)  # far closer than any unit
    with pytest.raises(lb.InputError, match=match):
        lb.score(change(good), draws, bound, scenario=scenario, **options)


def test_states_need_a_scenario(bound, draws, imm):
    with pytest.raises(lb.InputError, match="scenario="):
        lb.score(imm.mean, draws.states, bound)


def test_a_filter_told_the_sight_needs_a_bound_that_knows_it(scenario, bound, draws, imm):
    with pytest.raises(lb.RefusedError, match="sees sight"):
        lb.score(imm.mean, draws, bound, scenario=scenario, sees=("ranges", "sight"))
