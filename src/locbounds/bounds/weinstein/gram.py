r"""Gram matrix of Weiss-Weinstein test functions with exponent 1/2, for laws that are moved by a shift.

Let ``eta(u) = int sqrt(p(z, x + u) p(z, x)) dz dx`` depend on the difference u of two shifts alone (linear Gaussian
states, measurements linear in them, any additive noise). Test functions
``sqrt(p(z, x + h) / p(z, x)) - sqrt(p(z, x - h) / p(z, x))``, divided by ``eta(h)``, have the products

    G_ij = 2 [eta(h_i - h_j) - eta(h_i + h_j)] / (eta(h_i) eta(h_j))

and ``H G^-1 H'`` with the shifts as columns of H bounds the mean square error matrix (Weiss, Weinstein 1985).
"""

import numpy as np

from locbounds.axes import Float, ndarray

LARGEST = 300.0  # logarithm of the largest entry
LOST = 1e-7  # eigenvalues of the normalised Gram matrix below it are rounding and left out, which is valid


def gram(
    difference: Float[ndarray, "*n m m"], total: Float[ndarray, "*n m m"], single: Float[ndarray, "*n m"]
) -> Float[ndarray, "*n m m"]:
    """The Gram matrix from ``log eta`` of the differences, the sums and the shifts themselves.

    Entries that overflow are limited: such shifts are too long to say anything.

    >>> h = np.array([1.0, 2.0])
    >>> log_eta = lambda u: -(u**2) / 8
    >>> G = gram(log_eta(h - h[:, None]), log_eta(h + h[:, None]), log_eta(h))
    >>> np.allclose(G, 4 * np.sinh(np.outer(h, h) / 4))
    True
    """
    pair = single[..., :, None] + single[..., None, :]
    return 2.0 * (_exp(difference - pair) - _exp(total - pair))


def _exp(a: ndarray) -> ndarray:
    return np.exp(np.minimum(np.where(np.isnan(a), LARGEST, a), LARGEST))


def largest_square(h: Float[ndarray, "*n m"], G: Float[ndarray, "*n m m"]) -> Float[ndarray, "*n"]:
    """``h' G^-1 h``; combinations of test functions that vanish up to rounding are left out, which keeps it valid.

    >>> float(largest_square(np.array([1.0]), np.array([[2.0]])))
    0.5
    """
    scale = np.sqrt(np.einsum("...ii->...i", G))
    values, vectors = np.linalg.eigh(G / scale[..., :, None] / scale[..., None, :])
    part = np.einsum("...i,...ij->...j", h / scale, vectors) ** 2
    kept = values > LOST * values[..., -1:]
    return np.sum(np.where(kept, part / np.where(kept, values, 1.0), 0.0), -1)
