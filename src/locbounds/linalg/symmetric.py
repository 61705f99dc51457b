"""Symmetric matrices."""

import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float

RELATIVE_ROUNDING = 1e-10  # eigenvalues above minus this fraction of the largest count as rounding, not as negative


def symmetrize(a: Float[Array, "*batch n n"]) -> Float[Array, "*batch n n"]:
    """The symmetric part of a matrix.

    >>> symmetrize(jnp.array([[1.0, 2.0], [0.0, 1.0]])).tolist()
    [[1.0, 1.0], [1.0, 1.0]]
    """
    return 0.5 * (a + jnp.swapaxes(a, -1, -2))


def is_positive_semidefinite(a: Float[Array, "n n"]) -> bool:
    """Whether a matrix is symmetric and has no eigenvalue below zero, up to rounding.

    >>> is_positive_semidefinite(np.diag([1.0, 0.0])), is_positive_semidefinite(np.diag([1.0, -0.1]))
    (True, False)
    """
    a = np.asarray(a)
    scale = float(np.max(np.abs(a), initial=0.0))
    if not np.all(np.isfinite(a)) or np.max(np.abs(a - a.T), initial=0.0) > RELATIVE_ROUNDING * scale:
        return False
    return bool(np.linalg.eigvalsh(a).min(initial=0.0) >= -RELATIVE_ROUNDING * scale)


def psd_root(a: Float[Array, "*batch n n"]) -> Float[Array, "*batch n n"]:
    """A square root ``L`` with ``L @ L.T == a`` for a symmetric positive semidefinite, possibly singular matrix.

    >>> root = psd_root(jnp.array([[4.0, 0.0], [0.0, 0.0]]))
    >>> (root @ root.T).tolist()
    [[4.0, 0.0], [0.0, 0.0]]
    """
    values, vectors = jnp.linalg.eigh(symmetrize(a))
    return vectors * jnp.sqrt(jnp.maximum(values, 0.0))[..., None, :]
