"""The assignment problem of the survey bound: A(h), exactly or nearly, with a certificate.

``A(h) = (1/N) max over partial injections pi of sum_i 2 P[i, pi(i)] [allowed at h]``. Every partial injection gives a
lower value, every pair of prices (u, v >= 0 with u_i + v_j >= 2 P_ij on all allowed pairs) an upper one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from locbounds.axes import Bool, Float, Int, ndarray


class Matching(NamedTuple):
    """A partial injection at one distance: the certificate of one value of A.

    Attributes
    ----------
    distance_m : float
        h, m: every pair is at least so far apart.
    left, right : int arrays [pairs]
        Each point at most once in each.
    value : float
        ``(1/N) sum 2 P``: A is at least this.
    upper : float
        A is at most this; equal to ``value`` up to rounding if the matching is optimal.
    """

    distance_m: float
    left: Int[ndarray, " pairs"]
    right: Int[ndarray, " pairs"]
    value: float
    upper: float


def confusion(distance: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
    """Least probability of error between two equally likely points whose whitened fingerprints are so far apart.

    >>> confusion(np.array([0.0, 2.0])).round(4).tolist()
    [0.5, 0.1587]
    """
    from scipy.special import ndtr

    return ndtr(-distance / 2)


def dense_matching(confusions: Float[ndarray, "n n"], allowed: Bool[ndarray, "n n"], h: float) -> Matching:
    """The best matching, over all allowed pairs.

    Parameters
    ----------
    confusions
        [N, N] P_ij.
    allowed
        [N, N] pairs (left, right) at least h apart.
    h
        The distance, m.

    Examples
    --------
    >>> P = np.array([[0.5, 0.4, 0.1], [0.4, 0.5, 0.3], [0.1, 0.3, 0.5]])
    >>> x = np.array([0.0, 1.0, 2.0])
    >>> best = dense_matching(P, x - x[:, None] >= 1.0, 1.0)
    >>> best.left.tolist(), best.right.tolist(), round(best.value, 4)
    ([0, 1], [1, 2], 0.4667)
    """
    from scipy.optimize import linear_sum_assignment

    weight = np.where(allowed, confusions, 0.0)
    left, right = linear_sum_assignment(weight, maximize=True)
    used = allowed[left, right]
    left, right = left[used], right[used]
    value = float(2 * np.sum(confusions[left, right]) / len(confusions))
    return Matching(float(h), left, right, value, value)


def auction(
    weight: Float[ndarray, "rows k"],
    column: Int[ndarray, "rows k"],
    price: Float[ndarray, " columns"],
    *,
    step: float,
    rounds: int,
) -> tuple[Int[ndarray, " rows"], Float[ndarray, " rows"], Float[ndarray, " columns"]]:
    """A matching of nearly the largest weight on a sparse graph, by an auction in which all free rows bid at once.

    Parameters
    ----------
    weight
        [rows, k] weights >= 0 of each row's candidates; 0: not a candidate.
    column
        [rows, k] their columns.
    price
        [columns] prices to start from, >= 0.
    step
        Each bid raises a price by at least this; a finished auction is within rows * step of the best.
    rounds
        Stop after so many rounds, wherever it is: what is matched by then is a matching.

    Returns
    -------
    match
        [rows] column of every row, -1: none.
    profit
        [rows] u, prices of the rows; with ``price`` they cover every candidate: u_i + v_j >= w_ij.
    price
        [columns] v.

    Examples
    --------
    >>> weight, column = np.array([[3.0, 2], [2, 0]]), np.array([[0, 1], [0, 0]])
    >>> match, u, v = auction(weight, column, np.zeros(2), step=0.1, rounds=99)
    >>> match.tolist(), 4.0 <= float(u.sum() + v.sum()) <= 4.2
    ([1, 0], True)
    """
    rows = len(weight)
    price = price.copy()
    owner = np.full(len(price), -1)
    match = np.full(rows, -1)
    free = np.flatnonzero(weight.max(axis=1, initial=0.0) > 0)
    for _ in range(rounds):
        if not free.size:
            break
        w, c = weight[free], column[free]
        net = np.where(w > 0, w - price[c], -1.0)
        best = net.argmax(axis=1)
        at = np.arange(len(free))
        top = net[at, best]
        net[at, best] = -1.0
        second = np.maximum(net.max(axis=1, initial=0.0), 0.0)
        bids = top > 0
        free, target, bid = free[bids], c[at, best][bids], (price[c[at, best]] + top - second + step)[bids]
        if not free.size:
            break
        order = np.lexsort((bid, target))
        last = np.append(target[order][1:] != target[order][:-1], True)
        winner = order[last]
        won = target[winner]
        evicted = owner[won]
        match[evicted[evicted >= 0]] = -1
        owner[won], match[free[winner]], price[won] = free[winner], won, bid[winner]
        lost = np.ones(len(free), bool)
        lost[winner] = False
        free = np.concatenate([free[lost], evicted[evicted >= 0]])
    profit = np.maximum(np.where(weight > 0, weight - price[column], 0.0).max(axis=1, initial=0.0), 0.0)
    return match, profit, price
