"""Functions that jump are found, and no bound that cannot see a jump is given for them."""

import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from locbounds.plan.jumps import black_box_jump

LINE, PLANE = lb.GaussianPrior([0.0], [[4.0]]), lb.UniformBox([0.0, 0.0], [10.0, 6.0])


def observe(h, prior, size=1):
    return lb.observe(h, 0.25 * np.eye(size), dim=prior.dim, prior=prior)


@pytest.mark.parametrize(
    ("h", "prior", "across"),
    [
        (lambda p: 3 * jnp.sign(p[0]), LINE, lambda x: x[0]),
        (lambda p: 50 * jnp.tanh(p[0]) + jnp.where(p[0] > 1, 0.2, 0.0), LINE, lambda x: x[0] - 1),
        (lambda p: jnp.floor(p[0]), LINE, lambda x: x[0] - np.round(x[0])),
        (lambda p: jnp.where(p[0] + p[1] > 7, 5.0, p[0]), PLANE, lambda x: x.sum() - 7),
        (lambda p: jnp.where(jnp.hypot(p[0] - 4, p[1] - 3) < 1, 2.0, 0.0), PLANE,
         lambda x: np.hypot(x[0] - 4, x[1] - 3) - 1),
    ],
)  # fmt: skip
def test_jumps_are_found_where_they_are(h, prior, across):
    found = black_box_jump(observe(h, prior))
    assert found is not None
    assert abs(across(found.place)) < 1e-6


@pytest.mark.parametrize(
    ("h", "prior"),
    [
        (lambda p: jnp.tanh(1e5 * p[0]), LINE),
        (lambda p: jnp.abs(p[0]), LINE),
        (lambda p: jnp.sqrt(jnp.abs(p[0] - 0.3)), LINE),
        (lambda p: 1e6 + p[0], LINE),
        (lambda p: 3.0, LINE),
        (lambda p: jnp.sin(40 * p[0]) * p[1], PLANE),
        (lambda p: jnp.log(jnp.hypot(p[0] - 3, p[1] - 3)), PLANE),
    ],
)
def test_continuous_functions_have_no_jump(h, prior):
    assert black_box_jump(observe(h, prior)) is None


def test_only_jumps_within_the_support_count():
    assert black_box_jump(observe(lambda p: jnp.sign(p[0] + 1) + p[0] * p[1], PLANE)) is None


def test_of_several_values_the_one_that_jumps_is_named():
    plan = observe(lambda p: jnp.stack([p[0], jnp.sign(p[0] - 2)]), LINE, 2)
    assert black_box_jump(plan).channel == 1


def test_bounds_that_miss_a_jump_are_refused():
    plan = observe(lambda p: 3 * jnp.sign(p[0]), LINE)
    for bound in (lb.bcrb, lb.wwb):
        with pytest.raises(lb.RefusedError, match=r"jumps by 6 at \(.*\)"):
            bound(plan)
    least = 4 * (1 - 2 / np.pi)  # the half of the normal law is known, but for one draw in 1e9
    assert lb.ezzb(plan).position_mse[0] < least
    found = lb.mmse(plan, draws=512)
    error, coarse = found.relative_stderr(), found.diagnostics["quadrature_error"]
    assert error < 0.01
    assert coarse < 1e-3
    assert abs(np.sqrt(found.position_mse[0] / least) - 1) < 4 * error + coarse


def test_steep_functions_keep_their_bounds():
    plan = observe(lambda p: 3 * jnp.tanh(20 * p[0]), LINE)
    assert lb.bcrb(plan).verdict.status == "valid"
