import jax
import jax.numpy as jnp
import numpy as np
import pytest

import textbook_filters as textbook
from locbounds.filters.range_update import correct, correct_in_plane, corrected, direction, no_correction
from locbounds.filters.tracks_last import dense, solve, symmetric, upper


def sequential(x, P, anchors, z, noises):
    dim = anchors.shape[1]
    P_pp = {pair: P[pair] for pair in upper(dim)}
    correction = no_correction(x[0], dim)
    for anchor, range_, noise in zip(anchors, z, noises, strict=True):
        correction = correct(correction, P_pp, direction(x[:dim], anchor), range_, noise)
    return correction


def at_once(x, P, anchors, z, noises):
    P_pp = {pair: P[pair] for pair in upper(2)}
    return correct_in_plane(P_pp, [direction(x[:2], anchor) for anchor in anchors], z, noises)


@pytest.mark.parametrize("std", [150.0, 1.0, 1e-2])
@pytest.mark.parametrize("update, dim", [(sequential, 2), (sequential, 3), (at_once, 2)])
def test_position_information_form_equals_the_gain_form(update, dim, std):
    rng = np.random.default_rng(int(std) + dim)
    n, anchors = 2 * dim, rng.uniform(-1e3, 1e3, (4, dim))
    x, root = rng.normal(size=n), rng.normal(size=(n, n)) * 30
    P, R = root @ root.T, std**2 * rng.uniform(1, 2, 4)
    h, H = textbook.ranges(x[:dim], anchors, n)
    z = h + rng.normal(size=4) * 3 * std
    z[2] = np.nan
    seen = [0, 1, 3]
    mean, _, likelihood = textbook.gain_form(x, P, z[seen], h[seen] + 2.0, H[seen], np.diag(R[seen]))
    with jax.enable_x64(True):
        noises = [(jnp.ones((1, 1)), jnp.full((1, 1), 2.0), jnp.full((1, 1), r)) for r in R]
        state = [jnp.full(1, a) for a in x], symmetric(jnp.asarray(P)[..., None])
        correction = update(*state, jnp.asarray(anchors), [jnp.full(1, a) for a in z], noises)
        ours = corrected(*state, correction)
        log_likelihood = 0.5 * jnp.log(correction.scale) - 0.5 * correction.energy - 1.5 * jnp.log(2 * jnp.pi)
        np.testing.assert_allclose(np.ravel(ours[0]), mean, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(log_likelihood[0], np.log(likelihood), rtol=1e-6)
        # the gain form loses digits in the covariance as P / R grows, here to 1e7: compare with the information form
        J = np.linalg.inv(P) + H[seen].T @ np.diag(1 / R[seen]) @ H[seen]
        covariance = np.linalg.inv(J)
        np.testing.assert_allclose(dense(ours[1])[..., 0], covariance, rtol=1e-7, atol=1e-3 * std**2)


def test_at_the_anchor_a_range_says_nothing_about_the_position():
    with jax.enable_x64(True):
        x, P = [jnp.ones(1)] * 4, symmetric(jnp.eye(4)[..., None])
        noise = [(jnp.ones((1, 1)), jnp.zeros((1, 1)), jnp.ones((1, 1)))]
        for update in (sequential, at_once):
            correction = update(x, P, jnp.ones((1, 2)), [jnp.full(1, 0.3)], noise)
            np.testing.assert_allclose([correction.energy[0], correction.scale[0]], [0.3**2, 1.0])
            np.testing.assert_array_equal(np.ravel(corrected(x, P, correction)[0]), np.ones(4))


def test_solve():
    root = np.random.default_rng(0).normal(size=(3, 3))
    A, b = root @ root.T, np.array([1.0, -2.0, 0.5])
    with jax.enable_x64(True):
        x = solve(symmetric(jnp.asarray(A)), list(jnp.asarray(b)))
    np.testing.assert_allclose(x, np.linalg.solve(A, b), rtol=1e-9)
