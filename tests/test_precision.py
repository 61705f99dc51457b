"""The double-precision boundary: plain, grad, jit, vmap, threads, with the user's x64 on and off."""

import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from locbounds.precision import double_precision, float64
from scenarios import one_link

ROUNDING = 1e-11
SAMPLES = 1024
FINITE_DIFFERENCES = 1e-4  # relative, central differences of smooth functions on the same draws
SIGMAS = 4.0

BOUNDS = {"bcrb": lb.bcrb, "enumer": lb.enumer}


def value(bound, seed=0, **changes):
    return BOUNDS[bound](one_link(**changes), samples=SAMPLES, seed=seed).mean_position_rmse()


def test_results_are_numpy_float64_and_the_configuration_stays():
    assert not jax.config.jax_enable_x64  # pyright: ignore[reportAttributeAccessIssue]
    bound = lb.bcrb(one_link(), samples=SAMPLES)
    for array in (bound.position_mse, bound.replicates, bound.covariance, bound.time_s):
        assert type(array) is np.ndarray
        assert array.dtype == np.float64
    draws = lb.simulate(one_link(), runs=3)
    assert draws.states.dtype == draws.measurements.dtype == np.float64
    assert jnp.ones(1).dtype == jnp.float32
    for leaf in jax.tree.leaves(one_link()):
        assert isinstance(leaf, np.ndarray)


def test_x64_on_or_off_or_in_a_thread_the_bits_are_the_same():
    plain = lb.bcrb(one_link(), samples=SAMPLES).position_mse
    with jax.enable_x64(True):
        on = lb.bcrb(one_link(), samples=SAMPLES).position_mse
    found = []
    thread = threading.Thread(target=lambda: found.append(lb.bcrb(one_link(), samples=SAMPLES).position_mse))
    thread.start()
    thread.join()
    assert np.array_equal(on, plain)
    assert np.array_equal(found[0], plain)


def test_single_precision_arrays_are_widened_before_anything_is_computed():
    @double_precision
    def third(x):
        return jnp.asarray(x) / 3

    single = np.array([0.1], np.float32)
    assert third(single)[0] == np.float64(single[0]) / 3
    assert third(jnp.asarray(single))[0] == np.float64(single[0]) / 3
    assert lb.Range(jnp.asarray([0.5, 1.0])).anchor.dtype == np.float64


@pytest.mark.parametrize(
    "transform",
    [
        lambda f: jax.grad(f)(3.0),
        lambda f: jax.jit(f)(3.0),
        lambda f: jax.vmap(f)(jnp.ones(2)),
        lambda f: jax.jacfwd(f)(3.0),
    ],
)
def test_transformed_in_single_precision_it_refuses_with_the_line_to_add(transform):
    with pytest.raises(lb.PrecisionError, match=r'jax\.config\.update\("jax_enable_x64", True\)'):
        transform(lambda std: value("bcrb", std=std))


def test_jit_vmap_and_plain_agree():
    plain = [value("bcrb", std=std) for std in (3.0, 4.0)]
    with jax.enable_x64(True):
        scenarios = jax.vmap(lambda std: one_link(std=std))(jnp.array([3.0, 4.0]))  # a scenario is a pytree
        results = jax.jit(jax.vmap(lambda s: lb.bcrb(s, samples=SAMPLES)))(scenarios)  # and so is a result
        assert results.position_mse.dtype == jnp.float64
    np.testing.assert_allclose(np.sqrt(results.position_mse).mean(-1), plain, rtol=ROUNDING)


SMOOTH = {"std": 1e-2, "anchor": 1e-1, "intensity": 1e-3, "prior_std": 1e-2}  # the draws move smoothly with them: steps
AT = {"std": 3.0, "anchor": -60.0, "intensity": 0.4, "prior_std": 8.0, "stay": 0.85}


@pytest.fixture(scope="module", params=["bcrb", pytest.param("enumer", marks=pytest.mark.slow)])
def gradients(request):
    """Gradients of a bound on the draws of several seeds, with respect to all of AT."""
    with jax.enable_x64(True):
        slope = jax.grad(lambda at, seed: value(request.param, seed, **at))
        at = {name: jnp.asarray(x) for name, x in AT.items()}
        return request.param, [{name: float(x) for name, x in slope(at, seed).items()} for seed in range(16)]


def test_gradients_on_the_same_draws_are_finite_differences(gradients):
    bound, slopes = gradients
    for name, step in SMOOTH.items():
        above, below = (value(bound, **AT | {name: AT[name] + h}) for h in (step, -step))
        assert slopes[0][name] == pytest.approx((above - below) / (2 * step), rel=FINITE_DIFFERENCES), name


