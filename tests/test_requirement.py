import numpy as np
import pytest
from scipy.stats import binomtest

import locbounds as lb
from locbounds.requirement import E911, Decision, Requirement, comply, parse


def test_parses():
    assert parse(E911) == parse("E911") == (Requirement(100.0, 0.67), Requirement(300.0, 0.95))
    assert parse(" 1.5 km@50% ,20cm @ 90 %") == (Requirement(1500.0, 0.5), Requirement(0.2, 0.9))


@pytest.mark.parametrize(
    "text", ["", "100", "100 m", "100 m @ 67", "100 ft @ 67 %", "1e m @ 5 %", "-5 m @ 50 %", "5 m @ 100 %", "5 m @ 0 %"]
)
def test_refuses_what_it_cannot_read(text):
    with pytest.raises(lb.InputError, match="requirement"):
        parse(text)


def test_independent_errors_give_nearly_the_exact_binomial_interval():
    errors = np.r_[np.ones(170), 9 * np.ones(31)][:, None]
    (found,) = comply("5 m @ 80 %", errors)
    exact = binomtest(170, 201).proportion_ci(0.95)
    assert found.share == pytest.approx(170 / 201)
    assert (found.low, found.high) == pytest.approx((exact.low, exact.high), abs=2e-3)


@pytest.mark.parametrize("alike", [False, True])
def test_the_interval_covers_the_truth_also_where_errors_within_a_run_are_dependent(alike):
    """At least 95 % in theory; 300 trials, so that 92 % is missed with a probability below 1e-2 at exactly 95 %."""
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(300):
        level = rng.standard_normal((25, 1)) if alike else 0.0
        errors = np.exp(level + rng.standard_normal((25, 40)))
        truth = 0.5
        (found,) = comply([Requirement(1.0, 0.5)], errors)
        inside += found.low <= truth <= found.high
    assert inside / 300 > 0.92


def test_decisions():
    few, many = np.full((2, 1000), 50.0), np.full((200, 10), 50.0)
    assert [c.decision for c in comply(E911, few)] == [Decision.UNDECIDED] * 2  # two runs say little
    assert [c.decision for c in comply(E911, many)] == [Decision.PASS] * 2
    assert comply("10 m @ 5 %", many)[0].decision is Decision.FAIL
    assert comply("100 m @ 50 %", many * np.nan)[0].decision is Decision.FAIL  # lost tracks are never dropped
    assert "pass (100 % within" in str(comply("100 m @ 67 %", many)[0])
    with pytest.raises(lb.InputError, match="no errors"):
        comply(E911, [])
