"""Bounds against their definitions, summed over grids by code that shares nothing with them."""

import numpy as np
import pytest
import shapely
from scipy.special import logsumexp

import locbounds as lb
import static_by_hand as by_hand
from locbounds.static import support as supports
from locbounds.static.pair_laws import GaussianPairs, wrapped_log_affinity
from locbounds.static.plan_laws import pair_law, support_of
from locbounds.static.weiss_weinstein_kernel import bound_matrices, grams, with_exponent
from locbounds.static.ziv_zakai_kernel import along

GRID = 5e-3  # of sums over cells: their edge is a staircase
COARSE = 2e-2  # of those over few cells
ANCHORS = np.array([[0.0, 5.0], [-4.3, -2.5], [4.3, -2.5]])
L_SHAPE = shapely.Polygon([(0, 0), (9, 0), (9, 3), (3, 3), (3, 9), (0, 9)])
H = np.diag([1.6, 1.6])  # whole cells


def ranges(std):
    return lambda p: np.linalg.norm(p[:, None] - ANCHORS, axis=-1) / std


def in_disc(p):
    return np.sum(p**2, axis=1) < 36.0


def in_l(p):
    return shapely.contains_xy(L_SHAPE, p[:, 0], p[:, 1])


AREAS = {
    "disc": (lb.UniformDisc([0.0, 0.0], 6.0), in_disc, [-6, -6], [6, 6]),
    "not convex": (lb.UniformPolygon(list(L_SHAPE.exterior.coords)), in_l, [0, 0], [9, 9]),
}


@pytest.mark.slow
@pytest.mark.parametrize("area", AREAS)
@pytest.mark.parametrize("std", [0.7, 3.0])
def test_both_bounds_on_an_area(area, std):
    prior, inside, low, high = AREAS[area]
    affinity, error = by_hand.gaussian(ranges(std))
    plan = lb.toa(ANCHORS, std, prior=prior)
    support, law = support_of(prior, plan.anchors), pair_law(plan)
    points = by_hand.grid(inside, low, high, 0.04)
    slow = by_hand.weiss_weinstein(points, 0.04, inside, affinity, H)
    np.testing.assert_allclose(bound_matrices(H, grams(support, law, [H], 12, [1.0])[0])[0], slow, rtol=GRID, atol=2e-3)
    a = np.array([0.6, 0.8])
    points = by_hand.grid(inside, low, high, 0.08)
    slow = by_hand.ziv_zakai(points, inside, error, a, 14.0, cells=150)
    quick = along(support, law, a, 12, [1.0], rtol=1e-3).mse_m2[0]
    assert quick == pytest.approx(slow, rel=4 * GRID)


SMALL = 3.0  # radius of a disc that no anchor is in


def in_small_disc(p):
    return np.sum(p**2, axis=1) < SMALL**2


def differences(std):
    """Times without their mean: the same knowledge as all differences."""
    times = ranges(std)
    return lambda p: times(p) - times(p).mean(1, keepdims=True)


def strengths(std):
    metres = ranges(1.0)
    return lambda p: 30 * np.log10(metres(p)) / std


def bearings(p):
    gap = p[:, None] - ANCHORS
    return np.arctan2(gap[..., 1], gap[..., 0])


