"""Many tracks at once: small matrices whose every entry is an array with the tracks as its last, contiguous axis.

A filter step works on 4 x 4 matrices, far too small for a matrix library. Here a vector is a list of arrays, a
symmetric matrix a dict of the arrays on and above its diagonal, and each operation one pass over thousands of tracks.
XLA fuses such passes, and by default recomputes everything that two results share: a filter step becomes many times
slower. :func:`materialise` says where an intermediate value is to be kept.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array
from locbounds.precision import traced

Vector = list  # [state] of arrays [..., tracks]
Symmetric = dict  # (i, j) with i <= j -> array [..., tracks]
Pattern = tuple[tuple[int, ...], ...]

ZERO, ONE, OTHER = 0, 1, 2


def materialise(values: Any) -> Any:
    """The same values, computed once and stored."""
    return jax.lax.optimization_barrier(values)


def upper(n: int) -> list[tuple[int, int]]:
    """Index pairs on and above the diagonal.

    >>> upper(2)
    [(0, 0), (0, 1), (1, 1)]
    """
    return [(i, j) for i in range(n) for j in range(i, n)]


def entry(A: Symmetric, i: int, j: int) -> Array:
    """``A[i, j]`` of a symmetric matrix."""
    return A[min(i, j), max(i, j)]


def symmetric(A: Array) -> Symmetric:
    """The entries of a matrix [n, n, ...] on and above its diagonal."""
    return {(i, j): A[i, j] for i, j in upper(len(A))}


def dense(A: Symmetric) -> Array:
    """The full matrix [n, n, ...]."""
    n = 1 + max(i for i, _ in A)
    return jnp.stack([entry(A, i, j) for i in range(n) for j in range(n)]).reshape(n, n, *A[0, 0].shape)


def pattern(matrices: Array) -> Pattern:
    """Which entries of matrices [steps, n, m] are zero (0) or one (1) at every step, or neither (2).

    >>> pattern(np.array([[[1.0, 0.5], [0.0, 1.0]]]))
    ((1, 2), (0, 1))
    """
    if traced(matrices):
        return ((OTHER,) * matrices.shape[2],) * matrices.shape[1]
    matrices = np.asarray(matrices)
    kind = np.where((matrices == 0).all(0), ZERO, np.where((matrices == 1).all(0), ONE, OTHER))
    return tuple(tuple(int(k) for k in row) for row in kind)


def _row(F: Array, kinds: tuple[int, ...], i: int, values: Callable[[int], Array]) -> Array:
    """``sum_l F[i, l] values(l)`` without the products by zero and one."""
    terms = [values(j) if k == ONE else F[i, j] * values(j) for j, k in enumerate(kinds) if k != ZERO]
    return functools.reduce(jnp.add, terms) if terms else jnp.zeros_like(values(0))


def apply(F: Array, kinds: Pattern, x: Vector) -> Vector:
    """``F x``."""
    return [_row(F, row, i, lambda j: x[j]) for i, row in enumerate(kinds)]


def congruence(F: Array, kinds: Pattern, P: Symmetric) -> Symmetric:
    """``F P F^T``."""
    n = len(kinds)
    FP = [[_row(F, kinds[i], i, lambda j, k=k: entry(P, j, k)) for k in range(n)] for i in range(n)]
    return {(i, j): _row(F, kinds[j], j, lambda k, i=i: FP[i][k]) for i, j in upper(n)}


def dot(a: Vector, b: Vector) -> Array:
    """Sum of products."""
    return functools.reduce(jnp.add, [x * y for x, y in zip(a, b, strict=True)])


def times(A: Symmetric, x: Vector) -> Vector:
    """``A x`` for a symmetric matrix."""
    return [dot([entry(A, i, j) for j in range(len(x))], x) for i in range(len(x))]


def solve(A: Symmetric, b: Vector) -> Vector:
    """``A^-1 b`` for a positive definite matrix, by its Cholesky factors.

    >>> A = {(0, 0): jnp.array(2.0), (0, 1): jnp.array(1.0), (1, 1): jnp.array(1.0)}
    >>> [float(x) for x in solve(A, [jnp.array(3.0), jnp.array(2.0)])]
    [1.0, 1.0]
    """
    n = len(b)
    L: dict[tuple[int, int], Array] = {}
    D: Vector = []
    for j in range(n):
        D.append(A[j, j] - sum(L[j, k] ** 2 * D[k] for k in range(j)))
        for i in range(j + 1, n):
            L[i, j] = (entry(A, i, j) - sum(L[i, k] * L[j, k] * D[k] for k in range(j))) / D[j]
    y: Vector = []
    for i in range(n):
        y.append(b[i] - sum(L[i, k] * y[k] for k in range(i)))
    x = [y_i / d for y_i, d in zip(y, D, strict=True)]
    for i in reversed(range(n)):
        x[i] = x[i] - sum(L[k, i] * x[k] for k in range(i + 1, n))
    return x
