"""Where a plan's functions jump from one place to the next, or are too steep, found numerically."""

from typing import NamedTuple

import numpy as np

from locbounds.axes import Array, ndarray
from locbounds.measurement import is_own
from locbounds.plan.plan import Plan
from locbounds.precision import double_precision, traced
from locbounds.probes import Steep, find_jump, steepest
from locbounds.probes.jumps import segments

SEGMENTS = 256  # through the support
DRAWS = 8192


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


def own_channels(plan: Plan) -> Array:
    """Numbers of the channels whose function is somebody's own, about which nothing is known."""
    return np.flatnonzero([is_own(m) for group in plan.groups for m in group.per_channel])


@double_precision
def black_box_jump(plan: Plan, *, seed: int = 0) -> Jump | None:
    """A jump of one of the plan's functions where its prior is positive, or None if none is found.

    Sought on segments through pairs of draws from the prior (:func:`locbounds.probes.find_jump`).

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
    channels = own_channels(plan)
    if plan.prior is None or not len(channels) or traced(plan):
        return None
    draws = np.asarray(plan.prior.sample(2 * SEGMENTS, seed=seed))
    low, high = segments(draws[:SEGMENTS], draws[SEGMENTS:])
    for c in channels:

        def values(points: ndarray, c: int = c) -> ndarray:
            return np.asarray(plan.means(points.reshape(-1, plan.dim)))[:, c].reshape(points.shape[:2])

        found = find_jump(values, low, high, inside=plan.prior.inside, periodic=bool(plan.periodic[c]))
        if found is not None:
            return Jump(int(c), *found)
    return None


@double_precision
def black_box_steepness(plan: Plan, *, seed: int = 0) -> tuple[int, Steep] | None:
    """A channel of the plan whose expected information is, or may be, infinite because its function is too steep.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> import locbounds as lb
    >>> prior = lb.GaussianPrior([0.0, 0.0], 4 * jnp.eye(2))
    >>> channel, found = black_box_steepness(lb.observe(lambda p: jnp.log(p @ p), 1.0, prior=prior))
    >>> channel, found.infinite
    (0, True)
    """
    channels = own_channels(plan)
    if plan.prior is None or not len(channels) or traced(plan):
        return None
    draws = np.asarray(plan.prior.sample(DRAWS, seed=seed))[None]
    doubtful = None
    for c in channels:
        found = steepest(lambda p, law, c=c: np.asarray(plan.gradients(p))[:, c], draws, inside=plan.prior.inside)
        if found is not None and found.infinite:
            return int(c), found
        if found is not None:
            doubtful = doubtful or (int(c), found)
    return doubtful
