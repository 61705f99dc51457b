"""The switching likelihood against the sum over all sight sequences and against SciPy's matrix exponential."""

from functools import partial
from itertools import pairwise, product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import norm

from locbounds.fit import switching

EXACT = 1e-10  # double precision, sums of a few hundred terms
THETA = np.array([0.3, np.log(0.5), 2.0, np.log(1.5), np.log(0.4), np.log(1.1), -2.0, 3.0, np.log(9.0), 0.7])
T = np.array([0.0, 0.3, 1.0, 1.1, 4.0, 4.5, 5.2])
E = np.array([0.2, 2.5, np.nan, 0.1, 25.0, 3.0, -0.4])


def generator():
    a, b = np.exp(THETA[4:6])
    return np.array([[-a, a], [b, -b]])


def start(stationary):
    a, b = np.exp(THETA[4:6])
    nlos = a / (a + b) if stationary else 1 / (1 + np.exp(-THETA[9]))
    return np.array([1 - nlos, nlos])


def law(r, outliers):
    """Components (weight, mean, deviation) of one sight."""
    eps = 1 / (1 + np.exp(-THETA[6])) if outliers else 0.0
    m, s = (THETA[0], np.exp(THETA[1])) if r == 0 else (THETA[2], np.exp(THETA[3]))
    return [(1 - eps, m, s), (eps, THETA[7], np.exp(THETA[8]))]


STEP = [expm(generator() * (b - a)) for a, b in pairwise(T)]


def density(r, e, outliers):
    return sum(w * norm.pdf(e, m, s) for w, m, s in law(r, outliers)) if np.isfinite(e) else 1.0


def brute_force(label, stationary, outliers, upto=None):
    """p(e, sight) for every sequence of sights."""
    n = len(E) if upto is None else upto
    b = [[density(r, e, outliers) for r in (0, 1)] for e in E]
    found = {}
    for r in product((0, 1), repeat=n):
        p = start(stationary)[r[0]]
        for k in range(n):
            if k:
                p *= STEP[k - 1][r[k - 1], r[k]]
            if label[k] not in (-1, r[k]):
                p = 0.0
            p *= b[k][r[k]]
        found[r] = p
    return found


def test_transition_is_the_matrix_exponential_of_an_asymmetric_generator():
    dt = np.array([1e-6, 0.1, 2.0, 50.0])
    with jax.enable_x64(True):
        ours = np.exp(switching.log_transition(jnp.asarray(THETA[4]), jnp.asarray(THETA[5]), jnp.asarray(dt)))
    np.testing.assert_allclose(ours, [expm(generator() * d) for d in dt], rtol=1e-9, atol=0)


@pytest.mark.parametrize("outliers", [True, False])
@pytest.mark.parametrize("stationary", [True, False])
def test_likelihood_posterior_and_prediction_are_sums_over_all_sight_sequences(stationary, outliers):
    label = np.array([-1, -1, 1, -1, -1, 1, -1])
    if not stationary:
        label[:] = -1
    options = {"stationary": stationary, "outliers": outliers}
    with jax.enable_x64(True):
        args = [jnp.asarray(a) for a in (THETA, T, E, label)]
        likelihood = jax.jit(partial(switching.log_likelihood, **options))
        value = float(likelihood(*args))
        posterior, score = (np.asarray(a) for a in jax.jit(partial(switching.smooth, **options))(*args))
        filling = zip(args[1:], (jnp.nan, jnp.nan, -1), strict=True)
        padded = [args[0], *(jnp.concatenate([a, jnp.full(3, f, a.dtype)]) for a, f in filling)]
        assert float(likelihood(*padded)) == pytest.approx(value, rel=1e-14)
    joint = brute_force(label, stationary, outliers)
    total = sum(joint.values())
    assert value == pytest.approx(np.log(total), abs=EXACT)
    nlos = [sum(p for r, p in joint.items() if r[k] == 1) / total for k in range(len(E))]
    np.testing.assert_allclose(posterior[:, 1], nlos, atol=EXACT)
    np.testing.assert_allclose(posterior.sum(1), 1, atol=EXACT)
    for k in range(len(E)):
        if np.isnan(E[k]):
            assert np.isnan(score[k])
            continue
        past = brute_force(label, stationary, outliers, upto=k) if k else {(): 1.0}
        ahead = np.zeros(2)
        for r, p in past.items():
            ahead += p * (STEP[k - 1][r[k - 1]] if k else start(stationary))
        ahead /= ahead.sum()
        parts = [(ahead[r] * w, m, s) for r in (0, 1) for w, m, s in law(r, outliers)]
        below, above = (sum(w * f(E[k], m, s) for w, m, s in parts) for f in (norm.cdf, norm.sf))
        expected = norm.ppf(below) if below < above else norm.isf(above)
        assert score[k] == pytest.approx(expected, abs=1e-8)


def test_derivative_matches_differences():
    with jax.enable_x64(True):
        args = [jnp.asarray(a) for a in (T, E, np.full(len(T), -1))]
        value = jax.jit(partial(switching.log_likelihood, stationary=False, outliers=True))
        gradient = np.asarray(jax.jit(jax.grad(value))(jnp.asarray(THETA), *args))
        for i in range(10):
            h = 1e-5 * np.eye(10)[i]
            difference = float(value(THETA + h, *args) - value(THETA - h, *args)) / 2e-5
            assert gradient[i] == pytest.approx(difference, abs=1e-7)
