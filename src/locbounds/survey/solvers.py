"""A(h) of a survey along an axis or on the length: all pairs of a small survey, candidates of a large one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.survey.assignment import Matching, auction, confusion, dense_matching
from locbounds.survey.candidates import Candidates, left_out_weight
from locbounds.survey.pairs import dense_pairs, spread

TOP = 24  # candidates of a point that take part in one auction
TOP_LENGTH = 12  # the same per axis on the length, where every pair counts in both directions
ROUNDS = 4000  # of an auction
GAP = 2e-3  # what the auction may lose, relative to the sum of the largest weights


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

    def pairs(self) -> float:
        """The bound of a helper who names two points, m^2."""
        return dense_pairs(self._distance, self._apart)


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

    def _part(self, c: Candidates) -> tuple[ndarray, ndarray, ndarray]:
        apart = np.empty(c.column.shape, np.float32)
        for start in range(0, len(apart), 4096):
            rows = slice(start, start + 4096)
            if self._axis is None:
                delta = self._position[c.column[rows]] - self._position[rows, None]
                apart[rows] = np.sqrt(np.einsum("ijk,ijk->ij", delta, delta))
            else:
                x = self._position[:, self._axis]
                apart[rows] = x[c.column[rows]] - x[rows, None]
        weight = (2 * confusion(np.sqrt(c.square) / np.float32(self._scale))).astype(np.float32)
        return c.column, apart, weight

    def solve(self, h: float) -> Matching:
        """A good matching of pairs at least h apart, and an upper value from the prices of the auction."""
        n = len(self._position)
        picked = [_top(*part, h, TOP if self._axis is not None else TOP_LENGTH) for part in self._parts]
        if self._axis is None:
            weight, column, dropped = _both_ways([p[:2] for p in picked], n)
            dropped = dropped + np.sum([p[2] for p in picked], axis=0)
        else:
            weight, column, dropped = picked[0]
        total = float(weight.max(axis=1, initial=0.0).sum())
        step = max(GAP * total / n, 1e-12)
        match, profit, price = auction(weight, column, np.zeros(n), step=step, rounds=ROUNDS)
        left = np.flatnonzero(match >= 0)
        right = match[left]
        far = self._apart(left, right) >= h
        left, right = left[far], right[far]
        share = 0.5 if self._axis is None else 1.0
        value = share * float(np.sum(2 * confusion(self._distance(left, right)))) / n
        lost = dropped + self._never_seen(h)
        if self._axis is None:  # a pair that is left out may be missing in both directions
            upper = np.sum(np.maximum(profit, lost)) + np.sum(np.maximum(price, lost))
        else:
            upper = np.sum(np.maximum(profit, lost)) + price.sum()
        return Matching(float(h), left, right, float(value), max(float(share * upper / n), float(value)))

    def pairs(self) -> float:
        """The bound of a helper who names two points, m^2."""
        n = len(self._position)
        picked = []
        for c, (column, apart, _) in zip(self._candidates.values(), self._parts, strict=True):
            weight = np.square(apart) * spread(np.sqrt(c.square) / np.float32(self._scale))
            picked.append(_top(column, apart, weight.astype(np.float32), 0.0, TOP_LENGTH)[:2])
        weight, column, _ = _both_ways(picked, n)
        step = max(GAP * float(weight.max(axis=1, initial=0.0).sum()) / n, 1e-12)
        match, _, _ = auction(weight, column, np.zeros(n), step=step, rounds=ROUNDS)
        left = np.flatnonzero(match >= 0)
        right = match[left]
        square = np.square(self._apart(left, right)) * spread(self._distance(left, right))
        return float(square.sum() / n)

    def _apart(self, left: ndarray, right: ndarray) -> Float[ndarray, " pairs"]:
        delta = self._position[right] - self._position[left]
        return np.linalg.norm(delta, axis=1) if self._axis is None else delta[:, self._axis]

    def _distance(self, left: ndarray, right: ndarray) -> Float[ndarray, " pairs"]:
        out = np.empty(len(left))
        for start in range(0, len(left), 4096):
            part = slice(start, start + 4096)
            out[part] = np.linalg.norm(self._whitened[left[part]] - self._whitened[right[part]], axis=1)
        return out / self._scale

    def _never_seen(self, h: float) -> ndarray:
        scaled = [c._replace(left_out=c.left_out / self._scale**2) for c in self._candidates.values()]
        return np.max([left_out_weight(c, self._position, h, self._axis) for c in scaled], axis=0)


class _Kept(NamedTuple):
    weight: ndarray
    column: ndarray
    dropped: ndarray


def _top(column: ndarray, apart: ndarray, weight: ndarray, h: float, most: int) -> _Kept:
    """The heaviest candidates of every point at least h apart, and the heaviest one not among them."""
    w = np.where(apart >= np.float32(h), weight, np.float32(0))
    if w.shape[1] <= most:
        return _Kept(w.astype(float), column, np.zeros(len(w)))
    at = np.argpartition(-w, most, axis=1)[:, : most + 1]
    values = np.take_along_axis(w, at, axis=1).astype(float)
    return _Kept(values[:, :most], np.take_along_axis(column, at[:, :most], axis=1), values[:, most])


def _both_ways(parts: list[tuple[ndarray, ndarray]], n: int) -> _Kept:
    """Candidates of several lists joined, every pair in both directions."""
    rows, columns, weights = [], [], []
    for weight, column in parts:
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
    most = 2 * TOP_LENGTH
    kept = rank < most
    dropped = np.zeros(n)
    over = rank == most
    dropped[i[over]] = w[over]
    weight, column = np.zeros((n, most)), np.repeat(np.arange(n)[:, None], most, axis=1)
    weight[i[kept], rank[kept]], column[i[kept], rank[kept]] = w[kept], j[kept]
    return _Kept(weight, column, dropped)
