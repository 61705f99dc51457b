"""Motion models against Van Loan's integral of the white disturbance, and against each other."""

import jax
import numpy as np
import pytest
from scipy.linalg import expm

import locbounds as lb

ROUNDING = 1e-12


def matrices(motion, dt):
    with jax.enable_x64(True):
        return np.asarray(motion.transition(dt)), np.asarray(motion.covariance(dt))


def van_loan(A, driving, dt):
    """F and Q of ``x' = A x + white noise`` over an interval."""
    n = len(A)
    E = expm(np.block([[-A, driving], [np.zeros((n, n)), A.T]]) * dt)
    return E[n:, n:].T, E[n:, n:].T @ E[:n, n:]


def chain_of_integrators(order, dim, intensity):
    n = order * dim
    A = np.eye(n, k=dim)
    driving = np.zeros((n, n))
    driving[n - dim :, n - dim :] = np.diag(intensity)
    return A, driving


def turn(rate, intensity, dim):
    A = np.zeros((2 * dim, 2 * dim))
    A[:dim, dim:] = np.eye(dim)
    A[dim, dim + 1], A[dim + 1, dim] = -rate, rate
    driving = np.zeros((2 * dim, 2 * dim))
    driving[dim:, dim:] = intensity * np.eye(dim)
    return A, driving


@pytest.mark.parametrize("dim", [2, 3])
def test_the_matrices_are_van_loans_integral(dim):
    q = np.array([0.5, 2.0, 0.1])[:dim]
    cases = [
        (lb.RandomWalk(q, dim), chain_of_integrators(1, dim, q)),
        (lb.ConstantAcceleration(q, dim), chain_of_integrators(3, dim, q)),
        *[(lb.CoordinatedTurn(w, 0.7, dim), turn(w, 0.7, dim)) for w in (-1.3, 0.4, 0.013, 0.0125, 1e-5, 0.0)],
    ]
    for motion, (A, driving) in cases:
        for dt in (0.8, 2.5):
            for got, expected in zip(matrices(motion, dt), van_loan(A, driving, dt), strict=True):
                np.testing.assert_allclose(got, expected, atol=ROUNDING * 10, rtol=1e-11, err_msg=repr((motion, dt)))


def test_no_turn_is_constant_velocity():
    for got, expected in zip(
        matrices(lb.CoordinatedTurn(0.0, 0.5, 3), 0.7), matrices(lb.ConstantVelocity(0.5, 3), 0.7), strict=True
    ):
        np.testing.assert_allclose(got, expected, atol=ROUNDING)


def test_names_say_what_a_state_holds():
    assert lb.ConstantAcceleration(1.0).state_names == ("x_m", "y_m", "vx_m_s", "vy_m_s", "ax_m_s2", "ay_m_s2")
    assert lb.RandomWalk(1.0, 3).state_names == ("x_m", "y_m", "z_m")
    assert lb.LinearMotion(np.ones((2, 1, 1)), np.ones((2, 1, 1)), position_index=(0,)).state_names == ("x0",)


BAD = [
    (lambda: lb.RandomWalk(-1.0), "diffusion"),
    (lambda: lb.ConstantAcceleration([1.0, np.inf]), "jerk intensity"),
    (lambda: lb.RandomWalk(1.0, 1), "2 or 3"),
    (lambda: lb.CoordinatedTurn(np.nan, 1.0), "turn rate"),
    (lambda: lb.CoordinatedTurn([0.1, 0.2], 1.0), "one rate"),
    (lambda: lb.LinearMotion(np.eye(2), np.eye(2)), "steps, state, state"),
    (lambda: lb.LinearMotion(np.ones((3, 1, 1)), -np.ones((3, 1, 1)), position_index=(0,)), "Q of step 1"),
    (lambda: lb.LinearMotion(np.ones((3, 1, 1)), np.ones((3, 1, 1)), position_index=(1,)), "position"),
    (lambda: lb.SwitchingMotion([lb.RandomWalk(1.0)], lb.MarkovSight.stay(0.9)), "1 motions for 2 modes"),
    (lambda: lb.SwitchingMotion([lb.RandomWalk(1.0), lb.ConstantVelocity(1.0)], lb.MarkovSight.stay(0.9)), "different"),
]


@pytest.mark.parametrize("build, cause", BAD)
def test_what_makes_no_sense_is_an_input_error(build, cause):
    with pytest.raises(lb.InputError, match=cause):
        build()


def test_matrices_for_another_number_of_steps_are_an_input_error():
    motion = lb.LinearMotion(np.ones((3, 1, 1)), np.ones((3, 1, 1)), position_index=(0,))
    with pytest.raises(lb.InputError, match="3 steps, the times for 4"):
        motion.transitions(np.ones(4))
