"""Noise times geometry: the information increments of links whose score covariance does not depend on the track.

The measurement of step k adds ``sum_m C_m(i, j; k) E[grad h_m(x_{k-i}) grad h_m(x_{k-j})']`` between the ages i and j:
an increment of the score covariance (:mod:`locbounds.bounds.score_covariance`) times an expected product of gradients.
The products of the ages in the window move on by one age from step to step, so that only those with the newest age
are put in; nothing larger than one window is ever kept.
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.blocks import Stream, block_key
from locbounds.bounds.expectation import directions
from locbounds.bounds.recursion import Increments

STEPS_AT_ONCE = 16
TRACKS = 16  # tracks per group and block: the geometry varies far less than the noise


@partial(jax.jit, static_argnames=("groups", "window", "sharing"))
def geometry(
    scenario, expectation, seed, block, *, groups, window, sharing
) -> Float[Array, "groups processes steps window space space"]:
    """Group means of ``grad h(x_n) grad h(x_{n-lag})^T`` by step n and lag, summed over links that share noise."""
    kept = groups if expectation.random else 1
    u = directions(scenario, expectation, block_key(seed, Stream.TRACKS, block), groups * TRACKS)
    links, paths, steps, space = u.shape
    u = u.reshape(links, kept, paths // kept, steps, space)
    table = jnp.stack([_lagged_products(u[np.array(shared)], window) for shared in sharing], axis=1)
    return table * (kept / paths)


def _lagged_products(
    u: Float[Array, "links groups paths steps space"], window: int
) -> Float[Array, "groups steps lags space space"]:
    """Sums of ``u_n u_{n-lag}'`` over links and paths: products of blocks of steps with themselves and the last."""
    links, groups, paths, steps, space = u.shape
    size = min(steps, max(window, STEPS_AT_ONCE))
    blocks = -(-steps // size)
    u = jnp.pad(u, ((0, 0), (0, 0), (0, 0), (0, blocks * size - steps), (0, 0)))
    now = jnp.moveaxis(u.reshape(links, groups, paths, blocks, size * space), 0, 2)
    before = jnp.pad(now, ((0, 0), (0, 0), (0, 0), (1, 0), (0, 0)))[..., :-1, :]  # nothing before step 1
    products = jnp.einsum("gplba,gplbc->gbac", now, jnp.concatenate([before, now], -1))
    products = products.reshape(groups, blocks, size, space, 2 * size, space)
    n, lag = np.arange(size)[:, None], np.arange(window)
    table = jnp.moveaxis(products[:, :, n, :, size + n - lag], (0, 1), (2, 3))  # the two index arrays lead
    return table.reshape(groups, -1, window, space, space)[:, :steps]


class SeparatedIncrements(Increments):
    """Increments of the information from tables of score covariances and of geometry.

    Parameters
    ----------
    C
        Increments of the score covariance, [processes, steps, W, W].
    G
        Products of gradients, [processes, steps, W, space, space].
    others
        Other such tables, [groups, ...] each (the geometry may be one for all, [1, ...]), whose differences from the
        first are followed as changes.
    """

    def __init__(self, C: Array, G: Array, others: tuple[Array, Array] | None = None):
        self.processes, _, self.ages, _ = C.shape
        self.space = G.shape[-1]
        self.groups, self.tracks = (0, 0) if others is None else (len(others[0]), len(others[1]))
        means = jnp.moveaxis(C, 1, 0), jnp.transpose(G, (1, 0, 3, 2, 4))
        if others is None:
            self.pieces = means, None
        else:
            self.pieces = (
                means,
                (jnp.transpose(others[0], (2, 1, 3, 0, 4)), jnp.transpose(others[1], (2, 1, 4, 0, 3, 5))),
            )

    def first(self) -> Any:
        shape = self.processes, self.ages, self.space, self.ages, self.space
        each = jnp.zeros((*shape[:3], self.tracks, *shape[3:])) if self.groups else None
        return jnp.zeros(shape), each

    def advance(self, carried: Any, piece: Any) -> tuple[Any, Array, Array | None]:
        mean, each = carried
        (C, newest), others = piece
        size = self.ages * self.space
        mean = _move_on(mean[:, :, :, None], newest[:, :, None])[:, :, :, 0]
        D = jnp.sum(C[:, :, None, :, None] * mean, 0)
        if others is None:
            return (mean, each), D.reshape(size, size), None
        C, newest = others
        each = _move_on(each, newest)
        dD = jnp.sum(C[:, :, None, :, :, None] * each, 0) - D[:, :, None]
        return (mean, each), D.reshape(size, size), dD.reshape(size, -1, size)


def _move_on(
    products: Float[Array, "processes window space groups window space"],
    newest: Float[Array, "processes space groups window space"],
) -> Float[Array, "processes window space groups window space"]:
    """Products of the gradients at all pairs of ages one step later, given those of the newest age with every other."""
    row = newest[:, None]
    column = jnp.transpose(newest, (0, 3, 4, 2, 1))[:, 1:, :, :, None]
    older = jnp.concatenate([column, products[:, :-1, :, :, :-1]], axis=4)
    return jnp.concatenate([row, older], axis=1)
