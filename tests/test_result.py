"""Results: averages and their errors, comparisons that make sense and those that are refused."""

import dataclasses

import numpy as np
import pytest

import locbounds as lb
from locbounds.quadrature import deviations, standard_error
from locbounds.result import Provenance, Result, format_with_error
from locbounds.verdict import Status, Verdict

VALID = Verdict(Status.VALID, ("by construction",))
ROUNDING = 1e-12
SIGMAS = 4.0


def result(mse=(4.0, 1.0, 9.0), *, kind="bound", id="bcrb", sees=("ranges",), scale=0.1, seed=0, **changes):
    mse = np.array(mse)
    spread = np.random.default_rng(seed).normal(size=(16, len(mse))) * scale
    fields = {
        "id": id,
        "name": id.upper(),
        "kind": kind,
        "sees": frozenset(sees),
        "time_s": np.arange(len(mse)) * 0.5,
        "position_mse": mse,
        "replicates": spread - spread.mean(0),
        "covariance": np.zeros((len(mse), 4, 4)),
        "verdict": VALID,
        "provenance": Provenance(seed=0, samples=16, how="by hand", references=()),
    }
    return Result(**fields | changes)


def test_the_average_is_of_roots_and_includes_the_prior():
    r = result()
    assert r.mean_position_rmse() == pytest.approx((2 + 1 + 3) / 3)
    assert r.mean_position_rmse(first_step=1) == pytest.approx((1 + 3) / 2)
    for step in (-1, 3):
        with pytest.raises(lb.InputError, match="first_step"):
            r.mean_position_rmse(step)


def test_the_error_of_an_average_is_that_of_the_average():
    r = result()
    influence = (r.replicates / (2 * np.sqrt(r.position_mse))).mean(1)
    expected = np.sqrt(np.sum(influence**2) / (16 * 15))
    assert r.mean_position_rmse_stderr() == pytest.approx(expected, rel=ROUNDING)
    per_step = np.sqrt((r.replicates**2).sum(0) / (16 * 15)) / (2 * np.sqrt(r.position_mse))
    np.testing.assert_allclose(r.position_rmse_stderr, per_step, rtol=ROUNDING)
    assert r.relative_stderr() == pytest.approx((per_step / np.sqrt(r.position_mse)).max(), rel=ROUNDING)


def test_one_group_or_a_zero_has_no_error():
    exact = result(mse=(0.0, 1.0), replicates=np.zeros((1, 2)))
    assert exact.mean_position_rmse_stderr() == 0
    assert exact.relative_stderr() == 0
    assert "+-" not in str(exact)


def test_standard_errors_are_those_of_numpy():
    groups = np.random.default_rng(1).normal(size=(20, 3))
    mean, deviation = deviations(groups)
    np.testing.assert_allclose(mean, groups.mean(0), rtol=1e-6)
    np.testing.assert_allclose(standard_error(groups - groups.mean(0)), groups.std(0, ddof=1) / np.sqrt(20))
    assert deviation.shape == groups.shape


def test_results_are_immutable_and_labelled():
    r = result()
    with pytest.raises(dataclasses.FrozenInstanceError):
        r.position_mse = np.zeros(3)  # pyright: ignore[reportAttributeAccessIssue]
    assert r.position_rmse.dims == ("step",)
    assert r.position_rmse.attrs["units"] == "m"
    np.testing.assert_array_equal(r.position_rmse.time_s, [0.0, 0.5, 1.0])
    data = r.to_dataset()
    assert data.attrs["seed"] == 0
    assert data.attrs["sees"] == "ranges"
    np.testing.assert_array_equal(data.position_mse, r.position_mse)


def filter_result(mse=(4.0, 2.0, 10.0), **changes):
    return result(mse, kind="filter", id="imm-ekf", seed=1, **changes)


def test_efficiency_is_a_ratio_of_mean_square_errors_with_an_interval():
    value = filter_result().efficiency(result())
    assert value.value == pytest.approx(14 / 16)
    assert value.low < value.value < value.high
    spreads = [standard_error(r.replicates.mean(1)) / r.position_mse.mean() for r in (result(), filter_result())]
    assert np.log(value.high / value.value) == pytest.approx(1.959964 * np.hypot(*spreads), rel=1e-6)
    assert np.log(value.value / value.low) == pytest.approx(1.959964 * np.hypot(*spreads), rel=1e-6)


@pytest.mark.parametrize(
    "estimator, bound, match",
    [
        ({}, {"kind": "filter"}, "not a filter"),
        ({"kind": "bound"}, {}, "not a bound"),
        ({"sees": ("ranges", "sight")}, {}, "sees sight, which BCRB assumes to be unknown"),
        ({}, {"id": "los-only", "sees": ("los-ranges", "sight")}, "sees ranges"),
        ({}, {"track": "a walk"}, "a walk"),
        ({"track": "a walk"}, {}, "random tracks"),
        ({}, {"verdict": Verdict(Status.REFUSED, ("no",))}, "refused"),
        ({}, {"time_s": np.array([0.0, 0.5, 1.1])}, "time steps"),
        ({"scenario": "one"}, {"scenario": "another"}, "another scenario"),
    ],
)
def test_pairs_that_do_not_match_are_refused(estimator, bound, match):
    estimate = result(id="f", **{"kind": "filter"} | estimator)
    with pytest.raises(lb.RefusedError, match=match):
        estimate.efficiency(result(**bound))


def test_a_result_without_a_scenario_is_compared_as_before():
    for mine, theirs in (("", "one"), ("one", ""), ("one", "one")):
        assert filter_result(scenario=mine).efficiency(result(scenario=theirs)).value < 1


def test_a_bound_that_assumes_more_knowledge_bounds_both_kinds_of_filters():
    enumer = result(id="enumer", sees=("ranges", "sight"))
    assert filter_result().efficiency(enumer).value < 1
    assert filter_result(sees=("ranges", "sight")).efficiency(enumer).value < 1


def test_tightest_shows_all_that_cannot_be_told_apart():
    a = result((4.0, 1.00, 9.0), id="bcrb")
    error = a.mean_position_rmse_stderr()
    near = result((4.0, 1.00, 9.0), id="near", seed=2)
    small = result((4.0, 0.25, 4.0), id="enumer", seed=3)
    refused = result((9.0, 9.0, 9.0), id="known-sight", verdict=Verdict(Status.REFUSED, ("no",)))
    conditional = result((9.0, 9.0, 9.0), id="los-only", verdict=Verdict(Status.CONDITIONAL, ("if",)))
    found = lb.tightest([small, near, refused, conditional, filter_result(), a])
    assert {b.id for b in found} == {"bcrb", "near"}
    assert small.mean_position_rmse() < a.mean_position_rmse() - SIGMAS * error
    assert lb.tightest([refused, conditional]) == []
    means = [b.mean_position_rmse() for b in found]
    assert means == sorted(means, reverse=True)


def test_numbers_are_printed_to_two_digits_of_their_error():
    assert format_with_error(51.2345, 0.034) == "51.234 +- 0.034 m"
    assert format_with_error(51.2345, 2.0) == "51.2 +- 2.0 m"
    assert format_with_error(512.345, 34.0) == "512 +- 34 m"
