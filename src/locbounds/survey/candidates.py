"""Pairs worth matching in a large survey: found block by block, never holding all pairs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, Int, ndarray

ROWS = 256  # points compared with all others at once
SEGMENTS = 24  # of the points, sorted along the axis; every point keeps candidates in each of them
KEEP = 8  # candidates of a point in each segment
ROUNDING = 2e-6  # relative to the largest squared norm: what a single-precision squared distance may be too large by


class Candidates(NamedTuple):
    """For every point, the most similar points among those with a larger coordinate.

    Attributes
    ----------
    column : int array [points, k]
        Candidates; the point itself where there are fewer.
    square : array [points, k]
        Squared distances of the whitened fingerprints, in single precision and rather too small than too large; inf
        where there is no candidate. They rank the candidates; a bound takes the exact ones of what it matches.
    left_out : array [points, segments]
        Every pair that was left out is at least so far apart (squared); inf: none was left out.
    low, high : arrays [segments, space]
        Boxes that hold the points of each segment.
    """

    column: Int[ndarray, "points k"]
    square: Float[ndarray, "points k"]
    left_out: Float[ndarray, "points segments"]
    low: Float[ndarray, "segments space"]
    high: Float[ndarray, "segments space"]


def find_candidates(
    whitened: Float[ndarray, "points columns"],
    position_m: Float[ndarray, "points space"],
    axis: int,
) -> Candidates:
    """Compare every point with all that have a larger coordinate, and keep the most similar ones.

    Parameters
    ----------
    whitened
        [points, columns] fingerprints in units of the noise.
    position_m
        [points, space] m.
    axis
        The coordinate.

    Notes
    -----
    The points are cut into 24 equal parts along the axis; 8 candidates stay in each, so that there are some at every
    distance. Memory grows with points * (columns + 192), time with points squared * columns (half a matrix product).
    """
    keep, segments = KEEP, SEGMENTS
    n = len(whitened)
    order = np.argsort(position_m[:, axis], kind="stable")
    place = position_m[order]
    coordinate = np.ascontiguousarray(place[:, axis])
    left, right = _factors(whitened[order])
    edges = np.linspace(0, n, segments + 1).astype(int)
    parts = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
    column = np.repeat(np.arange(n, dtype=np.int32)[:, None], keep * len(parts), axis=1)
    found = np.full(column.shape, np.inf, np.float32)
    left_out = np.full((n, len(parts)), np.inf, np.float32)
    for start in range(0, n, ROWS):
        rows = slice(start, min(start + ROWS, n))
        first = int(np.searchsorted(edges, start, side="right")) - 1
        base = edges[first]
        d = left[rows] @ right[base:].T
        here = int(np.searchsorted(coordinate, coordinate[rows][-1], side="right"))
        near = slice(0, here - base)
        d[:, near][coordinate[base:here] <= coordinate[rows, None]] = np.inf
        for s in range(first, len(parts)):
            low, high = parts[s]
            part = d[:, low - base : high - base]
            size = high - low
            if size > keep:
                nearest = np.argpartition(part, keep, axis=1)[:, : keep + 1]
                values = np.take_along_axis(part, nearest, axis=1)
                left_out[rows, s] = np.maximum(values[:, keep], 0.0)
                nearest, values = nearest[:, :keep], values[:, :keep]
            else:
                nearest, values = np.broadcast_to(np.arange(size), part.shape), part
            at = slice(s * keep, s * keep + values.shape[1])
            there = np.isfinite(values)
            column[rows, at] = np.where(there, nearest + low, column[rows, at])
            found[rows, at] = np.maximum(values, 0.0)
    back = np.empty(n, int)
    back[order] = np.arange(n)
    boxes = [(place[low:high].min(axis=0), place[low:high].max(axis=0)) for low, high in parts]
    return Candidates(
        order[column[back]].astype(np.int32),
        np.ascontiguousarray(found[back]),
        np.ascontiguousarray(left_out[back]),
        np.array([b[0] for b in boxes]),
        np.array([b[1] for b in boxes]),
    )


def _factors(x: ndarray) -> tuple[ndarray, ndarray]:
    """Matrices whose product holds all squared distances, less what rounding may add to one."""
    x = x - x.mean(axis=0)
    square = np.einsum("ij,ij->i", x, x)[:, None]
    one = np.ones_like(square)
    left = np.hstack([-2 * x, square - ROUNDING * square.max(), one])
    return left.astype(np.float32), np.hstack([x, one, square]).astype(np.float32)


def reach(
    candidates: Candidates, position_m: Float[ndarray, "points space"], axis: int | None
) -> Float[ndarray, "points segments"]:
    """How far the points of each segment can be from each point, m: along an axis, or (None) in all."""
    if axis is not None:
        return candidates.high[:, axis] - position_m[:, axis, None]
    far = np.maximum(np.abs(position_m[:, None] - candidates.low), np.abs(position_m[:, None] - candidates.high))
    return np.linalg.norm(far, axis=-1)
