"""Singular process noise: a whole-trajectory information matrix in the coordinates (x_0, noises)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import locbounds as lb
from locbounds.blocks import GROUPS
from locbounds.bounds.general.engine import PATHS
from locbounds.bounds.general.frame import frame
from locbounds.bounds.general.increments import information_increments
from locbounds.paths import draw_paths
from models import CHAIN, START, STEPS, gaussian, information, log_sum

EXACT = 1e-9
SIGMAS = 4.0
DT = 0.7
G = np.array([DT**2 / 2, DT])
F = np.array([[1.0, DT], [0.0, 1.0]])
PUSH = np.array([[0.0, 0.0], [-0.1, -0.4]])  # by mode: the mean acceleration as a function of the state
Q = np.array([0.3, 1.2])
STD = np.array([1.0, 2.5])
P0 = np.array([[2.0, 0.3], [0.3, 0.5]])


def motion(f, q):
    repeat = (STEPS, 2, 2)
    return lb.LinearMotion(np.broadcast_to(f, repeat), np.broadcast_to(q, repeat), position_index=(0,))


def model(f=None, q=None):
    f = [F + np.outer(G, push) for push in PUSH] if f is None else f
    q = [v * np.outer(G, G) for v in Q] if q is None else q
    return lb.JumpMarkov(
        times=lb.Times.uniform(step_s=DT, steps=STEPS),
        prior=lb.GaussianPrior([0.0, 1.0], P0),
        motion=[motion(f_r, q_r) for f_r, q_r in zip(f, q, strict=True)],
        channels=lb.AdditiveChannel(lambda x, mode, k: x[0] + 0.05 * x[0] ** 2, [lb.Gaussian(0, s) for s in STD]),
        chains=lb.MarkovSight(START, CHAIN),
    )


def trajectory():
    """x_k as a linear function of (x_0, u_1, ..., u_K), [K+1, 2, 2+K]; u is the acceleration beyond mode 0's."""
    rows = [np.eye(2, 2 + STEPS)]
    for k in range(STEPS):
        rows.append(F @ rows[-1] + np.outer(G, np.eye(2 + STEPS)[2 + k]))
    return np.array(rows)


def test_singular_noise_against_the_whole_trajectory():
    """The same draws, another linear algebra: no covariance recursion, no pseudo-inverse, no reference motion."""
    m, x = model(), trajectory()
    bound = lb.bcrb(m, samples=1)
    with jax.enable_x64(True):
        paths = draw_paths(m, np.uint32(0), np.uint32(0), GROUPS * PATHS)
        part = frame(m).parts[0]
        out = information_increments(part, paths.x, paths.z, jnp.zeros((STEPS, 4, 4)), groups=GROUPS, window=STEPS)
        drawn = np.asarray(out.information).mean(0)
    J = np.zeros((2 + STEPS, 2 + STEPS))
    J[:2, :2] = np.linalg.inv(P0)
    law = START
    for k in range(1, STEPS + 1):
        law = law @ CHAIN
        for r in (0, 1):
            noise = np.eye(2 + STEPS)[1 + k] - PUSH[r] @ x[k - 1]
            J += law[r] / Q[r] * np.outer(noise, noise)
        states = np.concatenate([x[k - age] for age in range(k + 1)])
        J += states.T @ drawn[k - 1, : k + 1, :, : k + 1].reshape(len(states), len(states)) @ states
        until = slice(0, 2 + k)  # later noises are not there yet
        P = x[k][:, until] @ np.linalg.solve(J[until, until], x[k][:, until].T)
        np.testing.assert_allclose(bound.covariance[k], P, rtol=EXACT, atol=EXACT)


def test_singular_noise_against_the_sum_over_all_mode_sequences():
    """The score in the coordinates (x_0, noises), by differentiating the sum."""
    m, n = model(), 16384
    draws = lb.simulate(m, runs=n, seed=2)
    x, inverse = trajectory(), np.linalg.inv(P0)
    theta = np.zeros((n, 2 + STEPS))
    theta[:, :2] = draws.states[:, 0]
    for k in range(1, STEPS + 1):
        theta[:, 1 + k] = (draws.states[:, k] - draws.states[:, k - 1] @ F.T) @ G / (G @ G)

    def log_density(theta, z):
        states = jnp.asarray(x) @ theta

        def step(k, r):
            p = states[k + 1, 0]
            push = PUSH[r] @ states[k]
            return gaussian(theta[2 + k], push, np.sqrt(Q[r])) + gaussian(z[k], p + 0.05 * p**2, STD[r])

        e = theta[:2] - np.array([0.0, 1.0])
        return log_sum(step, START, CHAIN, STEPS) - 0.5 * e @ inverse @ e

    J, groups = information(log_density, theta, draws.measurements[..., 0])
    row = x[STEPS][0]

    def position_mse(J):
        return row @ np.linalg.solve(J, row)

    left_out = np.array([position_mse(J + (J - g) / (len(groups) - 1)) for g in groups])
    error = np.sqrt((len(groups) - 1) / len(groups) * np.sum(np.square(left_out - left_out.mean())))
    bound = lb.bcrb(m, samples=n)
    spread = np.asarray(bound.replicates)[:, -1].std(ddof=1) / np.sqrt(GROUPS)
    assert np.hypot(error, spread) < 0.02 * position_mse(J)
    assert abs(bound.position_mse[-1] - position_mse(J)) < SIGMAS * np.hypot(error, spread)


REVEALED = {
    "other subspaces": dict(q=[np.outer(G, G), np.diag([0.1, 0.2])]),
    "noise in one mode only": dict(q=[np.outer(G, G), np.zeros((2, 2))]),
    "moved outside the subspace": dict(f=[F, np.array([[0.9, DT], [0.0, 1.0]])]),
}


@pytest.mark.parametrize("name", REVEALED)
def test_a_state_that_reveals_the_mode_is_refused(name):
    with pytest.raises(lb.RefusedError, match="reveals the mode"):
        lb.bcrb(model(**REVEALED[name]), samples=1)


def test_no_noise_in_any_mode_is_no_contradiction():
    """All modes stand still alike: the bound is that of a constant with switching measurements."""
    still = model(f=[np.eye(2)] * 2, q=[np.zeros((2, 2))] * 2)
    bound = lb.bcrb(still, samples=1)
    assert np.all(np.diff(bound.position_mse) < 0)
    learned = 1 - bound.covariance[:, 0, 0] / P0[0, 0]  # of the other component through its correlation only
    np.testing.assert_allclose(bound.covariance[:, 1, 1], P0[1, 1] - P0[0, 1] ** 2 / P0[0, 0] * learned, rtol=EXACT)
