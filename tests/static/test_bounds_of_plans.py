"""Bounds and estimators of plans: order, verdicts, searches, invariances."""

import dataclasses
import re

import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
import static_by_hand as by_hand
from locbounds.papers.mcguire2009 import CASES
from locbounds.registry import METHODS, method
from locbounds.static.barankin import barankin_matrix
from locbounds.static.cells import per_cell
from locbounds.static.over_prior import OVER_PRIOR, over_prior
from locbounds.static.tightest import choose
from locbounds.verdict import Status

ANCHORS = np.array([[0.0, 15.0], [-13.0, -7.5], [13.0, -7.5]])
DISC = lb.UniformDisc([0.0, 0.0], 15.0)
NEAR = lb.GaussianPrior([1.0, 2.0], np.array([[16.0, 5.0], [5.0, 9.0]]))
YARD = lb.UniformPolygon(
    [[-9, -9], [9, -9], [9, 9], [0, 9], [0, 0], [-9, 0]], holes=[[[3, -6], [6, -6], [6, -3], [3, -3]]]
)
ROOMS = lb.PriorMixture(
    [0.3, 0.7], [lb.GaussianPrior([-6.0, 0.0], 2 * np.eye(2)), lb.GaussianPrior([5.0, 1.0], np.eye(2))]
)
RTOL = 2e-3
SEARCHED = 1e-6  # maxima are flat: rounding moves where they are found


def rmse(result):
    return float(result.mean_position_rmse())


PLANS = {
    "polygon, differences": lb.tdoa(ANCHORS, 2.0, prior=YARD),
    "mixture, strengths": lb.rss(ANCHORS, 3.0, prior=ROOMS),
    "Gaussian, wide angles": lb.aoa(ANCHORS, 0.4, prior=NEAR),
    "box, one-sided noise": lb.toa(ANCHORS, lb.Exponential(2.0), prior=lb.UniformBox([-5.0, -5.0], [5.0, 8.0])),
    "disc, clock": lb.toa(ANCHORS, 3.0, clock_std_m=5.0, prior=DISC),
    "disc, ranges and an angle": lb.toa(ANCHORS[:2], 3.0, prior=DISC) + lb.aoa(ANCHORS[2:], 0.2),
}


@pytest.mark.parametrize("name", PLANS)
def test_no_valid_bound_is_above_the_least_error(name):
    plan = PLANS[name]
    least = lb.mmse(plan, rtol=0.01)
    top = rmse(least) * (1 + 4 * least.relative_stderr())
    found = lb.tightest(plan, rtol=1e-2)
    assert 0.3 * top < rmse(found.best) < top
    assert rmse(found.runner_up) <= rmse(found.best)
    assert found.best.name in found.reason
    assert least.efficiency(found.best).value <= 1 + 8 * least.relative_stderr()


def test_a_runner_up_of_zero_is_no_division_by_zero():
    found = lb.tightest(with_prior(NEAR), rtol=1e-2)
    nothing = dataclasses.replace(found.runner_up, position_mse=np.zeros(1))
    again = choose({r.id: r for r in (nothing, found.best)})
    assert again.best is found.best
    assert again.reason.endswith(f"m, above {nothing.name} (0.000 m)")


def test_a_user_error_is_no_property_of_a_method():
    plan = with_prior(DISC)
    with pytest.raises(lb.InputError, match="rtol is 5"):
        over_prior(plan, ["ezzb"], rtol=5.0)
    with pytest.raises(lb.InputError, match="rtol is 5"):
        per_cell(plan, DISC, ["ezzb"], cells=1, rtol=5.0)
    with pytest.raises(lb.InputError, match="coordinates"):
        per_cell(plan, DISC, ["ezzb"], cells=1, height=(0.0, 2.0))
    every = over_prior(plan.replace(prior=None), OVER_PRIOR)
    assert {id: type(r).__name__ for id, r in every.items()} == dict.fromkeys(OVER_PRIOR, "Refusal")


def test_more_tests_are_tighter_and_the_printed_form_is_looser():
    plan = lb.toa(ANCHORS, 12.0, prior=DISC)
    printed, equal, diagonal, many = (
        rmse(lb.wwb(plan, **options)) for options in ({"form": "printed"}, {}, {"tests": "diagonal"}, {"tests": 8})
    )
    assert printed < 0.8 * equal
    assert equal <= diagonal * (1 + 1e-6)
    assert equal < many < rmse(lb.mmse(plan, draws=1024))


