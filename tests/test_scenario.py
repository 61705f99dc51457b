"""Scenarios and times: what fits together and what does not."""

import numpy as np
import pytest

import locbounds as lb
from scenarios import STEPS, asymmetric, mask, prior


def link(**changes):
    fields = {
        "name": "a",
        "measurement": lb.Range([0.0, 0.0]),
        "sight": lb.MarkovSight.stay(0.9),
        "noises": (lb.Gaussian(0.0, 1.0), lb.Gaussian(2.0, 2.0)),
    }
    return lb.Link(**fields | changes)


def scenario(links, **changes):
    fields = {"times": lb.Times.uniform(step_s=1.0, steps=3), "motion": lb.ConstantVelocity(1.0), "prior": prior()}
    return lb.Scenario("t", **fields | changes, links=links)


@pytest.mark.parametrize(
    "build, match",
    [
        (lambda: scenario([]), "no anchors"),
        (lambda: scenario([link(), link()]), "repeat"),
        (lambda: scenario([link()], motion=lb.ConstantVelocity(1.0, dim=3)), "prior has 4 components"),
        (lambda: scenario([link(measurement=lb.Range([0.0, 0.0, 1.0]))]), "3 coordinates"),
        (lambda: scenario([link(noises=(lb.Gaussian(0.0, 1.0),))]), "1 noises for 2"),
        (lambda: scenario([link(reports=np.ones(4, bool))]), "4 steps"),
        (lambda: lb.Range([0.0]), "anchor position"),
        (lambda: lb.Range([0.0, np.nan]), "anchor position"),
        (lambda: lb.GaussianPrior(np.zeros(4), np.diag([1.0, 1.0, 1.0, -1.0])), "positive semidefinite"),
        (lambda: lb.GaussianPrior(np.zeros(4), np.eye(3)), "shape"),
        (lambda: lb.GaussianPrior([0.0, np.inf, 0.0, 0.0], np.eye(4)), "mean"),
        (lambda: lb.Times([0.0]), "0 steps"),
        (lambda: lb.Times([0.0, 1.0, 1.0]), "step 2"),
        (lambda: lb.Times([0.0, 2.0, 1.0]), "increasing"),
        (lambda: lb.Times([0.0, np.nan, 1.0]), "finite"),
        (lambda: lb.Times.uniform(step_s=0.0, steps=3), "step is 0"),
        (lambda: lb.Times.uniform(step_s=1.0, steps=0), "number of steps is 0"),
    ],
)
def test_pieces_that_do_not_fit_are_input_errors(build, match):
    with pytest.raises(lb.InputError, match=match) as caught:
        build()
    assert caught.value.remedy


def test_masks_and_known_sight_make_new_scenarios():
    base = asymmetric()
    reports = mask(STEPS, 2)
    np.testing.assert_array_equal(base.with_reports(reports).reports, reports)
    assert base.reports.all()
    known = base.with_known_sight(np.arange(STEPS) % 2)
    np.testing.assert_array_equal(known.links[1].sight.modes, np.arange(STEPS) % 2)
    with pytest.raises(lb.InputError, match="known sight schedule"):
        base.with_known_sight(np.full(STEPS, 2))


def test_a_chain_per_step_refuses_irregular_times_in_bounds_and_draws():
    irregular = asymmetric(steps=3).with_times(np.array([0.0, 0.5, 0.6, 3.0]))
    for call in (lb.bcrb, lb.enumer, lambda s: lb.simulate(s, runs=1)):
        with pytest.raises(lb.InputError, match="dwell"):
            call(irregular)


def test_a_range_is_a_distance_with_a_unit_gradient_and_none_at_the_anchor():
    import jax

    with jax.enable_x64(True):
        h = lb.Range([1.0, 2.0, 3.0])
        x = np.array([3.0, 5.0, 9.0])
        assert float(h(x)) == pytest.approx(7.0)
        np.testing.assert_allclose(jax.grad(h)(x), np.array([2.0, 3.0, 6.0]) / 7, rtol=1e-14)
        np.testing.assert_array_equal(jax.grad(h)(h.anchor), 0.0)
