"""The separated engine: exact special cases, invariances, orders that are theorems."""

import importlib

import jax
import numpy as np
import pytest

import locbounds as lb
from locbounds.bounds.recursion import GivenIncrements, covariance_recursion
from scenarios import STEPS, Linear, asymmetric, kalman, mask, noise_of, prior

ROUNDING = 1e-9  # relative; exact identities through some hundred operations
SIGMAS = 4.0
SAMPLES = 2048  # one block


def kalman_reference(scenario, std):
    """The Kalman covariances of a scenario with linear measurements, noise deviations [steps, links]."""
    with jax.enable_x64(True):
        F, Q = np.asarray(scenario.transition), np.asarray(scenario.process_noise)
    n, reports = scenario.motion.state_size, scenario.reports
    rows = [
        [
            (np.pad(link.measurement.anchor, (0, n - scenario.dim)), std[k, m] ** 2)
            for m, link in enumerate(scenario.links)
            if reports[k, m]
        ]
        for k in range(scenario.steps)
    ]
    return kalman(F, Q, scenario.prior.covariance, rows)


def linear(modes, times, motion, prior, reports):
    noises = (lb.Gaussian(0.0, 3.0), lb.Gaussian(4.0, 9.0))
    gradients = np.array([[1.0, 0.5, -0.3], [-0.2, 2.0, 0.4]])[:, : motion.dim]
    links = [
        lb.Link(f"a{m}", Linear(g), lb.KnownSight(modes[:, m]), noises, reports[:, m]) for m, g in enumerate(gradients)
    ]
    return lb.Scenario("linear", times, motion, prior, links)


LINEAR = {
    "irregular times, singular Q, missing ranges": (
        lb.Times(np.cumsum([0.0, *np.random.default_rng(0).uniform(0.1, 3.0, STEPS)])),
        lb.ConstantVelocity([0.4, 0.0], discrete=True),
        prior(),
    ),
    "space, singular prior, missing ranges": (
        lb.Times.uniform(step_s=0.5, steps=STEPS),
        lb.ConstantVelocity(0.2, dim=3),
        lb.GaussianPrior(np.zeros(6), np.diag([100.0, 50.0, 0.0, 1.0, 0.0, 4.0])),
    ),
}


@pytest.mark.parametrize("case", LINEAR)
def test_linear_measurements_and_known_sight_give_the_kalman_covariance(case):
    times, motion, start = LINEAR[case]
    modes = np.random.default_rng(3).integers(0, 2, (STEPS, 2))
    scenario = linear(modes, times, motion, start, mask(STEPS, 2))
    expected = kalman_reference(scenario, np.where(modes == 0, 3.0, 9.0))
    for bound in (lb.known_sight(scenario, samples=1), lb.enumer(scenario, samples=1)):
        np.testing.assert_allclose(bound.covariance, expected, rtol=ROUNDING, atol=ROUNDING)
        np.testing.assert_allclose(
            bound.position_mse, np.trace(expected[:, : scenario.dim, : scenario.dim], axis1=1, axis2=2)
        )
        assert bound.mean_position_rmse_stderr() < ROUNDING


def test_linear_measurements_and_equal_modes_give_the_kalman_covariance():
    """No switching: both sights have one law, whatever the chain; the full window, so that nothing is cut."""
    scenario = asymmetric(reports=mask(STEPS, 2))
    links = [lb.Link(a.name, Linear(g), a.sight, (a.noises[0],) * 2, a.reports)
             for a, g in zip(scenario.links, ([1.0, 0.5], [-0.2, 2.0]), strict=True)]  # fmt: skip
    scenario = scenario.replace(links=links)
    expected = kalman_reference(scenario, np.tile([3.0, 2.0], (STEPS, 1)))
    bound = lb.bcrb(scenario, samples=1, window=STEPS)
    np.testing.assert_allclose(bound.covariance, expected, rtol=ROUNDING, atol=ROUNDING)
    assert bound.mean_position_rmse_stderr() < ROUNDING


