"""The Cramér-Rao bound of plans: against finite differences, textbook formulas, and what may not change it."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

import locbounds as lb

ANCHORS = np.array([[0.0, 15.0], [-13.0, -7.5], [13.0, -7.5], [2.0, 1.0]])
SPACE = np.array([[0.0, 0, 3], [40, 0, 5], [40, 30, 2], [0, 30, 6], [20, 15, 9]])
POINTS = np.array([[3.0, 4.0], [-6.0, 3.0], [25.0, -8.0]])
HIGH = np.array([[5.0, 7.0, 1.0], [31.0, 12.0, 1.5]])
DIFFERENCED = 1e-6  # relative error of central differences
LARGE = np.array([[2.0, 0.5, 0.1, 0.0], [0.5, 3.0, 0.2, 0.3], [0.1, 0.2, 1.0, -0.4], [0.0, 0.3, -0.4, 2.5]])


def by_differences(h, covariance, points, step=1e-4):
    """CRLB with numerical derivatives of h [points, space] -> [points, channels]."""
    moves = step * np.eye(points.shape[1])
    H = np.stack([(h(points + d) - h(points - d)) / (2 * step) for d in moves], -1)
    return np.linalg.inv(np.einsum("pia,ij,pjb->pab", H, np.linalg.inv(covariance), H))


def lengths(points, anchors=ANCHORS):
    return np.linalg.norm(points[:, None] - anchors, axis=-1)


def angles(points):
    d = points[:, None] - ANCHORS
    return np.arctan2(d[..., 1], d[..., 0])


def differences(points):
    r = lengths(points)
    return np.delete(r, 2, axis=1) - r[:, [2]]


F = np.array([[1.0, 0, -1, 0], [0, 1, -1, 0], [0, 0, -1, 1]])
CASES = {
    "ranges": (lb.toa(ANCHORS, LARGE), lengths, LARGE),
    "differences": (lb.tdoa(ANCHORS, LARGE, reference=2), differences, F @ LARGE @ F.T),
    "strengths": (lb.rss(ANCHORS, LARGE, exponent=2.7), lambda p: 27 * np.log10(lengths(p)), LARGE),
    "angles": (lb.aoa(ANCHORS, 1e-3 * LARGE), angles, 1e-3 * LARGE),
    "range and angle": (
        lb.toa(ANCHORS[:1], 2.0) + lb.aoa(ANCHORS[1:2], 0.1),
        lambda p: np.stack([lengths(p)[:, 0], angles(p)[:, 1]], -1),
        np.diag([4.0, 0.01]),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_any_measurement_with_any_covariance_by_finite_differences(name):
    plan, h, C = CASES[name]
    np.testing.assert_allclose(lb.crlb(plan, POINTS).covariance, by_differences(h, C, POINTS), rtol=DIFFERENCED)


def test_any_function_in_space():
    import jax.numpy as jnp

    C = LARGE[:3, :3]
    h = lambda p: jnp.stack([p[0] * p[1], jnp.sin(p[2]) + p[0], p[1] * p[2]])  # noqa: E731
    plan = lb.observe(h, C, dim=3)

    def same(points):
        x, y, z = points.T
        return np.stack([x * y, np.sin(z) + x, y * z], -1)

    np.testing.assert_allclose(lb.crlb(plan, HIGH).covariance, by_differences(same, C, HIGH), rtol=DIFFERENCED)


def test_the_reference_of_differences_changes_nothing_and_neither_does_an_unknown_clock():
    C = lb.crlb(lb.tdoa(ANCHORS, LARGE), POINTS).covariance
    for plan in (*(lb.tdoa(ANCHORS, LARGE, reference=k) for k in (1, 3)), lb.toa(ANCHORS, LARGE, clock_std_m=np.inf)):
        np.testing.assert_allclose(lb.crlb(plan, POINTS).covariance, C, rtol=1e-10)


def test_a_clock_between_known_and_unknown():
    """A Gaussian offset of deviation s is noise in common: C + s^2 1 1^T."""
    for s in (0.1, 3.0, 100.0):
        clock = lb.crlb(lb.toa(ANCHORS, LARGE, clock_std_m=s), POINTS).covariance
        np.testing.assert_allclose(clock, lb.crlb(lb.toa(ANCHORS, LARGE + s**2), POINTS).covariance, rtol=1e-9)
    known, unknown = (lb.crlb(lb.toa(ANCHORS, LARGE, clock_std_m=s), POINTS).rmse for s in (1e-6, 1e6))
    np.testing.assert_allclose(known, lb.crlb(lb.toa(ANCHORS, LARGE), POINTS).rmse, rtol=1e-6)
    np.testing.assert_allclose(unknown, lb.crlb(lb.tdoa(ANCHORS, LARGE), POINTS).rmse, rtol=1e-6)


def test_turning_the_stations_by_a_third_turns_the_bound():
    star = 15 * np.array([[np.cos(a), np.sin(a)] for a in np.pi / 2 + 2 * np.pi / 3 * np.arange(3)])
    a = 2 * np.pi / 3
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    for make, std in ((lb.toa, 2.0), (lb.tdoa, 2.0), (lb.rss, 3.0), (lb.aoa, 0.1)):
        here, there = lb.crlb(make(star, std), POINTS), lb.crlb(make(star, std), POINTS @ turn.T)
        np.testing.assert_allclose(there.rmse, here.rmse, rtol=1e-9)
        np.testing.assert_allclose(there.covariance, turn @ here.covariance @ turn.T, atol=1e-9 * here.rmse.max() ** 2)


def test_dilutions_of_precision_are_those_of_the_textbook():
    """(A^T A)^-1 with unit vectors and a column of ones (satellite navigation)."""
    d = HIGH[:, None] - SPACE
    A = np.concatenate([d / np.linalg.norm(d, axis=-1, keepdims=True), np.ones((len(HIGH), len(SPACE), 1))], -1)
    Q = np.linalg.inv(np.swapaxes(A, 1, 2) @ A)
    q = np.diagonal(Q, axis1=1, axis2=2)
    found = lb.dop(lb.toa(SPACE, 7.0, clock_std_m=np.inf), HIGH)
    np.testing.assert_allclose(found.gdop, np.sqrt(q.sum(1)), rtol=1e-9)
    np.testing.assert_allclose(found.pdop, np.sqrt(q[:, :3].sum(1)), rtol=1e-9)
    np.testing.assert_allclose(found.hdop, np.sqrt(q[:, :2].sum(1)), rtol=1e-9)
    np.testing.assert_allclose(found.vdop, np.sqrt(q[:, 2]), rtol=1e-9)
    np.testing.assert_allclose(found.tdop, np.sqrt(q[:, 3]), rtol=1e-9)
    np.testing.assert_allclose(found.gdop**2, found.pdop**2 + found.tdop**2)
    weights = np.array([1.0, 4.0, 0.25, 1.0, 2.0])
    Q = np.linalg.inv(np.einsum("pia,i,pib->pab", A, weights, A))
    weighted = lb.dop(lb.toa(SPACE, 7.0, clock_std_m=np.inf), HIGH, weights=weights)
    np.testing.assert_allclose(weighted.gdop, np.sqrt(np.trace(Q, axis1=1, axis2=2)), rtol=1e-9)


def test_dilutions_need_a_common_unit_or_weights():
    mixed = lb.toa(ANCHORS[:2], 2.0) + lb.aoa(ANCHORS[2:], 0.1)
    with pytest.raises(lb.InputError, match="mixes units") as error:
        lb.dop(mixed, POINTS)
    assert "weights" in error.value.remedy
    assert lb.crlb(mixed, POINTS).station_std is None
    with pytest.raises(lb.InputError, match="4 channels"):
        lb.dop(mixed, POINTS, weights=np.ones(3))
    unequal = lb.toa(ANCHORS, np.array([1.0, 2.0, 3.0, 4.0]))
    with pytest.raises(lb.InputError, match="no common deviation"):
        lb.dop(unequal, POINTS)
    np.testing.assert_allclose(lb.dop(unequal, POINTS, std=2.0).pdop, lb.crlb(unequal, POINTS).rmse / 2)


def test_links_that_carry_nothing_when_blocked_are_as_if_they_were_not_there():
    """Qi and Kobayashi: with unknown NLOS errors, the LOS links alone make the bound."""
    blocked = lb.toa(ANCHORS, [lb.Gaussian(0, 2), None, lb.Gaussian(0, 3), lb.Gaussian(0, 2)])
    alone = lb.toa(ANCHORS[[0, 2, 3]], np.array([2.0, 3.0, 2.0]))
    np.testing.assert_allclose(lb.crlb(blocked, POINTS).covariance, lb.crlb(alone, POINTS).covariance, rtol=1e-12)
    r = lengths(POINTS)
    unit = (POINTS[:, None] - ANCHORS) / r[..., None]
    useless = np.diag([1 / 4, 0.0, 1 / 9, 1 / 4])
    expected = np.linalg.inv(np.einsum("pia,ij,pjb->pab", unit, useless, unit))
    np.testing.assert_allclose(lb.crlb(blocked, POINTS).covariance, expected, rtol=1e-10)


def test_soft_sight_is_between_known_sight_and_none():
    los, nlos = lb.Gaussian(0.0, 2.0), lb.Gaussian(8.0, 6.0)
    soft = lb.Mixture([0.6, 0.4], [los, nlos])
    known_los, unknown = (lb.crlb(lb.toa(ANCHORS, law), POINTS).rmse for law in (los, soft))
    left_out = lb.crlb(lb.toa(ANCHORS[:3], los), POINTS).rmse
    told = [los, los, los, soft]
    some = lb.crlb(lb.toa(ANCHORS, told), POINTS).rmse
    assert np.all(known_los < some)
    assert np.all(some < left_out)
    assert np.all(known_los < unknown)
    z = np.linspace(-40, 60, 100_001)
    p, q = 0.6 * norm.pdf(z, 0, 2), 0.4 * norm.pdf(z, 8, 6)
    information = np.sum((p * z / 4 + q * (z - 8) / 36) ** 2 / (p + q)) * (z[1] - z[0])
    np.testing.assert_allclose(unknown, lb.crlb(lb.toa(ANCHORS, information**-0.5), POINTS).rmse, rtol=1e-6)


def test_singular_places_are_marked_with_the_reason():
    line = np.array([[-5.0, 0.0], [5.0, 0.0], [11.0, 0.0]])
    places = np.array([[2.0, 0.0], [2.0, 3.0], [5.0, 0.0], [2.0, 1e-5]])
    found = lb.crlb(lb.toa(line, 1.0), places)
    assert found.status.tolist() == [1, 0, 2, 0]
    assert np.isinf(found.rmse[[0, 2]]).all()
    assert np.isfinite(found.rmse[[1, 3]]).all()
    assert "do not determine" in found.reasons[0]
    assert "at an anchor" in found.reasons[2]
    u, v = np.array([1, -1, -1]), 1e-5 / np.array([7, 3, 9])  # unit vectors along x and y, to first order
    assert found.covariance[3, 1, 1] == pytest.approx(1 / (v @ v - (u @ v) ** 2 / 3), rel=1e-6)
    assert "singular at 2" in str(found)


def test_a_derivative_that_is_not_finite_is_not_called_singular_geometry():
    def angle(p):
        return jnp.arctan(jnp.sqrt(p[0] ** 2 + p[1] ** 2))  # its derivative at the origin is 0/0

    own = lb.toa([[-5.0, 1.0], [5.0, 2.0]], 1.0) + lb.observe(angle, 0.1)
    found = lb.crlb(own, np.array([[0.0, 0.0], [2.0, 3.0]]))
    assert found.status.tolist() == [2, 0]
    assert "a function has no finite one" in found.reasons[0]


def test_differences_behind_the_line_of_two_anchors_are_singular_not_huge():
    line = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]])
    found = lb.crlb(lb.tdoa(line, 1.0), np.array([[40.0, 0.0], [1e5, 1e5], [5.0, 5.0]]))
    assert found.status.tolist() == [1, 0, 0]


def test_a_map_of_many_points_has_no_silent_nan():
    x = np.linspace(-40, 40, 301)
    points = np.stack(np.meshgrid(x, x), -1).reshape(-1, 2)  # more than are computed at once
    for plan in (lb.tdoa(np.vstack([ANCHORS, points[:1]]), 2.0), lb.rss(ANCHORS, 4.0)):
        found = lb.crlb(plan, points)
        for values in (found.rmse, found.cep(), found.mde(), found.quantile(0.95)):
            assert not np.isnan(values).any()
            np.testing.assert_array_equal(np.isfinite(values), found.status == 0)
        index = np.array([0, 17, 45_000, 65_535, 65_536, len(points) - 1])
        np.testing.assert_allclose(found.covariance[index], lb.crlb(plan, points[index]).covariance, rtol=1e-12)


@pytest.mark.parametrize("n", [40])
def test_many_differences_are_the_same_in_any_form(n):
    """The common part of their noise taken out (many), and the whole covariance (any function of the same values)."""
    angle = np.arange(n)
    ring = 50 * np.stack([np.cos(angle), np.sin(angle)], -1) + np.arange(n)[:, None]
    std = 1 + 0.02 * np.arange(n)
    many = lb.tdoa(ring, std, reference=3) + lb.aoa(ring[:2], 0.2)
    x = np.linspace(-30, 30, 121)
    points = np.stack(np.meshgrid(x, x), -1).reshape(-1, 2)  # in blocks
    found = lb.crlb(many, points)
    W = many.accuracy
    expected = np.linalg.inv(np.einsum("pia,ij,pjb->pab", (H := many.gradients(points)), W, H))
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-8, atol=1e-12)


def test_derivatives_with_respect_to_anchors_are_free_of_nan():
    import jax
    import jax.numpy as jnp

    def worst(anchors):
        return jnp.sum(lb.crlb(lb.toa(anchors, 2.0), POINTS).covariance[:, 0, 0])

    with jax.enable_x64(True):
        slope = np.asarray(jax.grad(worst)(jnp.asarray(ANCHORS)))
        step = 1e-5
        moved = np.zeros_like(ANCHORS)
        moved[1, 0] = step
        numerical = (worst(ANCHORS + moved) - worst(ANCHORS - moved)) / (2 * step)
    assert np.isfinite(slope).all()
    assert slope[1, 0] == pytest.approx(float(numerical), rel=1e-5)


def test_plans_without_a_bound_are_refused_with_the_way_out():
    with pytest.raises(lb.RefusedError, match="no finite Fisher information") as error:
        lb.crlb(lb.toa(ANCHORS, lb.Exponential(3.0)), POINTS)
    assert "wwb, ezzb" in error.value.remedy
    with pytest.raises(lb.RefusedError, match="cannot determine"):
        lb.crlb(lb.toa(ANCHORS[:1], 1.0), POINTS)
    with pytest.raises(lb.RefusedError, match="and a clock"):
        lb.crlb(lb.toa(ANCHORS[:2], 1.0, clock_std_m=np.inf), POINTS)
    for points in ([[1.0, np.nan]], [[1.0, 2.0, 3.0]]):
        with pytest.raises(lb.InputError, match="point"):
            lb.crlb(lb.toa(ANCHORS, 1.0), np.array(points))