KINDS = {
    "ToA": (lb.toa, 2.0, by_hand.gaussian(ranges(2.0))),
    "TDoA": (lb.tdoa, 2.0, by_hand.gaussian(differences(2.0))),
    "RSS": (lb.rss, 6.0, by_hand.gaussian(strengths(6.0))),
    "AoA": (lb.aoa, 0.6, by_hand.wrapped(bearings, 0.6)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_both_bounds_of_every_kind_of_measurement(kind):
    """Root mean square errors within two per cent of sums over few cells; the bounds' own grid is another."""
    make, std, (affinity, error) = KINDS[kind]
    plan = make(ANCHORS, std, prior=lb.UniformDisc([0.0, 0.0], SMALL))
    (level,) = lb.bounds_over_noise(plan, [1.0], printed=False, rtol=2e-3)
    points = by_hand.grid(in_small_disc, [-SMALL] * 2, [SMALL] * 2, 0.05)
    slow = by_hand.weiss_weinstein(points, 0.05, in_small_disc, affinity, level.length_m * np.eye(2))
    assert level.wwb_m == pytest.approx(np.sqrt(np.trace(slow)), rel=COARSE)
    points = by_hand.grid(in_small_disc, [-SMALL] * 2, [SMALL] * 2, 0.15)
    slow = sum(by_hand.ziv_zakai(points, in_small_disc, error, a, 2 * SMALL, cells=40) for a in np.eye(2))
    assert level.ezzb_m == pytest.approx(np.sqrt(slow), rel=COARSE)
    nothing = SMALL / np.sqrt(2)  # the prior's own error
    assert 0.3 * nothing < level.wwb_m < nothing
    assert 0.3 * nothing < level.ezzb_m < nothing


def test_an_area_that_is_not_convex_is_not_treated_as_if_it_were():
    """With theta left free, midpoints outside the L would count, and the number would not be a bound."""
    prior, inside, low, high = AREAS["not convex"]
    nothing = GaussianPairs.of(lambda p: np.zeros((len(p), 1)), np.eye(1))
    far = np.array([[3.2], [-3.2]])
    q = grams(support_of(prior), nothing, [far], 12, [1.0])[0].q[0, 0, 0]
    points = by_hand.grid(inside, low, high, 0.02)
    up, down = inside(points + far[:, 0]), inside(points - far[:, 0])
    assert q == pytest.approx(np.mean(up) + np.mean(down) - 2 * np.mean(up & down), rel=GRID)


@pytest.mark.parametrize("exponent", [0.5, 0.35, 0.7])
def test_weiss_weinstein_from_densities_over_positions_and_measurements(exponent):
    L, std, step, dz = 2.0, 0.6, 0.01, 0.02
    theta = np.arange(step / 2, L, step)
    z = np.arange(-4, 8, dz)
    joint = by_hand.joint_in_one_dimension(lambda t: np.full(len(t), 1 / L), np.square, std, theta, z)
    slow = by_hand.weiss_weinstein_from_densities(joint, [40, 90], exponent, step, dz)
    law = GaussianPairs.of(np.square, std**2 * np.eye(1))
    tests = np.array([[0.4, 0.9]])
    gram = with_exponent(supports.box([0.0], [L]), law, [tests], exponent, 24, [1.0])[0]
    assert bound_matrices(tests, gram)[0, 0, 0] == pytest.approx(slow, rel=1e-3)
    if exponent == 0.5:
        gram = grams(supports.box([0.0], [L]), law, [tests], 24, [1.0])[0]
        assert bound_matrices(tests, gram)[0, 0, 0] == pytest.approx(slow, rel=1e-3)


def test_least_error_of_a_line():
    L, std, step, dz = 2.0, 0.6, 0.004, 0.01
    theta, z = np.arange(step / 2, L, step), np.arange(-4, 8, dz)
    joint = by_hand.joint_in_one_dimension(lambda t: np.full(len(t), 1 / L), np.square, std, theta, z)
    slow = by_hand.least_error(joint, theta, step, dz)
    plan = lb.observe(lambda p: p[0] ** 2, std**2, dim=1, prior=lb.UniformBox([0.0], [L]))
    quick = lb.mmse(plan, rtol=2e-3)
    assert abs(quick.position_rmse.values[0] / np.sqrt(slow) - 1) < 4 * quick.relative_stderr() + 1e-3
    for bound in (lb.wwb(plan), lb.ezzb(plan)):
        assert bound.position_mse[0] < slow


@pytest.mark.slow
@pytest.mark.parametrize("std", [0.8, 4.0])
def test_least_error_of_two_ranges(std):
    slow = by_hand.least_error_of_two_ranges(
        by_hand.grid(in_disc, [-6, -6], [6, 6], 0.2), ANCHORS[:2], std, min(0.25, std / 4)
    )
    quick = lb.mmse(lb.toa(ANCHORS[:2], std, prior=AREAS["disc"][0]), rtol=2e-3)
    assert abs(quick.position_mse[0] / slow - 1) < 8 * quick.relative_stderr() + GRID


@pytest.mark.parametrize("std", [0.1, 0.5, 1.8, 2.5])
def test_wrapped_normal_laws(std):
    x = np.arange(20_000) / 20_000 * 2 * np.pi
    turns = 2 * np.pi * np.arange(-30, 31)

    def log_density(w):
        return logsumexp(-0.5 * ((w[:, None] + turns) / std) ** 2, axis=1) - np.log(std * np.sqrt(2 * np.pi))

    for d in (0.1, 2.0, 3.1):
        slow = logsumexp(0.5 * (log_density(x - np.pi) + log_density(x - np.pi - d))) + np.log(x[1])
        assert wrapped_log_affinity(np.array([d]), std)[0] == pytest.approx(slow, rel=1e-6)


def test_valley_filling_helps_with_a_periodic_measurement():
    """A phase: places a wavelength apart look the same, those between do not."""
    wave = 0.7
    import jax.numpy as jnp

    def phase(p):
        return jnp.array([jnp.cos(2 * jnp.pi * p[0] / wave), jnp.sin(2 * jnp.pi * p[0] / wave)])

    plan = lb.observe(phase, 0.05 * np.eye(2), dim=1, prior=lb.UniformBox([0.0], [2.0]))
    kept = lb.ezzb(plan, valley_filling=False)
    filled = lb.ezzb(plan)
    least = lb.mmse(plan, rtol=5e-3)
    assert (
        1.3 * kept.position_mse[0] < filled.position_mse[0] < least.position_mse[0] * (1 + 8 * least.relative_stderr())
    )
