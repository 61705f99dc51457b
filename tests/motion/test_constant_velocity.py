"""Constant velocity: against the integral of the white acceleration, and composition over time."""

import jax
import numpy as np
import pytest
from scipy.linalg import expm

import locbounds as lb

ROUNDING = 1e-12


def matrices(motion, dt):
    with jax.enable_x64(True):
        return np.asarray(motion.transition(dt)), np.asarray(motion.covariance(dt))


@pytest.mark.parametrize("dim", [2, 3])
def test_continuous_white_acceleration_is_van_loans_integral(dim):
    psd = np.array([0.5, 2.0, 0.1])[:dim]
    F, Q = matrices(lb.ConstantVelocity(psd, dim=dim), 0.7)
    n = 2 * dim
    A = np.zeros((n, n))
    A[:dim, dim:] = np.eye(dim)
    driving = np.zeros((n, n))
    driving[dim:, dim:] = np.diag(psd)
    van_loan = expm(np.block([[-A, driving], [np.zeros((n, n)), A.T]]) * 0.7)
    np.testing.assert_allclose(F, van_loan[n:, n:].T, atol=ROUNDING)
    np.testing.assert_allclose(Q, van_loan[n:, n:].T @ van_loan[:n, n:], atol=ROUNDING)


def test_two_short_steps_are_one_long_step():
    motion = lb.ConstantVelocity([0.5, 0.2])
    (F1, Q1), (F2, Q2), (F, Q) = (matrices(motion, dt) for dt in (0.3, 1.1, 1.4))
    np.testing.assert_allclose(F2 @ F1, F, atol=ROUNDING)
    np.testing.assert_allclose(F2 @ Q1 @ F2.T + Q2, Q, atol=ROUNDING)


def test_an_acceleration_constant_during_each_interval_has_a_singular_covariance():
    _, Q = matrices(lb.ConstantVelocity([0.5, 2.0], discrete=True), 0.7)
    g = np.array([[0.7**2 / 2, 0], [0, 0.7**2 / 2], [0.7, 0], [0, 0.7]])
    np.testing.assert_allclose(Q, g @ np.diag([0.5, 2.0]) @ g.T, atol=ROUNDING)
    assert np.linalg.matrix_rank(Q) == 2


def test_position_is_a_view_of_the_state():
    motion = lb.ConstantVelocity(0.5, dim=3)
    assert motion.state_names == ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
    np.testing.assert_array_equal(motion.position(np.arange(12.0).reshape(2, 6)), [[0, 1, 2], [6, 7, 8]])


@pytest.mark.parametrize("build", [lambda: lb.ConstantVelocity(-1.0), lambda: lb.ConstantVelocity(np.nan)])
def test_an_intensity_that_is_none_is_an_input_error(build):
    with pytest.raises(lb.InputError, match="intensity"):
        build()


def test_one_dimension_is_an_input_error():
    with pytest.raises(lb.InputError, match="2 or 3"):
        lb.ConstantVelocity(1.0, dim=1)
