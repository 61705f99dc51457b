"""Bounds of a distance: textbook recursions, closed forms, the minimum mean square error of a static distance."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import erf, ndtr

import locbounds as lb
from distances import STEPS, TIMES, cut, model, rss, toa, track
from locbounds.ranging import (
    DistanceEkf,
    DistanceModel,
    Strength,
    TimeOfArrival,
    distance_bcrb,
    distance_wwb,
    evaluate_distance,
    information,
    measure,
)
from locbounds.verdict import Status

EXACT = 1e-9
CYCLES_PER_M = 2 * 44e6 / 299_792_458.0
CLOSE = 0.08  # of the Weiss-Weinstein bound to the minimum error, in the root mean square
SIGMAS = 4.0
IRREGULAR = lb.Times(np.cumsum([0.0, *np.random.default_rng(0).uniform(0.3, 2.0, STEPS)]))


def textbook(dts, information, ahead=0):
    """Filtered (or N steps predicted) and RTS-smoothed variances of d for a jerk-driven distance; scalars and lists."""
    P = np.diag([4.0, 0.25, 0.5625])
    filtered, predicted, moves = [P], [None], []
    for dt, J in zip(dts, information, strict=True):
        F = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
        G = np.array([dt**3 / 6, dt**2 / 2, dt])
        moves.append((F, np.outer(G, G)))
        M = F @ P @ F.T + np.outer(G, G)
        P = M - np.outer(M[:, 0], M[0]) * J / (1 + J * M[0, 0])
        predicted.append(M)
        filtered.append(P)
    S, smoothed = P, [P]
    for k in range(len(dts) - 1, -1, -1):
        A = filtered[k] @ moves[k][0].T @ np.linalg.inv(predicted[k + 1])
        S = filtered[k] + A @ (S - predicted[k + 1]) @ A.T
        smoothed.append(S)
    far = []
    for k in range(len(dts) + 1):
        P = filtered[max(k - ahead, 0)]
        for F, Q in moves[max(k - ahead, 0) : k]:
            P = F @ P @ F.T + Q
        far.append(P)
    return [np.array(x) for x in (filtered, far, smoothed[::-1])]


@pytest.mark.parametrize("times", [TIMES, IRREGULAR], ids=["uniform", "irregular"])
def test_gaussian_noise_gives_kalman_filter_predictor_and_smoother(times):
    gaussian = model(toa(noise=lb.Gaussian(0.0, 3.5), bias=None), times=times)
    J = 10 * CYCLES_PER_M**2 / 3.5**2
    filtered, ahead, smoothed = textbook(np.diff(times.time_s), np.full(STEPS, J), ahead=3)
    for horizon, expected in (("filter", filtered), ("predict:3", ahead), ("smooth", smoothed)):
        bound = distance_bcrb(gaussian, horizon=horizon)
        np.testing.assert_allclose(bound.covariance, expected, rtol=EXACT, atol=EXACT)
        shifted = distance_wwb(gaussian, horizon=horizon)
        np.testing.assert_allclose(shifted.position_mse, expected[:, 0, 0], rtol=1e-6)
        assert shifted.sees == bound.sees


def test_informations_are_those_of_closed_forms():
    both = Strength(lb.Gaussian(0.0, 1.6), lb.Gaussian(0.0, 3.0), exponent=2.5, samples=10)
    slope = 25 / math.log(10) / track()[1:]
    own = 10 * slope**2 / (1.6**2 + 3.0**2)
    np.testing.assert_allclose(information(model(both), track()), own, rtol=EXACT)
    shared = rss(common=True)
    np.testing.assert_allclose(information(model(shared), track()), slope**2 / (1.6**2 / 10 + 3.0**2), rtol=EXACT)
    arrival = information(model(toa()))
    e = np.linspace(-40.0, 43.0, 400_001)
    p = (ndtr(e / 3.5) - ndtr((e - 3.0) / 3.5)) / 3.0
    score = np.gradient(np.log(np.maximum(p, 1e-300)), e)
    one = np.sum(np.where(p > 1e-200, p * score**2, 0.0)) * (e[1] - e[0])
    np.testing.assert_allclose(arrival, 10 * CYCLES_PER_M**2 * one, rtol=1e-6)
    np.testing.assert_allclose(information(model(toa(), rss()), track()), arrival + own, rtol=EXACT)


def test_a_prior_measured_anew_at_every_step_is_over_confident_and_says_so():
    once, often = (distance_bcrb(model(toa()), derivatives=d) for d in ("initial", "every step"))
    assert np.all(often.position_mse[1:] <= once.position_mse[1:])
    assert often.position_rmse[-1] < 0.6 * once.position_rmse[-1]
    assert once.verdict.status is Status.VALID
    assert often.verdict.status is Status.CONDITIONAL
    assert "counts one prior many times" in str(often.verdict)
    P, J = np.diag([4.0, 0.25, 0.5625]), information(model(toa()))[0]
    F, G = np.array([[1, 1, 0.5], [0, 1, 1], [0, 0, 1]]), np.array([1 / 6, 0.5, 1.0])
    for _ in range(STEPS):
        P = np.linalg.inv(np.linalg.inv(F @ P @ F.T + np.outer(G, G)) + np.diag([J, 1 / 0.25, 1 / 0.5625]))
    np.testing.assert_allclose(often.covariance[-1], P, rtol=1e-7)


def test_signal_strengths_have_conditional_numbers_only():
    with pytest.raises(lb.RefusedError, match=r"E\[1/d\^2\]"):
        distance_bcrb(model(rss()))
    with pytest.raises(lb.RefusedError, match=r"E\[1/d\^2\]"):
        distance_wwb(model(toa(), rss()))
    for bound in (distance_bcrb(model(toa(), rss()), track=track()), distance_wwb(model(rss()), track=track())):
        assert bound.verdict.status is Status.CONDITIONAL
        assert "conditional on the trajectory" in str(bound.verdict)


def test_cut_noise_is_refused_by_the_bound_that_needs_an_information():
    with pytest.raises(lb.RefusedError, match="no finite Fisher information"):
        distance_bcrb(model(toa(noise=cut(3.5))))


def test_a_given_information_is_checked_and_named_in_the_verdict():
    sensor = toa(bias=None)
    J = information(model(sensor))
    given, found = distance_bcrb(model(toa(noise=cut(3.5))), given=J), distance_bcrb(model(sensor))
    np.testing.assert_array_equal(given.position_mse, found.position_mse)
    assert found.verdict.status is Status.VALID
    assert given.verdict.status is Status.CONDITIONAL
    assert "the information as given" in str(given.verdict)
    both = distance_bcrb(model(rss()), track=track(), given=J)
    assert both.verdict.reasons == ("conditional on the trajectory", "the information as given")
    for wrong, words in ((J[:-1], "shape"), (np.append(J, 1.0), "shape"), (-J, "negative"), (J * np.nan, "not finite")):
        with pytest.raises(lb.InputError, match=words):
            distance_bcrb(model(sensor), given=wrong)


def test_noise_that_cannot_be_decided_leaves_the_bound_undecided():
    creeping = lb.FromLogDensity(
        lambda w: jnp.log(w) + jnp.log(1 - jnp.log(w)) + 2 * jnp.log1p(-w), support=(0.0, 1.0), normalise=True
    )
    found = distance_bcrb(model(toa(noise=creeping, bias=None)))
    assert found.verdict.status is Status.UNDECIDED
    assert found.verdict.reasons[0].startswith("TimeOfArrival: ")


def log_density(e):
    """Of cut Gaussian noise (3.5 cycles) plus a uniform bias (0 to 3), by its closed form."""
    s, g = 3.5, 3.0
    with np.errstate(divide="ignore"):
        return np.log(np.maximum(ndtr(np.minimum(e, 2 * s) / s) - ndtr(np.maximum(e - g, -2 * s) / s), 0.0)) - np.log(
            g * erf(math.sqrt(2))
        )


def static_mmse(samples, runs, seed=0):
    """Mean of the posterior variance of a distance N(10, 2^2), and its standard error."""
    rng = np.random.default_rng(seed)
    places = np.linspace(-7.0, 10.0, 20_001)
    logs = np.maximum(log_density(places), -1e3)
    found = []
    for _ in range(runs):
        d = 10.0 + 2.0 * rng.normal()
        e = 3.5 * rng.normal(size=2 * samples + 50)
        z = CYCLES_PER_M * d + e[np.abs(e) < 7.0][:samples] + rng.uniform(0.0, 3.0, samples)
        low, high = max((z.max() - 10.0) / CYCLES_PER_M, -2.0), min((z.min() + 7.0) / CYCLES_PER_M, 22.0)
        x = np.linspace(low, high, 123)[1:-1]
        log_p = -((x - 10.0) ** 2) / 8
        log_p = log_p + np.array([np.interp(z - CYCLES_PER_M * v, places, logs).sum() for v in x])
        p = np.exp(log_p - log_p.max())
        p /= p.sum()
        found.append(p @ x**2 - (p @ x) ** 2)
    return np.mean(found), np.std(found) / np.sqrt(runs)


@pytest.mark.parametrize(("samples", "runs"), [(1, 300), (10, 300), (100, 300), (1_000, 100)])
def test_weiss_weinstein_is_below_the_minimum_error_of_a_static_distance_and_close_to_it(samples, runs):
    close_to_the_minimum(samples, runs)


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "runs"), [(1, 4_000), (10, 4_000), (100, 4_000), (1_000, 1_000), (10_000, 200)])
def test_weiss_weinstein_of_a_static_distance_with_many_runs(samples, runs):
    close_to_the_minimum(samples, runs)


def close_to_the_minimum(samples, runs):
    sensor = toa(noise=cut(3.5), samples=samples)
    static = DistanceModel(lb.Times.uniform(step_s=1.0, steps=1), [10.0], [2.0], 0.0, [sensor])
    mmse, error = static_mmse(samples, runs)
    bound = distance_wwb(static).position_mse[1]
    assert bound < mmse + SIGMAS * error
    assert bound > (1 - CLOSE) ** 2 * (mmse - SIGMAS * error)


def test_bad_input_is_named():
    with pytest.raises(lb.InputError, match="0 samples"):
        toa(samples=0)
    with pytest.raises(lb.InputError, match="True samples"):
        rss(samples=True)
    with pytest.raises(lb.InputError, match="exponent is 0"):
        rss(exponent=0.0)
    with pytest.raises(lb.InputError, match="cycles per metre"):
        toa(cycles_per_m=0.0)
    at_zero = np.append(track()[:-1], 0.0)
    for asked in (
        lambda: distance_bcrb(model(rss()), track=at_zero),
        lambda: distance_wwb(model(rss()), track=at_zero),
        lambda: measure((rss(),), at_zero[1:]),
        lambda: evaluate_distance(DistanceEkf(), model(rss()), runs=2, track=at_zero),
    ):
        with pytest.raises(lb.RefusedError, match="no value at a distance of 0 m"):
            asked()
    with pytest.raises(lb.InputError, match="13 steps ahead, the record has 12"):
        distance_bcrb(model(toa()), horizon="predict:13")
    with pytest.raises(lb.InputError, match="shape"):
        distance_bcrb(model(rss()), track=track()[:-1])
    with pytest.raises(lb.InputError, match="derivatives is 'twice'"):
        distance_bcrb(model(toa()), derivatives="twice")
    with pytest.raises(lb.InputError, match="nothing is measured"):
        model()
    with pytest.raises(lb.InputError, match="one number each"):
        DistanceModel(TIMES, [1.0, 0.0], [1.0], 1.0, [toa()])


def test_the_clock_of_round_trips():
    assert TimeOfArrival(lb.Gaussian(0.0, 1.0)).cycles_per_m == pytest.approx(CYCLES_PER_M, rel=1e-15)