@pytest.mark.parametrize("lengths", [[0.01, 0.02], [26.0, 28.0], [0.05, 29.0]])
def test_lengths_that_miss_the_maximum_are_extended(lengths):
    plan = lb.toa(ANCHORS, 2.0, prior=DISC)
    found = lb.wwb(plan, lengths_m=lengths)
    assert rmse(found) == pytest.approx(rmse(lb.wwb(plan)), rel=RTOL)
    top = found.diagnostics["tests_m"][0, 0]
    assert found.diagnostics["lengths_m"][0] < top < found.diagnostics["lengths_m"][-1]
    assert ("is not between the lengths given" in str(found.verdict)) == (not lengths[0] < top < lengths[-1])


def test_other_exponents_are_not_better():
    plan = lb.toa(ANCHORS, 3.0, prior=DISC)
    best = lb.wwb(plan)
    H = best.diagnostics["tests_m"]
    for s in (0.3, 0.6):
        assert all(rmse(lb.wwb(plan, exponent=s, tests=k * H, rtol=0.01)) < rmse(best) for k in (0.5, 1.0, 1.5))
    assert rmse(lb.wwb(plan, exponent=0.5001, tests=H)) == pytest.approx(rmse(best), rel=RTOL)


def test_the_limit_of_short_tests_is_the_bayesian_cramer_rao_bound():
    plan = lb.toa(ANCHORS, 2.0, prior=NEAR)
    bcrb, wwb = lb.bcrb(plan), lb.wwb(plan)
    assert wwb.diagnostics["limit"]
    np.testing.assert_allclose(wwb.covariance, bcrb.covariance)
    short = lb.wwb(plan, tests=0.05 * np.eye(2))
    np.testing.assert_allclose(short.covariance, bcrb.covariance, rtol=1e-3)


def test_linear_gaussian_everything_meets_at_the_least_error():
    A, C = np.array([[1.0, 0.5], [0.2, 2.0]]), np.array([[2.0, 0.3], [0.3, 1.0]])
    plan = lb.observe(lambda p: A @ p, C, prior=NEAR)
    P = np.linalg.inv(A.T @ np.linalg.inv(C) @ A + np.linalg.inv(NEAR.covariance))
    np.testing.assert_allclose(lb.bcrb(plan).covariance[0], P, rtol=1e-9)
    least = lb.mmse(plan, rtol=1e-6, draws=512)
    np.testing.assert_allclose(least.covariance[0], P, rtol=1e-5)  # the posterior does not depend on the draw
    likely, squares = lb.ml(plan, draws=1024), lb.ls(plan, draws=1024)
    inverse = np.linalg.inv(A)
    for found in (likely, squares):  # two numbers for two unknowns: both solve the equations
        expected = np.trace(inverse @ C @ inverse.T)
        assert abs(found.position_mse[0] - expected) < 4 * np.std(found.replicates, ddof=1) / 4


def test_differences_are_ranges_with_an_unknown_clock():
    tdoa, clock = lb.tdoa(ANCHORS, 3.0, prior=DISC), lb.toa(ANCHORS, 3.0, clock_std_m=np.inf, prior=DISC)
    assert rmse(lb.ezzb(tdoa)) == pytest.approx(rmse(lb.ezzb(clock)), rel=1e-9)
    assert rmse(lb.wwb(tdoa)) == pytest.approx(rmse(lb.wwb(clock)), rel=SEARCHED)
    assert rmse(lb.ezzb(lb.tdoa(ANCHORS, 3.0, reference=2, prior=DISC))) == pytest.approx(rmse(lb.ezzb(tdoa)), rel=1e-9)
    a, b = lb.mmse(tdoa, rtol=5e-3), lb.mmse(clock, rtol=5e-3)
    assert abs(rmse(a) - rmse(b)) < 4 * np.hypot(*(r.mean_position_rmse_stderr() for r in (a, b)))


@pytest.mark.parametrize(
    "case", [pytest.param(c, marks=() if k % 6 == 0 else pytest.mark.slow) for k, c in enumerate(CASES)],
    ids=[c.name for c in CASES],
)  # fmt: skip
def test_turning_the_stations_by_a_third_changes_nothing(case):
    sigma = case.sigmas[3]
    here, turned = case.plan(sigma), case.plan(sigma, turned_deg=120.0)
    for bound in (lb.ezzb, lb.wwb):
        assert rmse(bound(turned)) == pytest.approx(rmse(bound(here)), rel=SEARCHED)


