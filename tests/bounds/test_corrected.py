"""The corrected engine: against exact covariances and the full window, where plain windows fail, and what it keeps."""

import importlib

import jax
import numpy as np
import pytest

import locbounds as lb
from locbounds.bounds.all_lags import corrected_bound
from locbounds.result import tightest
from scenarios import STEPS, Linear, asymmetric, kalman, mask, prior

ROUNDING = 1e-7  # relative; exact identities up to the ridge of 1e-10 and its square root
SIGMAS = 4.0
SAMPLES = 2048


def apart(a, b):
    """Difference of the mean position RMSE after the prior, and its standard error."""
    error = np.hypot(a.mean_position_rmse_stderr(1), b.mean_position_rmse_stderr(1))
    return a.mean_position_rmse(1) - b.mean_position_rmse(1), error


def test_linear_measurements_and_known_sight_give_the_kalman_covariance():
    """Singular process noise and prior, missing ranges, steps of different length; one window is as good as another."""
    modes = np.random.default_rng(3).integers(0, 2, (STEPS, 2))
    reports = mask(STEPS, 2)
    gradients = np.array([[1.0, 0.5], [-0.2, 2.0]])
    links = [
        lb.Link(f"a{m}", Linear(g), lb.KnownSight(modes[:, m]), (lb.Gaussian(0, 3), lb.Gaussian(4, 9)), reports[:, m])
        for m, g in enumerate(gradients)
    ]
    times = lb.Times(np.cumsum([0.0, *np.random.default_rng(0).uniform(0.1, 3.0, STEPS)]))
    start = lb.GaussianPrior([0, 0, 0, 0], np.diag([100.0, 50.0, 0.0, 1.0]))
    scenario = lb.Scenario("linear", times, lb.ConstantVelocity([0.4, 0.0], discrete=True), start, links)
    with jax.enable_x64(True):
        F, Q = np.asarray(scenario.transition), np.asarray(scenario.process_noise)
    rows = [
        [([*gradients[m], 0, 0], (3.0, 9.0)[modes[k, m]] ** 2) for m in range(2) if reports[k, m]] for k in range(STEPS)
    ]
    expected = kalman(F, Q, start.covariance, [[(np.array(h), r) for h, r in row] for row in rows])
    bound = lb.bcrb(scenario, samples=1, window=3, engine="corrected")
    np.testing.assert_allclose(bound.covariance, expected, rtol=ROUNDING, atol=ROUNDING)
    assert bound.mean_position_rmse_stderr() < ROUNDING
    assert bound.diagnostics["truncation"] < ROUNDING


@pytest.fixture(scope="module")
def scenario():
    return asymmetric(reports=mask(STEPS, 2))


@pytest.fixture(scope="module")
def bound(scenario):
    return lb.bcrb(scenario, samples=4 * SAMPLES, window=2, engine="corrected")


def test_asymmetric_chains_against_the_full_window(scenario, bound):
    difference, error = apart(bound, lb.bcrb(scenario, samples=8 * SAMPLES, window=STEPS))
    assert abs(difference) < SIGMAS * error
    assert "corrected engine, because it was asked for" in bound.provenance.how


def test_table_one_against_the_full_window_and_the_papers_recursion():
    scenario = lb.papers.fritsche2013.scenario(0.95, steps=STEPS)
    full = lb.bcrb(scenario, samples=8 * SAMPLES, window=STEPS)
    bound = lb.bcrb(scenario, samples=2 * SAMPLES, window=2, engine="corrected")
    difference, error = apart(bound, full)
    assert abs(difference) < SIGMAS * error
    plain = lb.bcrb_block_tridiagonal(scenario, samples=2 * SAMPLES)
    loss = plain.position_rmse.values / full.position_rmse.values - 1
    error = np.hypot(full.position_rmse_stderr, plain.position_rmse_stderr) / full.position_rmse.values
    assert abs(loss[-1] - plain.diagnostics["loss"][-1]) < SIGMAS * error[-1]
    assert plain.diagnostics["loss"][-1] > SIGMAS * error[-1]
    assert plain.verdict.status.value != "valid"
    assert "no bound" in str(plain.verdict)


def test_three_modes_along_a_track():
    T = [[0.9, 0.08, 0.02], [0.2, 0.7, 0.1], [0.05, 0.05, 0.9]]
    noises = (lb.Gaussian(0, 3), lb.Gaussian(5, 3), lb.Gaussian(12, 6))
    link = lb.Link("a", lb.Range([-60.0, -20.0]), lb.MarkovSight([0.2, 0.5, 0.3], T), noises)
    scenario = lb.Scenario(
        "three", lb.Times.uniform(step_s=0.5, steps=STEPS), lb.ConstantVelocity(0.4), prior(), [link]
    )
    track = lb.AlongTrack(np.linspace([5.0, 10.0], [20.0, -10.0], STEPS + 1))
    full = lb.bcrb(scenario, samples=8 * SAMPLES, window=STEPS, expectation=track)
    bound = lb.bcrb(scenario, samples=4 * SAMPLES, window=2, expectation=track, engine="corrected")
    difference, error = apart(bound, full)
    assert abs(difference) < SIGMAS * error
    assert bound.track == full.track


def slow_target(stay):
    """Weakly separated modes and a target that hardly moves."""
    noises = (lb.Gaussian(0.0, 3.0), lb.Gaussian(5.0, 3.0))
    links = [
        lb.Link(f"a{m}", lb.Range(anchor), lb.MarkovSight.stay(stay), noises)
        for m, anchor in enumerate([(-300.0, -20.0), (30.0, 400.0)])
    ]
    start = lb.GaussianPrior([0.0, 0.0], np.diag([400.0, 400.0]))
    return lb.Scenario("slow", lb.Times.uniform(step_s=0.5, steps=24), lb.RandomWalk(0.02), start, links)


