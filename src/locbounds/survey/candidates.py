"""Pairs worth matching in a large survey: found block by block, never holding all pairs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, Int, ndarray
from locbounds.survey.assignment import confusion

ROWS = 256  # points compared with all others at once
SEGMENTS = 24  # of the points, sorted along the axis; every point keeps candidates in each of them
KEEP = 8  # candidates of a point in each segment
ROUNDING = 1e-12  # relative to the largest squared norm: what a squared distance from a matrix product may lack


class Candidates(NamedTuple):
    """For every point, the most similar points among those with a larger coordinate.

    Attributes
    ----------
    column : int array [points, k]
        Candidates; the point itself where there are fewer.
    square : array [points, k]
        Squared distances of the whitened fingerprints; inf where there is no candidate.
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
    *,
    keep: int = KEEP,
    segments: int = SEGMENTS,
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
    keep, segments
        The points are cut into ``segments`` equal parts along the axis; ``keep`` candidates stay in each, so that
        there are some at every distance.

    Notes
    -----
    Memory grows with points * (columns + keep * segments), time with points squared * columns (one matrix product).
    """
    n = len(whitened)
    order = np.argsort(position_m[:, axis], kind="stable")
    x, place = whitened[order], position_m[order]
    coordinate = np.ascontiguousarray(place[:, axis])
    square = np.einsum("ij,ij->i", x, x)
    slack = ROUNDING * float(square.max())
    edges = np.linspace(0, n, min(segments, n) + 1).astype(int)
    parts = list(zip(edges[:-1], edges[1:], strict=True))
    column = np.repeat(np.arange(n, dtype=np.int32)[:, None], keep * len(parts), axis=1)
    found = np.full(column.shape, np.inf, np.float32)
    left_out = np.full((n, len(parts)), np.inf, np.float32)
    for start in range(0, n, ROWS):
        rows = slice(start, min(start + ROWS, n))
        first = int(np.searchsorted(edges, start, side="right")) - 1
        base = edges[first]
        d = x[rows] @ x[base:].T
        d *= -2.0
        d += square[rows, None]
        d += square[base:]
        d -= slack
        np.maximum(d, 0.0, out=d)
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
                left_out[rows, s] = values[:, keep]
                nearest, values = nearest[:, :keep], values[:, :keep]
            else:
                nearest, values = np.broadcast_to(np.arange(size), part.shape), part
            at = slice(s * keep, s * keep + values.shape[1])
            there = np.isfinite(values)
            column[rows, at] = np.where(there, nearest + low, column[rows, at])
            found[rows, at] = values
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


def left_out_weight(
    candidates: Candidates, position_m: Float[ndarray, "points space"], h: float, axis: int | None
) -> Float[ndarray, " points"]:
    """The largest 2 P of a pair that was left out and could be h apart, per point.

    Parameters
    ----------
    candidates, position_m
        As found.
    h
        Distance, m.
    axis
        Along this coordinate; None: the length.
    """
    if axis is None:
        far = np.maximum(np.abs(position_m[:, None] - candidates.low), np.abs(position_m[:, None] - candidates.high))
        reach = np.linalg.norm(far, axis=-1)
    else:
        reach = candidates.high[:, axis] - position_m[:, axis, None]
    least = np.where(reach >= h, candidates.left_out, np.inf).min(axis=1)
    return 2 * confusion(np.sqrt(least.astype(float)))