def test_gradient_with_respect_to_the_chain_is_that_of_the_expectation(gradients):
    """The drawn sight jumps with ``stay``: the derivative needs the likelihood ratios of the draws."""
    bound, slopes = gradients
    stay = np.array([slope["stay"] for slope in slopes])
    many = [BOUNDS[bound](one_link(**AT | {"stay": p}), samples=128 * SAMPLES) for p in (0.9, 0.8)]
    difference = (many[0].mean_position_rmse() - many[1].mean_position_rmse()) / 0.1
    error = np.hypot(many[0].mean_position_rmse_stderr(), many[1].mean_position_rmse_stderr()) / 0.1
    error = np.hypot(error, stay.std(ddof=1) / np.sqrt(len(stay)))
    assert abs(stay.mean() - difference) < SIGMAS * error
    assert abs(difference) > 1.5 * SIGMAS * error  # a derivative of zero would be noticed


def test_gradient_with_respect_to_mixture_weights_is_that_of_the_expectation():
    def mean_square(w, seed):
        noise = lb.GaussianMixture(jnp.stack([1 - w, w]), [0.0, 4.0], [1.0, 3.0])
        return jnp.mean(noise.sample(jax.random.key(seed), (200_000,)) ** 2)

    with jax.enable_x64(True):
        slopes = np.array([float(jax.grad(mean_square)(0.3, seed)) for seed in range(16)])
    error = slopes.std(ddof=1) / 4
    assert abs(slopes.mean() - (4.0**2 + 3.0**2 - 1.0)) < SIGMAS * error  # E[w^2] is linear in the weight
    assert error < 0.1


def test_a_plain_call_inside_a_users_jit_is_a_constant():
    scenario = one_link()
    plain = lb.bcrb(scenario, rtol=2e-2).mean_position_rmse()

    @jax.jit
    def double(x):
        return x * lb.bcrb(scenario, rtol=2e-2).mean_position_rmse()

    assert double(2.0) == pytest.approx(2 * plain, rel=1e-6)  # the user's own single precision


def test_tracks_and_ranges_are_differentiable_and_jit_able():
    def far(std):
        return lb.simulate(one_link(std=std), runs=3).measurements.sum()

    with jax.enable_x64(True):
        slope = jax.grad(far)(3.0)
        compiled = jax.jit(lambda s: lb.simulate(s, runs=3))(one_link())
    assert slope == pytest.approx((far(3.1) - far(2.9)) / 0.2, rel=FINITE_DIFFERENCES)
    np.testing.assert_allclose(compiled.measurements, lb.simulate(one_link(), runs=3).measurements, rtol=ROUNDING)


def test_traced_and_plain_models_are_the_same():
    with jax.enable_x64(True):
        for build in (
            lambda p: lb.MarkovSight.stay((p, 0.6)).start,
            lambda p: lb.MarkovSight(None, [[p, 1 - p], [0.2, 0.8]]).start,
            lambda p: lb.DwellSight(None, [p, 3.0]).start,
            lambda p: lb.ConstantVelocity(p).covariance(0.5),
            lambda p: lb.Range([p, 2.0])(jnp.array([1.0, 1.0])),
        ):
            np.testing.assert_allclose(jax.jit(build)(0.9), np.asarray(build(0.9)), rtol=ROUNDING)


def test_what_cannot_be_done_while_traced_is_refused():
    with jax.enable_x64(True):
        with pytest.raises(lb.InputError, match="rtol"):
            jax.grad(lambda std: lb.bcrb(one_link(std=std), rtol=1e-2).mean_position_rmse())(3.0)
        with pytest.raises(lb.InputError, match="Algorithm 1"):
            jax.grad(lambda std: lb.bcrb_algorithm1(one_link(std=std)).mean_position_rmse())(3.0)


def test_float64_leaves_none_alone():
    assert float64(None) is None
    assert float64([1, 2]).dtype == np.float64


@pytest.mark.parametrize(
    "noise",
    [lb.StudentT(4.5, 1.0, 2.0), lb.LogNormal(2.0, 0.7), lb.Gamma(3.5, 2.0)],
    ids=["Student", "log-normal", "gamma"],
)
def test_a_noise_answers_in_double_precision(noise):
    assert not jax.config.jax_enable_x64  # pyright: ignore[reportAttributeAccessIssue]
    w, q = np.array(1.0), np.array(0.3)
    answers = [noise.mean, noise.variance, noise.log_prob(w), noise.score(w), noise.cdf(w), noise.quantile(q)]
    answers += [noise.sample(jax.random.key(0), (2,)), noise.information(), noise.expect(abs)]
    assert {np.asarray(a).dtype for a in answers} == {np.dtype(np.float64)}
    with jax.enable_x64(True):
        assert noise.cdf(w) == answers[4]
