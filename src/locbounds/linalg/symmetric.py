"""Symmetric matrices."""

import jax
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


@jax.custom_jvp
def psd_root(a: Float[Array, "*batch n n"]) -> Float[Array, "*batch n n"]:
    """The symmetric square root ``S`` with ``S @ S == a`` of a positive semidefinite, possibly singular matrix.

    Unlike the eigenvectors it is made from, it is unique, and differentiable where eigenvalues coincide (as those of
    motions do that treat their axes alike); where ``a`` is singular its derivative is taken as zero.

    >>> root = psd_root(jnp.array([[4.0, 0.0], [0.0, 0.0]]))
    >>> (root @ root).tolist()
    [[4.0, 0.0], [0.0, 0.0]]
    """
    vectors, roots = _eigenvectors_and_roots(a)
    return (vectors * roots[..., None, :]) @ jnp.swapaxes(vectors, -1, -2)


def _eigenvectors_and_roots(
    a: Float[Array, "*batch n n"],
) -> tuple[Float[Array, "*batch n n"], Float[Array, "*batch n"]]:
    values, vectors = jnp.linalg.eigh(symmetrize(a))
    return vectors, jnp.sqrt(jnp.maximum(values, 0.0))


@psd_root.defjvp
def _psd_root_jvp(primals, tangents):
    """From ``dS S + S dS = dA``: in the eigenvectors' coordinates an elementwise division."""
    vectors, roots = _eigenvectors_and_roots(primals[0])
    sums = roots[..., :, None] + roots[..., None, :]
    turned = jnp.swapaxes(vectors, -1, -2)
    change = turned @ symmetrize(tangents[0]) @ vectors
    # rounding leaves eigenvalues of the relative size 1e-16 where there are none, roots of 1e-8
    regular = sums > 1e-7 * jnp.max(roots, -1)[..., None, None]
    change = jnp.where(regular, change / jnp.where(regular, sums, 1.0), 0.0)
    return psd_root(primals[0]), vectors @ change @ turned
