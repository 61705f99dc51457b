"""Sight chains: orientation, continuous time, starts, bad input."""

import jax
import numpy as np
import pytest
from scipy.linalg import expm

import locbounds as lb

ROUNDING = 1e-12
INTERVALS = np.array([0.01, 0.5, 3.0, 1000.0])


def transitions(sight, intervals):
    with jax.enable_x64(True):
        return np.asarray(sight.transitions(intervals))


def test_rows_are_the_sight_now_and_columns_the_next_one():
    chain = lb.MarkovSight.stay((0.9, 0.6))
    np.testing.assert_allclose(chain.transition, [[0.9, 0.1], [0.4, 0.6]], atol=ROUNDING)
    np.testing.assert_allclose(chain.start, [0.8, 0.2], atol=ROUNDING)  # stationary: 0.8 * 0.1 = 0.2 * 0.4
    np.testing.assert_allclose(transitions(chain, np.ones(3)), [chain.transition] * 3, atol=ROUNDING)


def test_dwell_times_are_the_exponential_of_the_generator():
    sight = lb.DwellSight(None, [3.0, 0.8])
    G = np.array([[-1 / 3.0, 1 / 3.0], [1 / 0.8, -1 / 0.8]])
    expected = [expm(G * dt) for dt in INTERVALS]
    np.testing.assert_allclose(transitions(sight, INTERVALS), expected, atol=ROUNDING)
    np.testing.assert_allclose(sight.start @ expected[2], sight.start, atol=ROUNDING)
    two = transitions(sight, np.array([0.7, 1.1, 1.8]))
    np.testing.assert_allclose(two[0] @ two[1], two[2], atol=ROUNDING)


def test_short_intervals_keep_their_relative_precision():
    leave = transitions(lb.DwellSight(None, [1e6, 1e3]), np.array([1e-9]))[0]
    assert leave[0, 1] == pytest.approx(1e-15, rel=1e-6)
    assert leave[1, 0] == pytest.approx(1e-12, rel=1e-6)


def test_known_sight_moves_with_certainty_whatever_the_start():
    rows = transitions(lb.KnownSight([0, 1, 1]), np.ones(3))
    np.testing.assert_array_equal(rows[:, 0], rows[:, 1])
    np.testing.assert_array_equal(rows[:, 0, 1], [0, 1, 1])


def test_larger_chains_and_reducible_ones_have_a_start():
    T = np.array([[0.5, 0.3, 0.2], [0.1, 0.8, 0.1], [0.3, 0.3, 0.4]])
    start = lb.MarkovSight(None, T).start
    np.testing.assert_allclose(start @ T, start, atol=ROUNDING)
    np.testing.assert_allclose(lb.MarkovSight.stay(1.0).start, [0.5, 0.5], atol=ROUNDING)
    np.testing.assert_allclose(lb.MarkovSight.stay((1.0, 0.5)).start, [1.0, 0.0], atol=ROUNDING)


@pytest.mark.parametrize(
    "build, match",
    [
        (lambda: lb.MarkovSight([0.5, 0.5], [[0.9, 0.2], [0.1, 0.9]]), "sum to one"),
        (lambda: lb.MarkovSight([0.5, 0.4], [[0.9, 0.1], [0.1, 0.9]]), "sum to one"),
        (lambda: lb.MarkovSight([0.5, 0.5], [[1.1, -0.1], [0.1, 0.9]]), "negative"),
        (lambda: lb.MarkovSight([0.5, 0.5], [[0.9, 0.1]]), "square"),
        (lambda: lb.MarkovSight([1.0], [[0.9, 0.1], [0.1, 0.9]]), "shape"),
        (lambda: lb.MarkovSight.stay(1.5), "from 0 to 1"),
        (lambda: lb.MarkovSight.stay(np.nan), "nan"),
        (lambda: lb.DwellSight(None, [0.0, 1.0]), "positive"),
        (lambda: lb.DwellSight(None, [-1.0, 1.0]), "positive"),
        (lambda: lb.DwellSight(None, [np.inf, 1.0]), "positive"),
        (lambda: lb.DwellSight([0.7, 0.7], [1.0, 1.0]), "sum to one"),
        (lambda: lb.KnownSight([0, 2]), "0 .LOS. or 1"),
        (lambda: lb.KnownSight([0.5]), "0 .LOS. or 1"),
        (lambda: transitions(lb.KnownSight([0, 1]), np.ones(3)), "2 steps, the scenario 3"),
        (lambda: transitions(lb.MarkovSight.stay(0.9), np.array([1.0, 2.0])), "dwell"),
    ],
)
def test_chains_that_are_none_are_input_errors(build, match):
    with pytest.raises(lb.InputError, match=match):
        build()


@pytest.mark.parametrize("stay", [1.5, -0.1, float("nan"), (0.9, 2.0)])
def test_a_stay_that_is_no_probability_is_named_as_it_was_given(stay):
    with pytest.raises(lb.InputError, match=r"keeping the sight is .*from 0 to 1") as caught:
        lb.MarkovSight.stay(stay)
    assert str(stay) in caught.value.cause