@pytest.fixture(scope="module")
def scenario():
    return asymmetric(reports=mask(STEPS, 2))


@pytest.fixture(scope="module")
def bound(scenario):
    return lb.bcrb(scenario, samples=SAMPLES, window=STEPS)


def test_equal_modes_are_the_bound_without_switching_on_the_same_tracks(scenario):
    equal = noise_of(scenario, noises=(lb.Gaussian(1.0, 4.0), lb.Gaussian(1.0, 4.0)))
    known = scenario.with_known_sight(np.zeros(STEPS, int))
    known = noise_of(known, noises=(lb.Gaussian(1.0, 4.0), lb.Gaussian(1.0, 4.0)))
    a = lb.bcrb(equal, samples=SAMPLES, window=STEPS)
    b = lb.known_sight(known, samples=SAMPLES)
    np.testing.assert_allclose(a.position_mse, b.position_mse, rtol=ROUNDING)
    np.testing.assert_allclose(a.replicates, b.replicates, rtol=1e-6, atol=ROUNDING)


def test_a_chain_that_never_changes_from_a_known_start_is_known_sight(scenario):
    never = scenario.replace(
        links=[
            lb.Link(a.name, a.measurement, lb.MarkovSight(start, np.eye(2)), a.noises, a.reports)
            for a, start in zip(scenario.links, ([1.0, 0.0], [0.0, 1.0]), strict=True)
        ]
    )
    a = lb.bcrb(never, samples=SAMPLES, window=STEPS)
    b = lb.known_sight(scenario.with_known_sight(np.tile([0, 1], (STEPS, 1))), samples=SAMPLES)
    np.testing.assert_allclose(a.position_mse, b.position_mse, rtol=ROUNDING)


def test_a_chain_that_never_changes_from_an_unknown_start_is_not_known_sight(scenario):
    """Near nothing is known at first and nearly everything later: the bound lies in between."""
    never = scenario.replace(
        links=[
            lb.Link(a.name, a.measurement, lb.MarkovSight([0.5, 0.5], np.eye(2)), a.noises, a.reports)
            for a in scenario.links
        ]
    )
    bound = lb.bcrb(never, samples=SAMPLES, window=STEPS)
    known = [lb.known_sight(scenario.with_known_sight(np.full(STEPS, r)), samples=SAMPLES) for r in (0, 1)]
    assert known[0].mean_position_rmse() < bound.mean_position_rmse() < known[1].mean_position_rmse()


def moved(scenario, rotation=None, shift=0.0, scale=1.0):
    """The scenario in other coordinates; the unit of length divided by ``scale``, time as it is."""
    R = np.eye(2) if rotation is None else rotation
    RR = np.kron(np.eye(2), R) * scale
    offset = np.array([shift, -shift, 0.0, 0.0])
    links = [
        lb.Link(
            a.name,
            lb.Range(scale * R @ a.measurement.anchor + offset[:2]),
            a.sight,
            tuple(lb.Gaussian(scale * n.mean, scale * n.std) for n in a.noises),
            a.reports,
        )
        for a in scenario.links
    ]
    return scenario.replace(
        motion=lb.ConstantVelocity(scale**2 * scenario.motion.intensity),
        prior=lb.GaussianPrior(RR @ scenario.prior.mean + offset, RR @ scenario.prior.covariance @ RR.T),
        links=links,
    )


TURN = np.array([[0.6, -0.8], [0.8, 0.6]])


def agree(a, b, factor=1.0):
    gap = abs(a.mean_position_rmse() / factor - b.mean_position_rmse())
    assert gap < SIGMAS * np.hypot(a.mean_position_rmse_stderr() / factor, b.mean_position_rmse_stderr())