@pytest.mark.parametrize(
    "stay, sign",
    [pytest.param(0.03, 1, marks=pytest.mark.slow), (0.97, -1)],
    ids=["alternating", "sticky"],
)
def test_a_plain_window_goes_wrong_by_percents_and_the_corrected_value_does_not(stay, sign):
    scenario = slow_target(stay)
    full = lb.bcrb(scenario, samples=4 * SAMPLES, window=24)
    plain = lb.bcrb(scenario, samples=4 * SAMPLES, window=1)
    bound = lb.bcrb(scenario, samples=4 * SAMPLES, window=1, engine="corrected")
    wrong, error = apart(plain, full)
    assert sign * wrong > 0.04 * full.mean_position_rmse(1) + SIGMAS * error
    difference, error = apart(bound, full)
    assert difference < SIGMAS * error
    assert difference > -0.05 * abs(wrong) - SIGMAS * error
    assert full.verdict.status.value == bound.verdict.status.value == "valid"
    assert plain.verdict.status.value == "valid under"
    assert "window of 1 of 24 steps" in str(plain.verdict)
    assert not any(chosen is plain for chosen in tightest([plain, full]))
    reported = abs(plain.position_rmse.values / full.position_rmse.values - 1).max()
    assert bound.diagnostics["truncation"] == pytest.approx(reported, rel=0.2)


def test_a_row_does_not_depend_on_what_comes_later(scenario, bound):
    reports = scenario.reports.copy()
    reports[6:] = ~reports[6:]
    other = lb.bcrb(scenario.with_reports(reports), samples=4 * SAMPLES, window=2, engine="corrected")
    np.testing.assert_array_equal(other.covariance[:7], bound.covariance[:7])
    assert np.all(other.position_mse[7:] != bound.position_mse[7:])


def test_windows_share_draws_and_agree_to_second_order(scenario, bound):
    """Both lie below the same bound; the draws are the same, so that hardly any sampling error is between them."""
    other = lb.bcrb(scenario, samples=4 * SAMPLES, window=1, engine="corrected")
    difference = np.abs(other.position_rmse.values / bound.position_rmse.values - 1).max()
    assert difference < max(r.diagnostics["remainder"] for r in (bound, other))


def carried_and_streamed(steps):
    """Bytes that the recursion over steps carries, and those that it reads and writes."""
    scenario = asymmetric(steps=steps).anonymous()
    with jax.enable_x64(True):
        traced = jax.make_jaxpr(
            lambda: corrected_bound(
                scenario, lb.Prior(), np.uint32(0), np.uint32(0), np.zeros((steps + 1, 4, 4)),
                groups=32, paths=16, pilot=32, window=2,
            )
        )()  # fmt: skip
    (call,) = [e for e in traced.eqns if "jaxpr" in e.params]
    scans = [e for e in call.params["jaxpr"].eqns if e.primitive.name == "scan" and e.params["length"] == steps + 1]
    (scan,) = [e for e in scans if e.params["num_carry"] > 3]
    fixed, carry = scan.params["num_consts"], scan.params["num_carry"]
    size = [v.aval.size * v.aval.dtype.itemsize for v in scan.invars]
    out = sum(v.aval.size * v.aval.dtype.itemsize for v in scan.outvars[carry:])
    return sum(size[fixed : fixed + carry]), sum(size[:fixed]) + sum(size[fixed + carry :]) + out


def test_memory_is_that_of_the_models_numbers_and_of_the_result():
    short, long = carried_and_streamed(20), carried_and_streamed(40)
    assert short[0] == long[0]
    assert long[1] <= 2 * short[1]
    assert long[1] / 41 < 4000  # per step; one number of every draw would be 16 kB


def test_long_scenarios_get_it_by_themselves(scenario, bound, monkeypatch):
    module = importlib.import_module("locbounds.bounds.bcrb")
    assert module.too_large(scenario, None) is None
    ten_thousand = scenario.with_times(0.5 * np.arange(10_001))
    assert "10,000 steps and 2 different noises" in str(module.too_large(ten_thousand, None))
    monkeypatch.setattr(module, "MOST_BYTES", 1.0)
    same = lb.bcrb(scenario, samples=4 * SAMPLES, window=2)
    np.testing.assert_array_equal(same.covariance, bound.covariance)
    assert "because tables of 12 steps" in same.provenance.how


def test_bad_options_are_refused(scenario):
    with pytest.raises(lb.InputError, match="engine is 'fast'"):
        lb.bcrb(scenario, engine="fast")
    with pytest.raises(lb.InputError, match="window is 0"):
        lb.bcrb(scenario, window=0, engine="corrected")
    shared = scenario.replace(links=[link.replace(chain="c", sight=scenario.links[0].sight) for link in scenario.links])
    with pytest.raises(lb.InputError, match="does not take this model"):
        lb.bcrb(shared, engine="corrected")
    with pytest.raises(lb.RefusedError, match="share a chain"):
        lb.bcrb_block_tridiagonal(shared)


@pytest.mark.slow
def test_the_window_grows_until_the_remainder_is_small():
    scenario = slow_target(0.03)
    grown = lb.bcrb(scenario, rtol=1e-3, engine="corrected")
    assert grown.diagnostics["window"] > 2
    assert grown.diagnostics["remainder"] <= 1e-4
    assert grown.relative_stderr() <= 1e-3
