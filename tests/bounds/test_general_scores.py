"""One path at a time: every entry of the general engine's increments against derivatives of the sum over sequences.

With a copy of the state for each step's density, ``log sum_r prod_n f_n(theta_n, r_n)`` has the gradient
``E[g_n | x, z]`` and off-diagonal Hessian blocks ``Cov(g_n, g_k | x, z)``: autodiff of the sum gives all that the
engine's recursion computes, by another way.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from locbounds.bounds.general.frame import frame
from locbounds.bounds.general.increments import information_increments
from locbounds.paths import draw_paths
from models import CHAIN, START, STEPS, log_step, log_sum, switching

EXACT = 1e-9  # relative and absolute, numbers of order one
PATHS = 24


def derivatives(x, z, k):
    """Of the log-sum at horizon k: E[g_n | x, z] [k, 2], Cov(g_n, g_k | x, z) [k, 2, 2] and Pr(r_k | x, z) [2].

    The last is the derivative with respect to a weight of the newest step's modes.
    """

    def f(theta, weight):
        newest = jnp.arange(k) == k - 1

        def weighted(n, r):
            return log_step(theta[n, 0], theta[n, 1], z[n], r) + newest[n] * weight[r]

        return log_sum(weighted, START, CHAIN, k)

    theta = jnp.stack([x[1 : k + 1], x[:k]], -1)
    gradient, hessian = jax.grad(f, (0, 1)), jax.hessian(f)
    a, posterior = gradient(theta, jnp.zeros(2))
    return a, hessian(theta, jnp.zeros(2))[:, :, k - 1, :], posterior


def step_gradients(x, before, z):
    """The gradients of the newest step for known modes, [modes, 2]."""
    return jnp.stack([jnp.stack(jax.grad(log_step, (0, 1))(x, before, z, r)) for r in (0, 1)])


@pytest.fixture(scope="module")
def paths():
    model = switching()
    with jax.enable_x64(True):
        what = frame(model)
        drawn = draw_paths(model, np.uint32(0), np.uint32(0), PATHS)
        out = information_increments(
            what.parts[0], drawn.x, drawn.z, jnp.zeros((STEPS, 2, 2)), groups=PATHS, window=STEPS
        )
        x, z = np.asarray(drawn.x)[..., 0].T, np.asarray(drawn.z[0]).T
        oracle = [
            jax.tree.map(np.asarray, jax.jit(jax.vmap(lambda x, z, k=k: derivatives(x, z, k)))(x, z))
            for k in range(1, STEPS + 1)
        ]
        g = np.asarray(jax.jit(jax.vmap(jax.vmap(step_gradients)))(x[:, 1:], x[:, :-1], z))
        return x, z, np.asarray(out.information)[:, :, :, 0, :, 0], np.asarray(out.score), oracle, g


def spread(k, rows):
    """From the two states of every step 1..k to ages 0..k: step n is about ages k-n and k-n+1."""
    out = np.zeros((k + 1, *rows.shape[2:]))
    for n in range(1, k + 1):
        out[k - n] += rows[n - 1, 0]
        out[k - n + 1] += rows[n - 1, 1]
    return out


def test_the_scores_are_derivatives_of_the_sum_over_sequences(paths):
    """The newest scores as they are, the older ones through the martingale's increments."""
    _, _, table, newest, oracle, _ = paths
    for i in range(PATHS):
        before = np.zeros((0, 2))
        for k, (a, _, _) in enumerate(oracle, start=1):
            np.testing.assert_allclose(newest[i, k - 1], a[i, -1], rtol=EXACT, atol=EXACT)
            older = spread(k, np.concatenate([a[i, :-1] - before, np.zeros((1, 2))]))[2:]
            got = table[i, k - 1, 2 : k + 1, 2 : k + 1]  # ages 2 and more are touched by nothing else
            np.testing.assert_allclose(got, np.outer(older, older), rtol=EXACT, atol=EXACT)
            before = a[i]


def test_all_increments_are_derivatives_of_the_sum_over_sequences(paths):
    """Louis' identity draw by draw: what the sum's Hessian says about the newest step and its older ones."""
    x, _, table, _, oracle, g = paths
    information = np.array([1 / 0.7**2, 1 / 1.5**2])  # of the noises
    for i in range(PATHS):
        before = np.zeros((0, 2))
        for k, (a, covariance, posterior) in enumerate(oracle, start=1):
            older = spread(k, np.concatenate([a[i, :-1] - before, np.zeros((1, 2))]))
            expected = np.outer(older, older)
            slope = np.array([1 + 0.2 * x[i, k], 1.5])
            expected[0, 0] += np.sum(posterior[i] * information * slope**2)
            expected[:2, :2] -= np.einsum("r,ra,rb->ab", posterior[i], g[i, k - 1], g[i, k - 1])
            expected[:2, :2] += np.outer(a[i, -1], a[i, -1])
            for n in range(k - 1):
                only = np.zeros((k, 2, 2))
                only[n] = covariance[i, n]
                cross = np.pad(-spread(k, only), ((0, 0), (0, k - 1)))
                expected += cross + cross.T
            np.testing.assert_allclose(table[i, k - 1, : k + 1, : k + 1], expected, rtol=EXACT, atol=EXACT)
            assert np.all(table[i, k - 1, k + 1 :] == 0)
            before = a[i]


def test_a_channel_by_its_density_gives_the_same_scores(paths):
    """The user's own log-density in place of h and a noise; known-mode information by products instead."""
    x, z, table, newest, _, _ = paths
    additive = switching()
    own = lb.DensityChannel(
        lambda z, x, mode, k: additive.channels[0].noises[mode].log_prob(z - additive.channels[0].h(x, mode, k)),
        additive.channels[0].draw,
    )
    model = lb.JumpMarkov(
        times=additive.times, prior=additive.prior, motion=additive.motion, channels=own, chains=additive.chains
    )
    with jax.enable_x64(True):
        out = information_increments(
            frame(model).parts[0], x.T[..., None], (z.T,), jnp.zeros((STEPS, 2, 2)), groups=PATHS, window=STEPS
        )
        np.testing.assert_allclose(out.score[..., :2], newest, rtol=EXACT, atol=EXACT)
        other = np.asarray(out.information)[:, :, :, 0, :, 0]
    difference = other - table
    difference[:, :, 0, 0] = 0  # the only entry where the known-mode information enters
    np.testing.assert_allclose(difference, 0.0, atol=EXACT)