def test_translation_changes_nothing(scenario, bound):
    a = lb.bcrb(moved(scenario, shift=1e4), samples=SAMPLES, window=STEPS)
    np.testing.assert_allclose(a.position_mse, bound.position_mse, rtol=1e-8)  # 1e4 m of 1e-16: 1e-12 m in 10 m


def test_the_unit_of_length_changes_nothing(scenario, bound):
    a = lb.bcrb(moved(scenario, scale=0.3048), samples=SAMPLES, window=STEPS)
    np.testing.assert_allclose(a.position_mse / 0.3048**2, bound.position_mse, rtol=ROUNDING)


def test_rotation_and_reflection_change_nothing(scenario, bound):
    """The noise draws are the same, the tracks are not: their law is the same."""
    mirror = np.diag([1.0, -1.0])
    for R in (TURN, TURN @ mirror):
        a = lb.bcrb(moved(scenario, rotation=R), samples=SAMPLES, window=STEPS)
        agree(a, bound)
        RR = np.kron(np.eye(2), R)
        difference = a.covariance - RR @ bound.covariance @ RR.T
        assert np.linalg.norm(difference) < 0.02 * np.linalg.norm(bound.covariance)  # matrices turn along; 1 % errors


def test_the_order_of_anchors_changes_nothing(scenario, bound):
    a = lb.bcrb(scenario.replace(links=scenario.links[::-1]), samples=SAMPLES, window=STEPS)
    np.testing.assert_allclose(a.position_mse, bound.position_mse, rtol=ROUNDING)


def test_a_report_more_never_increases_the_bound(scenario, bound):
    """On the same draws even exactly at the newest step; here over all reports, matrices in the Loewner order."""
    more = scenario.with_reports(np.ones((STEPS, 2), bool))
    a = lb.bcrb(more, samples=SAMPLES, window=STEPS)
    assert np.all(a.position_mse <= bound.position_mse * (1 + ROUNDING))
    less = scenario.with_reports(scenario.reports & np.array([True, False]))
    b = lb.bcrb(less, samples=SAMPLES, window=STEPS)
    assert np.all(b.position_mse >= bound.position_mse * (1 - ROUNDING))
    assert np.linalg.eigvalsh(b.covariance - bound.covariance).min() > -ROUNDING
    none = lb.bcrb(scenario.with_reports(np.zeros((STEPS, 2), bool)), samples=SAMPLES, window=STEPS)
    expected = kalman_reference(scenario.with_reports(np.zeros((STEPS, 2), bool)), np.ones((STEPS, 2)))
    np.testing.assert_allclose(none.covariance, expected, rtol=ROUNDING, atol=ROUNDING)


def test_the_known_mode_information_averaged_over_the_modes_is_a_bound_below_both(scenario, bound):
    """J <= J_c, and the inverse is convex: a known sight whose informations are averaged lies below BCRB and Enumer."""
    law = [np.asarray(a.sight.start) for a in scenario.links]
    P, J_c = scenario.prior.covariance, []
    enumer = lb.enumer(scenario, samples=SAMPLES)
    with jax.enable_x64(True):
        F, Q = np.asarray(scenario.transition), np.asarray(scenario.process_noise)
    x = lb.simulate(scenario, runs=4096, seed=7).states[:, 1:, :2]
    for k in range(STEPS):
        P = F[k] @ P @ F[k].T + Q[k]
        J = np.zeros((4, 4))
        for m, a in enumerate(scenario.links):
            law[m] = law[m] @ np.asarray(a.sight.transition)
            u = x[:, k] - a.measurement.anchor
            u = u / np.linalg.norm(u, axis=1, keepdims=True)
            weight = law[m] @ [1 / float(n.std) ** 2 for n in a.noises] * scenario.reports[k, m]
            J[:2, :2] += weight * u.T @ u / len(u)
        P = np.linalg.inv(np.linalg.inv(P) + J)
        J_c.append(np.sqrt(P[0, 0] + P[1, 1]))
    for larger in (bound, enumer):
        gap = np.sqrt(larger.position_mse)[1:].mean() - np.mean(J_c)
        assert gap > -SIGMAS * larger.mean_position_rmse_stderr()
    assert bound.mean_position_rmse() > 1.02 * (np.sqrt(bound.position_mse[0]) + sum(J_c)) / (STEPS + 1)


