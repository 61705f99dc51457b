"""Noise with heavy tails: tables that reach far enough, bounds below the least error by quadrature."""

import numpy as np
import pytest
from scipy import stats

import locbounds as lb
from locbounds.plan.laws import table
from locbounds.precision import double_precision

LENGTH = 20.0
LAWS = {
    "Student t": (lb.StudentT(2.5, 0.0, 1.0), stats.t(2.5)),
    "Cauchy": (lb.StudentT(1.0, 0.0, 1.0), stats.t(1.0)),
    "log-normal": (lb.LogNormal(1.0, 1.0), stats.lognorm(1.0)),
}


def least_mse(law):
    """Of a place in [0, LENGTH] measured once, by sums over places and measurements."""
    x = (np.arange(1000) + 0.5) * LENGTH / 1000
    t = np.linspace(-12.0, 12.0, 4001)
    w = np.sinh(t)  # measurements relative to the middle
    total = 0.0
    for part in np.array_split(np.arange(len(t)), 40):
        joint = law.pdf(w[part, None] + LENGTH / 2 - x) / len(x)
        density = np.maximum(joint.sum(1), 1e-300)
        variance = joint @ x**2 / density - (joint @ x / density) ** 2
        total += np.sum(density * variance * np.cosh(t[part])) * (t[1] - t[0])
    return total


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_bounds_are_below_the_least_error_and_this_agrees_with_sums(name):
    noise, law = LAWS[name]
    plan = lb.observe(lambda p: p[0], [noise], dim=1, prior=lb.UniformBox([0.0], [LENGTH]))
    truth = least_mse(law)
    least = lb.mmse(plan, draws=1024)
    error = 2 * truth * float(least.mean_position_rmse_stderr() / least.mean_position_rmse())
    assert abs(float(least.position_mse[0]) - truth) < 4 * error + 5e-3 * truth
    h = (np.arange(4000) + 0.5) * LENGTH / 4000
    rho, p = (double_precision(lambda f=f: np.asarray(f(noise, h)))() for f in (lb.bhattacharyya, lb.minimum_error))
    twice = double_precision(lambda: np.asarray(lb.bhattacharyya(noise, 2 * h)))()
    kept, both = 1 - h / LENGTH, np.maximum(1 - 2 * h / LENGTH, 0.0)
    by_hand = {
        "wwb": np.max(np.square(h * kept * rho) / (2 * kept - 2 * both * twice)),
        "ezzb": np.sum(h * kept * p) * LENGTH / 4000,
    }
    for bound in (lb.wwb(plan), lb.ezzb(plan)):
        assert bound.verdict.status.value == "valid"
        assert float(bound.position_mse[0]) < truth
        assert float(bound.position_mse[0]) == pytest.approx(by_hand[bound.id], rel=2e-3)


@pytest.mark.parametrize("name", ["Cauchy", "log-normal"])
def test_tables_agree_with_quadrature_between_their_nodes(name):
    noise, _ = LAWS[name]
    made = double_precision(lambda: table(noise, False))()
    d = np.geomspace(1e-3, 1e3, 40)
    rho, p = (double_precision(lambda f=f: np.asarray(f(noise, d)))() for f in (lb.bhattacharyya, lb.minimum_error))
    np.testing.assert_allclose(1 - made.rho(d), 1 - rho, rtol=1e-4)
    np.testing.assert_allclose(made.p_min(d), p, rtol=1e-4, atol=1e-7)


def test_beyond_its_reach_a_table_of_errors_is_not_too_large():
    """The Ziv-Zakai integral grows with it. For two Cauchy laws d apart it is 1/2 - arctan(d / 2) / pi."""
    made = double_precision(lambda: table(lb.StudentT(1.0, 0.0, 1.0), False))()
    d = np.geomspace(1.0, 1e9, 60)
    exact = np.arctan2(2.0, d) / np.pi
    assert np.all(made.p_min(d) <= exact * (1 + 1e-3))
    assert np.any(made.p_min(d) == 0)
    angle = double_precision(lambda: table(lb.StudentT(5.0, 0.0, 0.5), True))()
    assert np.all(angle.p_min(np.array([-np.pi, np.pi])) > 0)