def test_a_turned_world_has_the_same_bound_along_a_turned_direction():
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    here = lb.rss(ANCHORS, 2.0, prior=DISC)
    there = lb.rss(ANCHORS @ turn.T, 2.0, prior=DISC)
    a = np.array([2.0, 1.0])
    one, two = lb.ezzb(here, direction=a), lb.ezzb(there, direction=turn @ a)
    assert one.position_mse[0] == pytest.approx(two.position_mse[0], rel=RTOL)
    assert one.position_mse[0] == pytest.approx(4 * lb.ezzb(here, direction=a / 2).position_mse[0], rel=1e-9)


def test_noise_levels_are_plans():
    levels = lb.bounds_over_noise(lb.rss(ANCHORS, 2.0, prior=DISC), [0.5, 2.0])
    for level in levels:
        plan = lb.rss(ANCHORS, 2.0 * level.scale, prior=DISC)
        for value, bound in ((level.ezzb_m, lb.ezzb(plan)), (level.wwb_m, lb.wwb(plan)),
                             (level.printed_m, lb.wwb(plan, form="printed"))):  # fmt: skip
            assert value == pytest.approx(rmse(bound), rel=RTOL)


def test_three_dimensions():
    anchors = np.array([[0, 0, 0], [9, 0, 1], [0, 9, 2], [9, 9, 8.0]])
    plan = lb.toa(anchors, 1.5, prior=lb.UniformBox([0, 0, 0], [9, 9, 3]))
    least = lb.mmse(plan, draws=512)
    for bound in (lb.ezzb(plan, rtol=0.02), lb.wwb(plan, rtol=0.02)):
        assert 0.5 * rmse(least) < rmse(bound) < rmse(least) * (1 + 4 * least.relative_stderr())
        assert bound.covariance.shape == (1, 3, 3)


def test_barankin_is_the_cramer_rao_bound_for_short_tests_and_never_below_it():
    plan = lb.toa(ANCHORS, 2.0)
    for place in ([1.0, 2.0], [6.0, -9.0]):
        crlb = float(lb.crlb(plan, np.array([place])).rmse[0])
        assert rmse(lb.barankin(plan, place, tests=1e-4 * np.eye(2))) == pytest.approx(crlb, rel=1e-5)
        assert rmse(lb.barankin(plan, place)) >= crlb * (1 - 1e-9)


def test_barankin_matrix_from_likelihood_ratios():
    """E[L L^T] by a sum over measurements of a line, for m(x) = x^2 with unit noise."""
    x, tests = 0.4, np.array([0.05, -0.9, 0.7])
    z = np.arange(-12, 14, 1e-3)

    def density(m):
        return np.exp(-0.5 * (z - m) ** 2) / np.sqrt(2 * np.pi)

    p = density(x**2)
    ratios = np.stack([density((x + h) ** 2) / p for h in tests])
    B = (ratios * p) @ ratios.T * 1e-3
    expected = tests @ np.linalg.inv(B - 1) @ tests
    found = barankin_matrix(tests[None], ((x + tests) ** 2 - x**2)[:, None])
    assert found[0, 0] == pytest.approx(expected, rel=1e-6)


def test_barankin_with_short_and_far_tests_together():
    """A far test of which nothing is left must not spoil the short ones."""
    short, far = np.array([[1e-4], [-2e-4]]), np.array([[22.0]])
    together = barankin_matrix(np.array([[1e-4, -2e-4, 11.0]]), np.concatenate([short, far]))
    assert together[0, 0] == pytest.approx(barankin_matrix(np.array([[1e-4]]), short[:1])[0, 0], rel=1e-6)


def test_error_between_products_of_noises_is_a_lower_bound():
    """Two channels: the minimum of two densities summed over a grid of measurements."""
    plan = lb.toa(ANCHORS[:2], lb.Exponential(2.0))
    a, b = np.array([[1.0, 2.0]]), np.array([[2.5, 3.0]])
    d = np.abs(np.asarray(plan.means(a) - plan.means(b)))[0]
    step = 0.04
    z = np.arange(step / 2, 45, step)

    def densities(shift):
        return np.where(z > shift, np.exp(-np.maximum(z - shift, 0.0) / 2) / 2, 0.0)

    one = np.multiply.outer(densities(0.0), densities(d[1]))
    two = np.multiply.outer(densities(d[0]), densities(0.0))
    exact = 0.5 * np.minimum(one, two).sum() * step**2
    found = float(plan.minimum_error(a, b)[0])
    rho = np.exp(float(plan.log_bhattacharyya(a, b)[0]))
    assert (1 - np.sqrt(1 - rho**2)) / 2 < found
    assert found == pytest.approx(0.5 * np.exp(-d.sum() / 2), rel=1e-4)
    assert found < exact * 1.01