def test_the_recursion_is_the_last_block_of_the_inverse_at_every_horizon(scenario):
    """Against a dense inverse of the whole information matrix, with random positive semidefinite increments."""
    rng = np.random.default_rng(2)
    roots = 0.1 * rng.normal(size=(STEPS, 2 * STEPS, 2 * STEPS))
    for k in range(STEPS):
        roots[k, 2 * (k + 1) :] = 0  # nothing is known about states before step 1
    D = np.einsum("kia,kja->kij", roots, roots)
    with jax.enable_x64(True):
        P = np.asarray(covariance_recursion(scenario, GivenIncrements(D.reshape(STEPS, STEPS, 2, STEPS, 2)))[0])
        F, Q = np.asarray(scenario.transition), np.asarray(scenario.process_noise)
    J = np.zeros((STEPS + 1, 4, STEPS + 1, 4))
    J[0, :, 0] = np.linalg.inv(scenario.prior.covariance)
    for k in range(1, STEPS + 1):
        Qi = np.linalg.inv(Q[k - 1])
        T = np.hstack([-F[k - 1], np.eye(4)])
        J[k - 1 : k + 1, :, k - 1 : k + 1] += (T.T @ Qi @ T).reshape(2, 4, 2, 4)
        ages = np.arange(k, 0, -1)  # age 0 is step k
        J[np.ix_(ages, [0, 1], ages, [0, 1])] += D[k - 1].reshape(STEPS, 2, STEPS, 2)[:k, :, :k]
        size = 4 * (k + 1)
        expected = np.linalg.inv(J[: k + 1, :, : k + 1].reshape(size, size))[-4:, -4:]
        np.testing.assert_allclose(P[k], expected, rtol=1e-7)


def test_changes_of_the_increments_are_followed_to_first_order(scenario):
    """Against central differences of the recursion itself, whose value is checked above."""
    rng = np.random.default_rng(3)
    shape = STEPS, 3, 2
    roots = 0.05 * rng.normal(size=(*shape, 6))
    changes = 0.05 * rng.normal(size=(2, *shape, 6))
    D = np.einsum("kiax,kjbx->kiajb", roots, roots)
    dD = np.einsum("gkiax,kjbx->gkiajb", changes, roots)
    dD = dD + np.transpose(dD, (0, 1, 4, 5, 2, 3))
    with jax.enable_x64(True):
        _, followed = covariance_recursion(scenario, GivenIncrements(D, dD))

        def position_mse(D):
            P = np.asarray(covariance_recursion(scenario, GivenIncrements(D))[0])
            return P[:, 0, 0] + P[:, 1, 1]

        h = 1e-5
        differences = np.stack([(position_mse(D + h * d) - position_mse(D - h * d)) / (2 * h) for d in dD])
    scale = np.abs(differences).max()
    assert scale > 0.01
    np.testing.assert_allclose(np.asarray(followed), differences, atol=1e-6 * scale)


def test_the_same_seed_gives_the_same_bits(scenario, bound):
    again = lb.bcrb(scenario, samples=SAMPLES, window=STEPS)
    other = lb.bcrb(scenario, samples=SAMPLES, window=STEPS, seed=1)
    assert np.array_equal(again.position_mse, bound.position_mse)
    assert np.array_equal(again.replicates, bound.replicates)
    assert not np.array_equal(other.position_mse, bound.position_mse)
    agree(other, bound)


def test_a_bound_is_about_the_past_only(scenario, bound):
    """Steps up to k do not depend on what happens later."""
    later = scenario.reports.copy()
    later[8:] = ~later[8:]
    a = lb.bcrb(scenario.with_reports(later), samples=SAMPLES, window=STEPS)
    np.testing.assert_allclose(a.position_mse[:9], bound.position_mse[:9], rtol=ROUNDING)
    assert not np.allclose(a.position_mse[9:], bound.position_mse[9:], rtol=1e-3)


