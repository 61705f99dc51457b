"""A(h) of a survey along an axis or on the length: all pairs of a small survey, candidates of a large one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.survey.assignment import Matching, auction, confusion, dense_matching
from locbounds.survey.candidates import KEEP, SEGMENTS, Candidates, reach
from locbounds.survey.pairs import dense_pairs, spread

TOP = 24  # candidates of a point that take part in one auction
TOP_LENGTH = 12  # the same per axis on the length, where every pair counts in both directions
EACH = 3  # candidates of a point in every segment, when a helper names two points
ROUNDS = 2000  # of an auction
GAP = 2e-3  # what the auction may lose, relative to the sum of the largest weights


class _Kept(NamedTuple):
    """Candidates that take part [points, k], and per point the weight of the heaviest one that does not."""

    weight: ndarray
    column: ndarray
    dropped: ndarray


class AllPairs:
    """Every pair of a small survey; one instance per noise level and axis (None: the length)."""

    def __init__(self, whitened: ndarray, position_m: ndarray, axis: int | None):
        from scipy.spatial.distance import cdist

        self._distance = cdist(whitened, whitened)
        self._confusion = confusion(self._distance)
        if axis is None:
            self._apart = cdist(position_m, position_m)
            np.fill_diagonal(self._apart, 0.0)
        else:
            self._apart = position_m[:, axis] - position_m[:, axis, None]
        self._share = 0.5 if axis is None else 1.0
        self.distances = np.unique(self._apart[self._apart > 0])

    def solve(self, h: float) -> Matching:
        """The best matching of pairs at least h apart."""
        best = dense_matching(self._confusion, self._apart >= h, h)
        return best._replace(value=best.value * self._share, upper=best.upper * self._share)

    def pairs(self) -> tuple[float, float]:
        """The bound of a helper who names two points, and what it can be at most (the same), m^2."""
        value = dense_pairs(self._distance, self._apart)
        return value, value


class SomePairs:
    """Candidates of a large survey; values are summed over the matched pairs only, so that each is a lower one.

    Parameters
    ----------
    whitened, position_m
        [points, columns] and [points, space].
    candidates
        Of every axis.
    axis
        The axis, or None: the length.
    scale
        Noise level relative to that of the candidates.
    """

    distances = None

    def __init__(
        self, whitened: ndarray, position_m: ndarray, candidates: dict[int, Candidates], axis: int | None, scale: float
    ):
        self._whitened, self._position, self._axis, self._scale = whitened, position_m, axis, scale
        self._candidates = candidates if axis is None else {axis: candidates[axis]}
        self._parts = [self._part(c) for c in self._candidates.values()]
        self._reach = [reach(c, position_m, axis).astype(np.float32) for c in self._candidates.values()]
        self._left_out = [np.sqrt(c.left_out) / np.float32(scale) for c in self._candidates.values()]

    def _part(self, c: Candidates) -> tuple[ndarray, ndarray, ndarray]:
        order = np.argsort(c.square, axis=1)
        column = np.take_along_axis(c.column, order, axis=1)
        return (
            column,
            self._apart_of(column),
            np.sqrt(np.take_along_axis(c.square, order, axis=1)) / np.float32(self._scale),
        )

    def _apart_of(self, column: ndarray) -> ndarray:
        apart = np.empty(column.shape, np.float32)
        for start in range(0, len(apart), 4096):
            rows = slice(start, start + 4096)
            if self._axis is None:
                delta = self._position[column[rows]] - self._position[rows, None]
                apart[rows] = np.sqrt(np.einsum("ijk,ijk->ij", delta, delta))
            else:
                x = self._position[:, self._axis]
                apart[rows] = x[column[rows]] - x[rows, None]
        return apart

    def solve(self, h: float) -> Matching:
        """A good matching of pairs at least h apart, and an upper value from the prices of the auction."""
        n = len(self._position)
        most = TOP if self._axis is not None else TOP_LENGTH
        picked = [_nearest(*part, h, most) for part in self._parts]
        left_out = [np.where(r >= h, d, np.inf).min(axis=1) for r, d in zip(self._reach, self._left_out, strict=True)]
        unseen = np.max(2 * confusion(np.array(left_out)), axis=0)
        left, right, upper = self._match([k._replace(weight=2 * confusion(k.weight)) for k in picked], unseen)
        far = self._apart(left, right) >= h
        left, right = left[far], right[far]
        share = 0.5 if self._axis is None else 1.0
        value = share * float(np.sum(2 * confusion(self._distance(left, right)))) / n
        return Matching(float(h), left, right, value, max(share * upper / n, value))

    def pairs(self) -> tuple[float, float]:
        """The bound of a helper who names two points, and what it can be at most, m^2."""
        n = len(self._position)
        picked = []
        for c in self._candidates.values():
            apart = self._apart_of(c.column).reshape(n, -1, KEEP)
            distance = np.sqrt(c.square).reshape(apart.shape) / np.float32(self._scale)
            weight = np.square(apart) * spread(distance).astype(np.float32)
            at = np.argsort(-weight, axis=2)  # some in every segment: else all would want the same far points
            weight = np.take_along_axis(weight, at, axis=2)
            column = np.take_along_axis(c.column.reshape(apart.shape), at, axis=2)
            first = (slice(None), slice(None), slice(EACH))
            picked.append(
                _Kept(weight[first].reshape(n, -1), column[first].reshape(n, -1), weight[..., EACH].max(axis=1))
            )
        unseen = [np.square(r) * spread(d) for r, d in zip(self._reach, self._left_out, strict=True)]
        left, right, upper = self._match(
            picked, np.max([u.max(axis=1) for u in unseen], axis=0), both_ways=2 * EACH * SEGMENTS
        )
        square = np.square(self._apart(left, right)) * spread(self._distance(left, right))
        value = float(square.sum() / n)
        return value, max(upper / n, value)

    def _match(self, picked: list[_Kept], unseen: ndarray, *, both_ways: int = 0) -> tuple[ndarray, ndarray, float]:
        """Matched pairs, and an upper value of the sum of the weights of any matching.

        The prices of the auction cover the pairs that took part; raising the price of a point to the heaviest pair of
        its own that did not take part (in both its roles, where pairs count both ways) covers the rest.
        """
        both_ways = both_ways or (2 * TOP_LENGTH if self._axis is None else 0)
        n = len(self._position)
        lost = np.maximum(unseen, np.max([k.dropped for k in picked], axis=0))
        kept = _both_ways(picked, n, both_ways) if both_ways else picked[0]
        step = max(GAP * float(kept.weight.max(axis=1, initial=0.0).sum()) / n, 1e-300)
        match, profit, price = auction(kept.weight, kept.column, np.zeros(n), step=step, rounds=ROUNDS)
        left = np.flatnonzero(match >= 0)
        upper = np.maximum(profit, np.maximum(lost, kept.dropped) if both_ways else lost).sum()
        upper += np.maximum(price, lost).sum() if both_ways else price.sum()
        return left, match[left], float(upper)

    def _apart(self, left: ndarray, right: ndarray) -> Float[ndarray, " pairs"]:
        delta = self._position[right] - self._position[left]
        return np.linalg.norm(delta, axis=1) if self._axis is None else delta[:, self._axis]

    def _distance(self, left: ndarray, right: ndarray) -> Float[ndarray, " pairs"]:
        out = np.empty(len(left))
        for start in range(0, len(left), 4096):
            part = slice(start, start + 4096)
            out[part] = np.linalg.norm(self._whitened[left[part]] - self._whitened[right[part]], axis=1)
        return out / self._scale


def _nearest(column: ndarray, apart: ndarray, distance: ndarray, h: float, most: int) -> _Kept:
    """The first candidates of every point that are at least h apart (``weight``: distances), and the next one's 2 P."""
    far = apart >= np.float32(h)
    rank = np.cumsum(far, axis=1, dtype=np.int32)
    picked = np.full((len(column), most), np.inf, np.float32)
    columns = np.zeros((len(column), most), column.dtype)
    i, k = np.nonzero(far & (rank <= most))
    at = rank[i, k] - 1
    picked[i, at], columns[i, at] = distance[i, k], column[i, k]
    following = np.full(len(column), np.inf)
    i, k = np.nonzero(far & (rank == most + 1))
    following[i] = distance[i, k]
    return _Kept(picked, columns, 2 * confusion(following))


def _both_ways(parts: list[_Kept], n: int, most: int) -> _Kept:
    """Candidates of several lists joined, every pair in both directions; the heaviest of each point."""
    rows, columns, weights = [], [], []
    for weight, column, _ in parts:
        i, k = np.nonzero(weight > 0)
        rows.append(i)
        columns.append(column[i, k].astype(int))
        weights.append(weight[i, k])
    i, j, w = (np.concatenate(a) for a in (rows, columns, weights))
    key = np.unique(np.concatenate([i * n + j, j * n + i]), return_index=True)
    w = np.concatenate([w, w])[key[1]]
    i, j = np.divmod(key[0], n)
    order = np.lexsort((-w, i))
    i, j, w = i[order], j[order], w[order]
    rank = np.arange(len(i)) - np.searchsorted(i, i)
    kept = rank < most
    dropped = np.zeros(n)
    over = rank == most
    dropped[i[over]] = w[over]
    weight, column = np.zeros((n, most)), np.repeat(np.arange(n)[:, None], most, axis=1)
    weight[i[kept], rank[kept]], column[i[kept], rank[kept]] = w[kept], j[kept]
    return _Kept(weight, column, dropped)
