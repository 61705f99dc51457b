"""The bound of a helper who names two points, one of which is the true one.

Draw a partner j of the true point i with probability w_ij (symmetric, rows sum to at most one) and tell the estimator
the unordered pair. It then knows that both are equally likely, and its least mean square error is that of a test
between two points: ``(a . (theta_i - theta_j))^2 g(d_ij)`` with ``g(d) = E[p (1 - p)]``, p the posterior probability
of one of them. The estimator without help is not better. The best w is half the sum of a permutation and its
transpose: one assignment problem.
"""

from __future__ import annotations

import functools

import numpy as np

from locbounds.axes import Float, ndarray

_LONGEST, _STEP = 60.0, 0.01  # of the table of log g
_ROUNDING = 1e-5  # relative: more than the interpolation in the table can be wrong


def spread(distance: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
    """g(d): expected p (1 - p) for two equally likely points whose whitened fingerprints are d apart; from below.

    ``g(d) = 1/4 exp(-d^2 / 8) E[1 / cosh(d t / 2)]`` with a standard normal t.

    >>> spread(np.array([0.0, 1.0, 70.0])).round(4).tolist()
    [0.25, 0.199, 0.0]
    """
    nodes, values = _table()
    inside = np.exp(np.interp(distance, nodes, values)) * (1 - _ROUNDING)
    return np.where(distance <= _LONGEST, inside, 0.0)


@functools.cache
def _table() -> tuple[ndarray, ndarray]:
    d = np.arange(0.0, _LONGEST + _STEP, _STEP)
    t = np.linspace(-9.0, 9.0, 7201)  # the trapezoidal rule is exact to rounding for such functions
    density = np.exp(-(t**2) / 2) / np.sqrt(2 * np.pi) * (t[1] - t[0])
    mean = np.array([np.sum(density / np.cosh(x * t / 2)) for x in d])
    return d, np.log(mean / 4) - d**2 / 8


def dense_pairs(distance: Float[ndarray, "n n"], apart: Float[ndarray, "n n"]) -> float:
    """The bound from all pairs, m^2.

    Parameters
    ----------
    distance
        [N, N] between whitened fingerprints.
    apart
        [N, N] between points, along an axis or in all, m.

    Examples
    --------
    Two points 2 m apart that cannot be told apart: the middle is 1 m wrong.

    >>> round(dense_pairs(np.zeros((2, 2)), np.array([[0.0, 2.0], [2.0, 0.0]])), 4)
    1.0
    """
    from scipy.optimize import linear_sum_assignment

    weight = np.square(apart) * spread(distance)
    return float(weight[linear_sum_assignment(weight, maximize=True)].sum() / len(weight))
