r"""Gram matrix of Weiss-Weinstein test functions with exponent 1/2, for laws that are moved by a shift.

Let ``eta(u) = int sqrt(p(z, x + u) p(z, x)) dz dx`` depend on the difference u of two shifts alone (linear Gaussian
states, measurements linear in them, any additive noise). Test functions
``sqrt(p(z, x + h) / p(z, x)) - sqrt(p(z, x - h) / p(z, x))``, divided by ``eta(h)``, have the products

    G_ij = 2 [eta(h_i - h_j) - eta(h_i + h_j)] / (eta(h_i) eta(h_j))

and ``H G^-1 H'`` with the shifts as columns of H bounds the mean square error matrix (Weiss, Weinstein 1985).
"""

import numpy as np

from locbounds.axes import Float, ndarray

LEAST = -150.0  # log eta of the longest shift that is of use: no entry overflows
LOST = 1e-7  # eigenvalues of the normalised Gram matrix below it are rounding and left out, which is valid
# of normalised blocks that others are subtracted from, some hundred units in the last place; added to them, which is
# valid too: a larger Gram matrix makes the bound smaller
ROUNDING = 1e-13


def gram(
    difference: Float[ndarray, "*n m m"], total: Float[ndarray, "*n m m"], single: Float[ndarray, "*n m"]
) -> Float[ndarray, "*n m m"]:
    """The Gram matrix from ``log eta`` of the differences, the sums and the shifts themselves.

    Shifts that are so long that their ``eta`` vanishes are left out: their row is zero and their diagonal is huge.

    >>> h = np.array([1.0, 2.0])
    >>> log_eta = lambda u: -(u**2) / 8
    >>> G = gram(log_eta(h - h[:, None]), log_eta(h + h[:, None]), log_eta(h))
    >>> np.allclose(G, 4 * np.sinh(np.outer(h, h) / 4))
    True
    """
    used = single > LEAST
    single = np.where(used, single, 0.0)
    pair = single[..., :, None] + single[..., None, :]
    some = used[..., :, None] & used[..., None, :] & (np.maximum(difference, total) > -np.inf)
    difference, total = np.where(some, difference, 0.0), np.where(some, total, 0.0)
    apart, larger = difference - total, np.where(some, np.maximum(difference, total) - pair, 0.0)
    # exp(difference - pair) - exp(total - pair), to full precision also where both are nearly one
    G = -2.0 * np.sign(apart) * np.exp(larger) * np.expm1(-np.abs(apart))
    return G + np.where(used, 0.0, np.exp(-2 * LEAST))[..., None] * np.eye(single.shape[-1])