class Jumping(lb.Range):
    """A range that is longer behind a wall."""

    @property
    def continuous(self):
        return False

    def __call__(self, position):
        return super().__call__(position) + 3.0 * (position[0] > 0)


def with_prior(prior):
    return lb.toa(ANCHORS, 1.0, prior=prior)


def loudness(anchor):
    """A level in dB, as a user would write it."""
    return lambda p: 15 * jnp.log10(jnp.sum((p - jnp.array(anchor)) ** 2))


REFUSED = {
    "the plan has a prior": [(lb.toa(ANCHORS, 1.0), "no prior")],
    "the prior's density vanishes smoothly where it ends": [(with_prior(DISC), "jumps at the edge")],
    "every measurement's noise has a finite Fisher information about a shift": [
        (lb.toa(ANCHORS, lb.Uniform(0.0, 2.0), prior=NEAR), "no finite Fisher information")
    ],
    "every measurement is continuous over the places that the prior allows": [
        (
            lb.Plan([lb.Observations([Jumping(a) for a in ANCHORS], np.eye(3))], prior=NEAR),
            "jumps where the line of sight is lost",
        )
    ],
    "the expected information is finite": [
        (lb.rss(ANCHORS, 2.0, prior=NEAR), "changes like 1/r"),
        (with_prior(NEAR) + lb.observe(loudness([0.0, 0.0]), 1.0), "grows like r^-1.00 towards (0, 0)"),
        (with_prior(NEAR) + lb.observe(loudness([0.37, 0.21]), 1.0), "grows like r^-1.00 towards (0.37, 0.21)"),
    ],
}


def test_every_assumption_has_a_plan_that_violates_it_and_a_verdict_that_says_so():
    ids = ("wwb", "ezzb", "mmse", "ml", "ls")
    assumptions = {a.text for a in METHODS["bcrb"].on_plan} | {a.text for id in ids for a in METHODS[id].assumptions}
    assert assumptions == {
        *REFUSED, "all measurements have the same unit", "no function jumps: integrals over short test vectors miss it"
    }  # fmt: skip
    sign = lb.observe(lambda p: jnp.sign(p[0]), np.eye(1), dim=2, prior=NEAR)
    assert "violated no function jumps" in lb.explain("wwb", sign)
    mixed = lb.toa(ANCHORS[:2], 3.0, prior=DISC) + lb.aoa(ANCHORS[2:], 0.2)
    with pytest.raises(lb.RefusedError, match="without weights"):
        lb.ls(mixed)
    for text, plan, words in [(text, *row) for text, rows in REFUSED.items() for row in rows]:
        verdict = method("bcrb").verdict(plan)
        assert verdict.status is Status.REFUSED
        assert any(words in reason for reason in verdict.reasons)
        assert f"violated {text}" in lb.explain("bcrb", plan)
        with pytest.raises(lb.RefusedError, match=re.escape(words)):
            lb.bcrb(plan)
        if plan.prior is None:
            for bound in (lb.wwb, lb.ezzb, lb.mmse, lb.ml, lb.ls):
                with pytest.raises(lb.InputError, match="no prior"):
                    bound(plan)
        else:
            assert method("wwb").verdict(plan).status is method("ezzb").verdict(plan).status is Status.VALID


@pytest.mark.parametrize(
    "plan",
    [
        with_prior(NEAR),
        with_prior(ROOMS),
        lb.tdoa(ANCHORS, 1.0, prior=NEAR),
        lb.rss(ANCHORS, 2.0, near_field_m=1.0, prior=NEAR),
        lb.rss(np.column_stack([ANCHORS, [0, 1, 2]]), 2.0, prior=lb.GaussianPrior(np.zeros(3), np.eye(3))),
    ],
    ids=["ranges", "mixture", "differences", "near field", "3-D strengths"],
)
def test_the_bayesian_bound_is_refused_in_no_other_case(plan):
    assert method("bcrb").verdict(plan).status is Status.VALID