def test_a_short_window_is_refused_only_where_it_is_none(scenario, bound):
    for window in (0, -3):
        with pytest.raises(lb.InputError, match="window"):
            lb.bcrb(scenario, window=window)
    for options in ({"rtol": 0.0}, {"rtol": 1.0}, {"samples": 0}, {"samples": -5}):
        with pytest.raises(lb.InputError):
            lb.bcrb(scenario, **options)
    longer = lb.bcrb(scenario, samples=SAMPLES, window=10 * STEPS)
    assert np.array_equal(longer.position_mse, bound.position_mse)
    assert longer.diagnostics["truncation"] == 0


@pytest.mark.slow
def test_the_window_grows_until_the_truncation_is_small_and_reports_it():
    """A slow chain with weakly separated sights: information correlates over many steps."""
    chain = lb.MarkovSight.stay(0.98, start=(0.5, 0.5))
    slow = noise_of(asymmetric(steps=24), sight=chain, noises=(lb.Gaussian(0.0, 3.0), lb.Gaussian(3.0, 4.0)))
    short = lb.bcrb(slow, samples=SAMPLES, window=4)
    automatic = lb.bcrb(slow, rtol=0.01)
    full = lb.bcrb(slow, samples=automatic.provenance.samples, window=24)
    assert automatic.diagnostics["window"] > 12
    assert automatic.diagnostics["truncation"] <= 1e-3
    cut = abs(automatic.mean_position_rmse() / full.mean_position_rmse() - 1)
    assert cut <= 1e-3
    assert abs(short.mean_position_rmse() / full.mean_position_rmse() - 1) > 3e-3


@pytest.mark.slow
@pytest.mark.parametrize("stay, excess, speed_std", [(0.99, 1.0, 0.1), (0.995, 0.3, 1e-3), (0.999, 1.0, 1e-3)])
def test_the_reported_truncation_is_no_less_than_the_error_of_the_window(stay, excess, speed_std):
    """Chains that remember longer than any window tried, on a mobile that hardly moves."""
    start = lb.GaussianPrior([0.0, 0.0, 0.0, 0.0], np.diag(np.square([10.0, 10.0, speed_std, speed_std])))
    slow = noise_of(
        asymmetric(steps=40), sight=lb.MarkovSight.stay(stay), noises=(lb.Gaussian(0.0, 1.0), lb.Gaussian(excess, 1.0))
    )
    slow = slow.replace(prior=start, motion=lb.ConstantVelocity(1e-8), times=lb.Times.uniform(step_s=1.0, steps=40))
    cut = lb.bcrb(slow, rtol=0.9)  # any window will do
    full = lb.bcrb(slow, samples=cut.provenance.samples, window=40)
    assert cut.diagnostics["window"] < 40
    error = np.abs(np.sqrt(cut.position_mse / full.position_mse) - 1).max()
    assert 3e-3 < error < cut.diagnostics["truncation"]


@pytest.mark.slow
def test_large_tables_keep_fewer_groups(monkeypatch):
    """The same draws in fewer groups: where memory is short, not another number."""
    module = importlib.import_module("locbounds.bounds.bcrb")
    scenario = lb.papers.fritsche2013.scenario(steps=10)
    many = lb.bcrb(scenario, samples=2048, window=10)
    monkeypatch.setattr(module, "TABLE_BYTES", 0.0)
    few = lb.bcrb(scenario, samples=1024, window=10)
    assert (len(many.replicates), len(few.replicates)) == (32, 16)
    error = np.hypot(many.mean_position_rmse_stderr(), few.mean_position_rmse_stderr())
    assert abs(many.mean_position_rmse() - few.mean_position_rmse()) < 4 * error
