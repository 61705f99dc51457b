"""Clocks of a log: ranges that come in bursts, and range stamps that lag those of the truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, Int, ndarray
from locbounds.errors import InputError

LARGEST_OFFSET_S = 2.0
COARSE_S = 0.05
FINEST_S = 1e-4
GOLDEN = (np.sqrt(5) - 1) / 2


def bursts(time_s: Float[ndarray, " n"], link: Int[ndarray, " n"], width_s: float) -> Int[ndarray, " n"]:
    """Which step every range belongs to, when ranges of different links that nearly coincide make one step.

    Parameters
    ----------
    time_s
        Times of the ranges of one track, not decreasing.
    link
        Which link each of them belongs to.
    width_s
        A step begins with the first range that is later than this after its first one, or whose link it already has.

    Examples
    --------
    >>> bursts(np.array([0.0, 0.001, 0.002, 0.1, 0.103]), np.array([0, 1, 0, 1, 0]), 0.01).tolist()
    [0, 0, 1, 2, 2]
    """
    step = np.zeros(len(time_s), int)
    first, seen = -np.inf, set()
    k = -1
    for i, (t, m) in enumerate(zip(time_s.tolist(), link.tolist(), strict=True)):
        if t - first > width_s or m in seen:
            k, first, seen = k + 1, t, set()
        seen.add(m)
        step[i] = k
    return step


class Stamped(NamedTuple):
    """Ranges of one track with their own stamps, and the truth with its own.

    Attributes
    ----------
    time_s, range_m, anchor_m, link
        [n] stamps and ranges, [n, space] anchor of each range, [n] its number.
    truth_s, truth_m
        [rows] and [rows, space].
    """

    time_s: Float[ndarray, " n"]
    range_m: Float[ndarray, " n"]
    anchor_m: Float[ndarray, "n space"]
    link: Int[ndarray, " n"]
    truth_s: Float[ndarray, " rows"]
    truth_m: Float[ndarray, "rows space"]


class Offset(NamedTuple):
    """An estimated clock difference in seconds, its standard error (NaN from one track), and one per track."""

    value_s: float
    stderr_s: float
    by_track_s: tuple[float, ...]


def spread_of_errors(track: Stamped, offset_s: float) -> float:
    """Mean absolute deviation of the range errors from their median per link, in metres, at a clock offset.

    Only ranges that have a true position at every offset up to `LARGEST_OFFSET_S` count, so that all offsets are
    compared on the same ranges.
    """
    t = track.time_s
    inside = (t >= track.truth_s[0] + LARGEST_OFFSET_S) & (t <= track.truth_s[-1] - LARGEST_OFFSET_S)
    at = t[inside] + offset_s
    place = np.stack([np.interp(at, track.truth_s, column) for column in track.truth_m.T], axis=1)
    error = track.range_m[inside] - np.linalg.norm(place - track.anchor_m[inside], axis=1)
    total = 0.0
    for m in np.unique(track.link[inside]):
        e = error[track.link[inside] == m]
        total += np.abs(e - np.median(e)).sum()
    return float(total / max(len(error), 1))


def _lowest(cost, grid: Float[ndarray, " n"]) -> float:
    """The minimum near the lowest point of a grid, by golden sections; the edge itself if it lies there."""
    values = [cost(x) for x in grid]
    k = int(np.argmin(values))
    if k in (0, len(grid) - 1):
        return float(grid[k])
    a, b = float(grid[k - 1]), float(grid[k + 1])
    while b - a > FINEST_S:
        c, d = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
        a, b = (a, d) if cost(c) < cost(d) else (c, b)
    return (a + b) / 2


def estimate_offset(tracks: Sequence[Stamped]) -> Offset:
    """Seconds to add to the range stamps so that the range errors spread least.

    Parameters
    ----------
    tracks
        With a truth that moves: a mobile at rest tells nothing of clocks.

    Returns
    -------
    Offset
        Minimises the mean absolute deviation of the errors from their median per track and link, all ranges alike (the
        median takes out a constant delay, the absolute value forgives outliers). The standard error is that of the mean
        over tracks, so that errors that depend on each other within a track do not make it too small.

    Raises
    ------
    InputError
        If the best offset lies at the edge of what was searched, +- 2 s, or no track is long enough.
    """
    usable = [t for t in tracks if np.ptp(t.truth_s) > 4 * LARGEST_OFFSET_S and np.ptp(t.truth_m, axis=0).max() > 0]
    if not usable:
        raise InputError(
            "no track with a moving device is long enough to estimate a time offset", "Give the offset in seconds"
        )
    grid = np.arange(-LARGEST_OFFSET_S, LARGEST_OFFSET_S + COARSE_S / 2, COARSE_S)
    sizes = np.array([len(t.time_s) for t in usable])
    value = _lowest(lambda x: float(sizes @ [spread_of_errors(t, x) for t in usable]), grid)
    if abs(value) > LARGEST_OFFSET_S - COARSE_S:
        raise InputError(
            f"the best time offset lies beyond {LARGEST_OFFSET_S:g} s",
            "Give the offset in seconds, or check the clocks",
        )
    each = tuple(_lowest(lambda x, t=t: spread_of_errors(t, x), grid) for t in usable)
    stderr = float(np.std(each, ddof=1) / np.sqrt(len(each))) if len(each) > 1 else float("nan")
    return Offset(value, stderr, each)
