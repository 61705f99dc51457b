"""Roots and inverses of small matrices."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from locbounds.linalg import is_positive_semidefinite, psd_root, small_inverse

ROUNDING = 1e-12
MATRICES = {
    "full": np.array([[4.0, 1.0, 0.5], [1.0, 3.0, 0.2], [0.5, 0.2, 1.0]]),
    "equal eigenvalues": np.diag([2.0, 2.0, 0.5]),
    "singular": np.outer([1.0, 2.0, -1.0], [1.0, 2.0, -1.0]),
    "zero": np.zeros((3, 3)),
}


@pytest.mark.parametrize("name", MATRICES)
def test_a_root_squared_is_the_matrix(name):
    with jax.enable_x64(True):
        root = np.asarray(psd_root(jnp.asarray(MATRICES[name])))
    np.testing.assert_allclose(root @ root, MATRICES[name], atol=1e-7 if name == "zero" else ROUNDING)
    np.testing.assert_allclose(root, root.T, atol=ROUNDING)


@pytest.mark.parametrize("name", ["full", "equal eigenvalues"])
def test_the_derivative_of_a_root_is_its_finite_difference(name):
    change = np.array([[1.0, 0.3, 0.1], [0.3, -0.5, 0.2], [0.1, 0.2, 0.7]])
    step = 1e-5
    with jax.enable_x64(True):
        A = jnp.asarray(MATRICES[name])
        slope = jax.jvp(psd_root, (A,), (jnp.asarray(change),))[1]
        difference = (psd_root(A + step * change) - psd_root(A - step * change)) / (2 * step)
        pulled = jax.grad(lambda a: jnp.sum(psd_root(a) * change))(A)
    np.testing.assert_allclose(slope, difference, atol=1e-8)
    assert np.sum(np.asarray(pulled) * change) == pytest.approx(np.sum(np.asarray(slope) * change), rel=1e-10)


def test_the_root_of_a_scaled_singular_matrix_moves_within_its_subspace():
    with jax.enable_x64(True):
        A = jnp.asarray(MATRICES["singular"])
        slope = jax.jvp(lambda q: psd_root(q * A), (4.0,), (1.0,))[1]
        np.testing.assert_allclose(slope, psd_root(A) / 4, atol=1e-9)  # d sqrt(q) = 1 / (2 sqrt(q))


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_small_inverses(n):
    a = np.random.default_rng(n).normal(size=(5, n, n)) + 3 * np.eye(n)
    with jax.enable_x64(True):
        np.testing.assert_allclose(small_inverse(jnp.asarray(a)), np.linalg.inv(a), rtol=1e-10, atol=ROUNDING)


def test_positive_semidefinite_up_to_rounding():
    assert is_positive_semidefinite(MATRICES["singular"])
    assert is_positive_semidefinite(np.zeros((2, 2)))
    assert not is_positive_semidefinite(np.array([[1.0, 0.5], [0.4, 1.0]]))
    assert not is_positive_semidefinite(np.array([[1.0, 2.0], [2.0, 1.0]]))
    assert not is_positive_semidefinite(np.array([[np.nan, 0.0], [0.0, 1.0]]))
