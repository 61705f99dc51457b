"""Where a measurement that is given by a function jumps from one place to the next, found numerically."""

from typing import NamedTuple

import numpy as np

from locbounds.axes import ndarray
from locbounds.measurement import Function
from locbounds.plan.plan import Plan
from locbounds.precision import double_precision, traced

SEGMENTS, POINTS = 256, 65  # through the support; points along each
LONGER = 1.5  # than the distance of the two draws that a segment is laid through
ZOOMS = 5  # each into the interval that sticks out most, 64 times shorter
FIRST_ZOOM = 2  # after which a jump no longer shrinks
SHRINKS = 0.5  # what is left of the increment of a jump, at least
SMALL = 1e-6  # increments below this share of the values are rounding


class Jump(NamedTuple):
    """A place at which a measurement jumps.

    Attributes
    ----------
    channel : int
    place : array [space]
        In metres.
    size : float
        In the unit of the channel.
    """

    channel: int
    place: ndarray
    size: float


@double_precision
def black_box_jump(plan: Plan, *, seed: int = 0) -> Jump | None:
    """A jump of one of the plan's functions where its prior is positive, or None if none is found.

    On segments through pairs of draws from the prior, the interval whose increment sticks out most from those of its
    neighbours is divided again and again: of a continuous function the increment goes to zero with the length of the
    interval, of a jump it does not. The last interval is 1e-11 of a segment long; what changes within it, however
    smoothly, counts as a jump. Jumps in a part of the support that few segments cross can be missed.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> import locbounds as lb
    >>> def plan(h):
    ...     return lb.observe(h, 1.0, dim=1, prior=lb.GaussianPrior([0.0], [[4.0]]))
    >>> found = black_box_jump(plan(lambda p: 3 * jnp.sign(p[0] - 0.5)))
    >>> round(float(found.place[0]), 6), round(found.size, 6)
    (0.5, 6.0)
    >>> black_box_jump(plan(lambda p: jnp.tanh(1e4 * p[0]))) is None
    True
    """
    channels = np.array([isinstance(m, Function) for group in plan.groups for m in group.per_channel])
    if plan.prior is None or not channels.any() or traced(plan):
        return None
    a, b = _segments(plan, seed)
    periodic = np.asarray(plan.periodic)[channels]
    found: list[Jump] = []
    for c in range(int(channels.sum())):
        low, high, before = a, b, np.zeros(len(a))
        scale = 0.0
        for zoom in range(ZOOMS + 1):
            points = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, POINTS)[:, None]
            flat = points.reshape(-1, plan.dim)
            values = np.asarray(plan.means(flat))[:, channels][:, c].reshape(points.shape[:2])
            if zoom == 0:
                scale = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
            increments = _increments(
                values, bool(periodic[c]), np.asarray(plan.prior.inside(flat)).reshape(values.shape)
            )
            most = _sticks_out(increments).argmax(1)
            rows = np.arange(len(a))
            low, high, size = points[rows, most], points[rows, most + 1], np.abs(increments[rows, most])
            if zoom == FIRST_ZOOM:
                before = size
        jumps = np.where((size >= SHRINKS * before) & (size > SMALL * scale), size, 0.0)
        if jumps.max() > 0:
            k = int(jumps.argmax())
            found.append(Jump(int(np.flatnonzero(channels)[c]), 0.5 * (low[k] + high[k]), float(size[k])))
    return found[0] if found else None


def _segments(plan: Plan, seed: int) -> tuple[ndarray, ndarray]:
    draws = np.asarray(plan.prior.sample(2 * SEGMENTS, seed=seed))  # pyright: ignore[reportOptionalMemberAccess]
    one, other = draws[:SEGMENTS], draws[SEGMENTS:]
    middle, half = 0.5 * (one + other), 0.5 * LONGER * (other - one)
    return middle - half, middle + half


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
