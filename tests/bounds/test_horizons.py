"""Prediction and smoothing: linear Gaussian models exactly, any increments against a dense inverse, what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from locbounds.bounds.backward import smoothing_recursion
from locbounds.bounds.recursion import GivenIncrements, linear_model
from locbounds.evaluation import evaluate_on
from locbounds.filters import with_horizon
from locbounds.horizon import Horizon
from models import CHAIN, START, information, inverse_with_error, log_step, log_sum, switching
from scenarios import STEPS, Linear, asymmetric, mask

ROUNDING = 1e-9  # relative; exact identities through some hundred operations
SIGMAS = 4.0


def dense(scenario, std, extra=None):
    """Covariances of x_0..x_K given z_1..z_j for every j: the joint Gaussian, conditioned by one Schur complement."""
    with jax.enable_x64(True):
        F, Q = np.asarray(scenario.transition), np.asarray(scenario.process_noise)
    n, K = scenario.motion.state_size, scenario.steps
    A = np.eye(n * (K + 1)).reshape(K + 1, n, K + 1, n)  # x = A (x_0, v_1, .., v_K)
    for k in range(1, K + 1):
        A[k, :, :k] = np.einsum("ab,bkc->akc", F[k - 1], A[k - 1, :, :k])
    A = A.reshape(n * (K + 1), -1)
    blocks = [scenario.prior.covariance, *Q]
    joint = (
        A @ np.block([[blocks[k] if k == j else np.zeros((n, n)) for j in range(K + 1)] for k in range(K + 1)]) @ A.T
    )
    rows, noise, step = [], [], []
    for k in range(1, K + 1):
        for m, link in enumerate(scenario.links):
            if scenario.reports[k - 1, m]:
                h = np.zeros((K + 1, n))
                h[k, : scenario.dim] = link.measurement.anchor
                rows.append(h.ravel())
                noise.append(std[k - 1, m] ** 2)
                step.append(k)
    for k, X in enumerate(np.zeros((K + 1, n, n)) if extra is None else extra):
        values, vectors = np.linalg.eigh(X)
        for value, vector in zip(values, vectors.T, strict=True):
            if value > 1e-12:
                h = np.zeros((K + 1, n))
                h[k] = vector
                rows.append(h.ravel())
                noise.append(1 / value)
                step.append(k)
    H, R, step = np.array(rows), np.array(noise), np.array(step)
    found = []
    for j in range(K + 1):
        seen = step <= j
        C = joint @ H[seen].T
        P = joint - C @ np.linalg.solve(H[seen] @ C + np.diag(R[seen]), C.T) if seen.any() else joint
        found.append([P.reshape(K + 1, n, K + 1, n)[k, :, k] for k in range(K + 1)])
    return np.array(found)  # [given up to j, of step k, state, state]


IRREGULAR = lb.Times(np.cumsum([0.0, *np.random.default_rng(0).uniform(0.1, 3.0, STEPS)]))
UNIFORM = lb.Times.uniform(step_s=0.5, steps=STEPS)


def linear(times):
    """Singular Q, a singular prior, missing measurements of two linear functions of the position."""
    modes = np.random.default_rng(3).integers(0, 2, (STEPS, 2))
    noises = (lb.Gaussian(0.0, 3.0), lb.Gaussian(4.0, 9.0))
    reports = mask(STEPS, 2)
    links = [
        lb.Link(f"a{m}", Linear(g), lb.KnownSight(modes[:, m]), noises, reports[:, m])
        for m, g in enumerate(np.array([[1.0, 0.5], [-0.2, 2.0]]))
    ]
    start = lb.GaussianPrior(np.zeros(4), np.diag([100.0, 50.0, 0.0, 4.0]))
    motion = lb.ConstantVelocity([0.4, 0.0], discrete=True)
    return lb.Scenario("linear", times, motion, start, links), np.where(modes == 0, 3.0, 9.0)


def fixes():
    """Two further measurements: of the position at step 0 and of one velocity at step 7."""
    extra = np.zeros((STEPS + 1, 4, 4))
    extra[0, :2, :2] = np.eye(2) / 5.0**2
    extra[7, 3, 3] = 1 / 0.5**2
    return extra


def expected(given, horizon):
    """What a filter, a predictor of three steps or a smoother reaches, out of :func:`dense`."""
    K = len(given) - 1
    if horizon == "smooth":
        return given[K]
    ahead = 3 if horizon == "predict:3" else 0
    return np.stack([given[k - ahead, k] for k in range(ahead, K + 1)])


@pytest.mark.parametrize("horizon", ["filter", "predict:3", "smooth"])
def test_linear_gaussian_models_give_kalman_predictor_and_smoother_covariances(horizon):
    scenario, std = linear(IRREGULAR)
    wanted = expected(dense(scenario, std, fixes()), horizon)
    for method in (lb.known_sight, lb.enumer)[: 1 + (horizon == "smooth")]:
        bound = method(scenario, samples=1, horizon=horizon, extra=fixes())
        np.testing.assert_allclose(bound.covariance[-len(wanted) :], wanted, rtol=ROUNDING, atol=ROUNDING)
        assert bound.mean_position_rmse_stderr() < ROUNDING
        if horizon == "predict:3":  # before: nothing but the prior
            np.testing.assert_allclose(bound.covariance[:3], dense(scenario, std)[0][:3], rtol=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("horizon", "shared"),
    [
        ("smooth", None),
        pytest.param("predict:3", None, marks=pytest.mark.slow),
        pytest.param("smooth", "both", marks=pytest.mark.slow),
        pytest.param("predict:3", "both", marks=pytest.mark.slow),
    ],
)
def test_equal_modes_and_the_general_engine_too(horizon, shared):
    """No switching: both sights have one law, whatever the chain; two links that share one separate no more."""
    scenario, _ = linear(UNIFORM)
    noises = (lb.Gaussian(0.0, 3.0), lb.Gaussian(0.0, 3.0))
    chain = lb.MarkovSight.stay((0.9, 0.6))
    links = [lb.Link(a.name, a.measurement, chain, noises, a.reports, shared) for a in scenario.links]
    wanted = expected(dense(scenario, np.full((STEPS, 2), 3.0)), horizon)
    bound = lb.bcrb(scenario.replace(links=links), samples=1, window=2, horizon=horizon)
    np.testing.assert_allclose(bound.covariance[-len(wanted) :], wanted, rtol=1e-8, atol=1e-8)
    assert bound.mean_position_rmse_stderr() < 1e-8


def kalman_filter(std):
    """The textbook filter for :func:`linear`, told the deviations."""

    def filter(scenario, z, seed):
        x = np.broadcast_to(scenario.prior.mean, (len(z), 4)).copy()
        P, means, spreads = scenario.prior.covariance.copy(), [x.copy()], [scenario.prior.covariance]
        for k, (F, Q) in enumerate(zip(scenario.transition, scenario.process_noise, strict=True)):
            x, P = x @ F.T, F @ P @ F.T + Q
            for m, link in enumerate(scenario.links):
                if scenario.reports[k, m]:
                    h, r = np.array([*link.measurement.anchor, 0, 0]), std[k, m]
                    gain = P @ h / (h @ P @ h + r**2)
                    x = x + (z[:, k, m] - (4.0 if r == 9.0 else 0.0) - x @ h)[:, None] * gain
                    P = P - np.outer(gain, h @ P)
            means.append(x)
            spreads.append(P)
        return lb.Estimates(np.stack(means, 1), np.broadcast_to(spreads, (len(z), *np.shape(spreads))))

    return filter


@pytest.mark.parametrize("horizon", ["predict:3", "smooth"])
def test_kalman_filters_moved_on_or_followed_backwards_have_these_covariances_and_errors(horizon):
    scenario, std = linear(IRREGULAR)
    wanted = expected(dense(scenario, std), horizon)
    filter = with_horizon(kalman_filter(std), Horizon.parse(horizon, STEPS))
    draws = lb.simulate(scenario, runs=400, seed=2)
    found = filter(scenario, np.asarray(draws.measurements), 0)
    covariance = np.asarray(found.covariance)[:, -len(wanted) :]
    np.testing.assert_allclose(covariance, np.broadcast_to(wanted, covariance.shape), rtol=1e-6, atol=1e-8)
    square = np.sum((found.mean - draws.states)[:, 7, :2] ** 2, -1)
    bound = np.trace(wanted[7 - (STEPS + 1 - len(wanted))][:2, :2])
    assert abs(square.mean() - bound) < SIGMAS * square.std() / np.sqrt(len(square))


def test_smoothing_is_every_block_of_the_inverse_for_any_increments():
    """Against a dense inverse, and its changes against central differences."""
    scenario, rng = asymmetric(steps=6), np.random.default_rng(2)
    K, W = 6, 4
    roots = 0.1 * rng.normal(size=(K, 2 * W, 2 * W))
    for k in range(K):
        roots[k, 2 * (k + 1) :] = 0  # nothing is known about states before step 1
    D = np.einsum("kia,kja->kij", roots, roots)
    D[1] -= 0.3 * np.eye(2 * W) * np.diag(D[1]).max() * (np.arange(2 * W) < 2)  # increments need not be positive
    dD = rng.normal(size=(2, K, 2 * W, 2 * W)) * np.sqrt(np.einsum("kii,kjj->kij", D**2, D**2)) ** 0.5
    dD = dD + np.swapaxes(dD, 2, 3)

    with jax.enable_x64(True):
        model = linear_model(scenario)
        F, Q = np.asarray(model.F), np.asarray(model.Q)

        def smoothed(D, dD=None):
            shape = (K, W, 2, W, 2)
            changes = None if dD is None else jnp.asarray(dD.reshape(2, *shape))
            P, change = smoothing_recursion(model, GivenIncrements(jnp.asarray(D.reshape(shape)), changes))
            return np.asarray(P), np.asarray(change)

        P, change = smoothed(D, dD)
        h = 1e-5
        trace = [smoothed(D + s * h * d)[0][:, [0, 1], [0, 1]].sum(1) for d in dD for s in (1, -1)]
    J = np.zeros((K + 1, 4, K + 1, 4))
    J[0, :, 0] = np.linalg.inv(scenario.prior.covariance)
    for k in range(1, K + 1):
        T = np.hstack([-F[k - 1], np.eye(4)])
        J[k - 1 : k + 1, :, k - 1 : k + 1] += (T.T @ np.linalg.inv(Q[k - 1]) @ T).reshape(2, 4, 2, 4)
        ages = np.arange(k, max(k - W, 0), -1)  # age 0 is step k
        J[np.ix_(ages, [0, 1], ages, [0, 1])] += D[k - 1].reshape(W, 2, W, 2)[: len(ages), :, : len(ages)]
    inverse = np.linalg.inv(J.reshape(4 * K + 4, -1)).reshape(K + 1, 4, K + 1, 4)
    np.testing.assert_allclose(P, np.stack([inverse[k, :, k] for k in range(K + 1)]), rtol=1e-7)
    differences = np.stack([(trace[0] - trace[1]) / (2 * h), (trace[2] - trace[3]) / (2 * h)])
    np.testing.assert_allclose(change, differences, atol=1e-6 * np.abs(differences).max())


@pytest.mark.slow
def test_a_switching_motion_is_smoothed_with_the_matrix_of_an_explicit_sum_over_all_sequences():
    model = switching()
    K = model.steps
    draws = lb.simulate(model, runs=2**14, seed=5)
    x, z = np.asarray(draws.states)[..., 0], np.asarray(draws.measurements).reshape(2**14, K)

    def log_density(x, z):
        def step(n, r):
            return log_step(x[n + 1], x[n], z[n], r)

        return log_sum(step, START, CHAIN, K) - 0.5 * (x[0] - 0.5) ** 2 / 0.8

    J, groups = information(log_density, x, z)
    bound = lb.bcrb(model, samples=2**14, window=K, horizon="smooth", seed=1)
    stderr = np.std(bound.replicates, axis=0, ddof=1) / np.sqrt(len(bound.replicates))
    for k in range(K + 1):
        value, error = inverse_with_error(J, groups, [k])
        assert abs(bound.position_mse[k] - value) < SIGMAS * np.hypot(error, stderr[k])


HORIZONS = ("predict:1", "filter", "smooth")


@pytest.fixture(scope="module")
def scenario():
    return asymmetric(reports=mask(STEPS, 2))


@pytest.fixture(scope="module")
def bounds(scenario):
    return {h: lb.bcrb(scenario, samples=2048, window=STEPS, horizon=h) for h in HORIZONS}


def test_with_the_same_draws_smoothing_ends_where_filtering_does_and_nothing_is_worse_for_seeing_more(bounds):
    one, two, three = (bounds[h] for h in HORIZONS)
    np.testing.assert_allclose(three.covariance[-1], two.covariance[-1], rtol=ROUNDING)
    np.testing.assert_allclose(three.replicates[:, -1], two.replicates[:, -1], rtol=1e-6, atol=ROUNDING)
    assert np.all(one.position_mse >= two.position_mse * (1 - ROUNDING))
    assert np.all(two.position_mse >= three.position_mse * (1 - ROUNDING))
    assert three.position_mse[3] < 0.8 * two.position_mse[3]


def test_what_sees_more_than_a_bound_assumes_is_refused_with_the_reason(scenario, bounds):
    draws = lb.simulate(scenario, runs=64)
    filters = (with_horizon(lb.FactorisedImmEkf(), Horizon.parse(h, STEPS)) for h in HORIZONS)
    results = {h: evaluate_on(f, scenario, draws) for h, f in zip(HORIZONS, filters, strict=True)}
    for key, bound in bounds.items():
        assert lb.tightest([bound], sees=results[key].sees) == [bound]
        results[key].efficiency(bound)
    results["filter"].efficiency(bounds["smooth"])  # loose, but true
    for seen, bound, words in (
        ("smooth", "filter", "future-ranges, which BCRB assumes"),
        ("smooth", "predict:1", "future-ranges"),
        ("filter", "predict:1", "factorised sees ranges, which BCRB, 1 step ahead"),
    ):
        with pytest.raises(lb.RefusedError, match=words):
            results[seen].efficiency(bounds[bound])
    assert lb.tightest(list(bounds.values())) == [bounds["filter"]]


@pytest.mark.parametrize(
    "horizon", ["predict", "predict:x", "predict:-1", "predict:0", "smooth:2", "forever", "predict:6"]
)
def test_horizons_that_make_no_sense(horizon):
    with pytest.raises(lb.InputError, match="horizon") as failure:
        lb.bcrb(asymmetric(steps=5), horizon=horizon)
    assert failure.value.remedy


def test_what_has_no_such_horizon_says_so():
    scenario = asymmetric(steps=5)
    with pytest.raises(lb.RefusedError, match="corrected engine"):
        lb.bcrb(scenario, engine="corrected", horizon="smooth")
    with pytest.raises(lb.RefusedError, match="the motion switches"):
        lb.bcrb(switching(), horizon="predict:1")
    with pytest.raises(lb.InputError, match="extra information has shape"):
        lb.bcrb(scenario, extra=np.zeros((5, 4, 4)))
    with pytest.raises(lb.InputError, match="step 2 is not symmetric or negative"):
        lb.enumer(scenario, extra=-np.eye(4) * (np.arange(6) == 2)[:, None, None])
    with pytest.raises(lb.InputError, match="6 steps ahead, the record has 5"):
        lb.evaluate(lb.Predicted(lb.ImmEkf(), 6), scenario, runs=2)