@pytest.mark.parametrize("prior", [DISC, YARD, lb.UniformBox([-5, -5], [5, 5]), lb.PriorMixture([1.0], [DISC])])
def test_the_bayesian_bound_is_refused_for_every_prior_with_an_edge(prior):
    assert method("bcrb").verdict(with_prior(prior)).status is Status.REFUSED


def test_the_bayesian_bound_of_a_mixture_from_a_sum():
    plan = with_prior(ROOMS)
    step = 0.05
    points = by_hand.grid(lambda p: np.full(len(p), True), [-16, -9], [14, 9], step)
    f = np.exp(ROOMS.log_density(points))
    d = 1e-4
    score = np.stack(
        [(ROOMS.log_density(points + d * e) - ROOMS.log_density(points - d * e)) / (2 * d) for e in np.eye(2)], -1
    )
    u = points[:, None] - ANCHORS
    u = u / np.linalg.norm(u, axis=-1, keepdims=True)
    J = (np.einsum("n,nca,ncb->ab", f, u, u) + np.einsum("n,na,nb->ab", f, score, score)) * step**2
    np.testing.assert_allclose(lb.bcrb(plan).covariance[0], np.linalg.inv(J), rtol=1e-3)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda p: lb.wwb(p, tests="round"), "round"),
        (lambda p: lb.wwb(p, tests=1), "at least one per dimension"),
        (lambda p: lb.wwb(p, tests=np.zeros((2, 2))), "none of them zero"),
        (lambda p: lb.wwb(p, lengths_m=[-1.0]), "positive numbers"),
        (lambda p: lb.wwb(p, exponent=1.0), "exponent"),
        (lambda p: lb.wwb(p, form="old"), "form"),
        (lambda p: lb.ezzb(p, shifts="best"), "along"),
        (lambda p: lb.ezzb(p, direction=[0.0, 0.0]), "not all zero"),
        (lambda p: lb.ezzb(p, rtol=0.0), "rtol"),
        (lambda p: lb.mmse(p, draws=3), "at least 32"),
        (lambda p: lb.bounds_over_noise(p, [0.0]), "positive"),
        (lambda p: lb.barankin(p, [1.0, 2.0, 3.0]), "points"),
    ],
)
def test_options_that_cannot_be_used(call, words):
    with pytest.raises(lb.InputError, match=words):
        call(lb.toa(ANCHORS, 1.0, prior=DISC))


def test_what_needs_gaussian_noise_says_so():
    plan = lb.toa(ANCHORS, lb.Laplace(0.0, 1.0), prior=DISC)
    for call in (lambda: lb.wwb(plan, exponent=0.4), lambda: lb.barankin(plan, [0.0, 0.0]),
                 lambda: lb.bounds_over_noise(plan, [1.0])):  # fmt: skip
        with pytest.raises(lb.RefusedError):
            call()


def test_a_function_that_is_nearly_too_steep_is_valid_under_a_condition():
    """The mean square of its slope is finite, but no look at it shows that."""
    plan = lb.observe(lambda p: jnp.abs(p[0] - 0.3) ** 0.6, 1.0, dim=1, prior=lb.GaussianPrior([0.0], [[1.0]]))
    verdict = method("bcrb").verdict(plan)
    assert verdict.status is Status.CONDITIONAL
    assert "h continuous, E|grad h|^2 finite" in verdict.reasons[0]


def test_a_quadrature_that_does_not_settle_leaves_the_bound_undecided():
    """Slopes change sign faster than any nodes."""
    fast = lb.observe(lambda p: jnp.sin(3e3 * p[0] ** 2), 1.0, dim=1, prior=lb.GaussianPrior([0.0], [[1.0]]))
    bound = lb.bcrb(fast)
    assert bound.verdict.status is Status.UNDECIDED
    assert "more nodes changed it by" in bound.verdict.reasons[0]


class Odd(lb.GaussianPrior):
    def nodes(self, n):
        return super().nodes(n | 1)


def test_an_information_that_is_not_a_number_is_refused():
    """The square root at zero, where a node of every rule of odd size is."""
    plan = lb.observe(lambda p: jnp.sqrt(p[0] ** 2 + p[1] ** 2), 1.0, prior=Odd([0.0, 0.0], np.eye(2)))
    assert method("bcrb").verdict(plan).status is Status.VALID
    with pytest.raises(lb.RefusedError, match="not a number"):
        lb.bcrb(plan)
