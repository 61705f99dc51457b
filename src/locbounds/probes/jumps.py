"""Where a function jumps, found along segments."""

from collections.abc import Callable

import numpy as np

from locbounds.axes import Array, Bool, Float, ndarray

POINTS = 65  # along each segment
LONGER = 1.5  # than the distance of the two draws that a segment is laid through
ZOOMS = 5  # each into the interval that sticks out most, 64 times shorter
FIRST_ZOOM = 2  # after which a jump no longer shrinks
SHRINKS = 0.5  # what is left of the increment of a jump, at least
SMALL = 1e-6  # increments below this share of the values are rounding


def segments(
    one: Float[ndarray, "segments space"], other: Float[ndarray, "segments space"]
) -> tuple[Float[ndarray, "segments space"], Float[ndarray, "segments space"]]:
    """Both ends of segments through pairs of draws, somewhat longer than what lies between them.

    >>> [end.tolist() for end in segments(np.array([[0.0]]), np.array([[4.0]]))]
    [[[-1.0]], [[5.0]]]
    """
    middle, half = 0.5 * (one + other), 0.5 * LONGER * (other - one)
    return middle - half, middle + half


def find_jump(
    values: Callable[[Float[ndarray, "segments points space"]], Float[Array, "segments points"]],
    low: Float[ndarray, "segments space"],
    high: Float[ndarray, "segments space"],
    *,
    inside: Callable[[Float[ndarray, "n space"]], Bool[Array, " n"]] | None = None,
    periodic: bool = False,
) -> tuple[Float[ndarray, " space"], float] | None:
    """A jump of a function on segments: its place and size, or None if none is found.

    The interval whose increment sticks out most from those of its neighbours is divided again and again: of a
    continuous function the increment goes to zero with the length of the interval, of a jump it does not. The last
    interval is 1e-11 of a segment long; what changes within it, however smoothly, counts as a jump. Jumps in a part
    that few segments cross can be missed.

    Parameters
    ----------
    values
        The function, at points of all segments; what is not finite is passed over.
    low, high
        Ends of the segments.
    inside
        Which points count; None: all.
    periodic
        Whether values that differ by 2 pi are the same.

    Examples
    --------
    >>> ends = np.linspace(-3.0, -1.0, 8)[:, None], np.linspace(1.0, 2.0, 8)[:, None]
    >>> place, size = find_jump(lambda p: 3 * np.sign(p[..., 0] - 0.5), *ends)
    >>> round(float(place[0]), 6), round(size, 6)
    (0.5, 6.0)
    >>> find_jump(lambda p: np.tanh(1e4 * p[..., 0]), *ends) is None
    True
    """
    scale, before, size = 0.0, np.zeros(len(low)), np.zeros(len(low))
    for zoom in range(ZOOMS + 1):
        points = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, POINTS)[:, None]
        found = np.asarray(values(points))
        if zoom == 0:
            scale = float(np.max(np.abs(found), initial=0.0, where=np.isfinite(found)))
        there = np.ones(found.shape, bool)
        if inside is not None:
            there = np.asarray(inside(points.reshape(-1, points.shape[-1]))).reshape(found.shape)
        increments = _increments(found, periodic, there)
        most = _sticks_out(increments).argmax(1)
        rows = np.arange(len(low))
        low, high, size = points[rows, most], points[rows, most + 1], np.abs(increments[rows, most])
        if zoom == FIRST_ZOOM:
            before = size
    jumps = np.where((size >= SHRINKS * before) & (size > SMALL * scale), size, 0.0)
    if not jumps.max(initial=0.0) > 0:
        return None
    k = int(jumps.argmax())
    return 0.5 * (low[k] + high[k]), float(size[k])


def _increments(values: ndarray, periodic: bool, inside: ndarray) -> ndarray:
    """From one point to the next, zero where one of them is outside of the support or has no finite value."""
    with np.errstate(invalid="ignore"):
        out = np.diff(values, axis=1)
        if periodic:
            out = out - 2 * np.pi * np.round(out / (2 * np.pi))
    return np.where(inside[:, 1:] & inside[:, :-1] & np.isfinite(out), out, 0.0)


def _sticks_out(increments: ndarray) -> ndarray:
    """How much each differs from the mean of its neighbours."""
    padded = np.pad(increments, ((0, 0), (1, 1)), mode="edge")
    return np.abs(increments - 0.5 * (padded[:, :-2] + padded[:, 2:]))
