"""Systematic resampling of many particle clouds at once."""

from typing import Any

import jax
import jax.numpy as jnp

from locbounds.axes import Array, Float, Int


def systematic(w: Float[Array, "particles tracks"], u: Float[Array, " tracks"]) -> Int[Array, "particles tracks"]:
    """Which particle each of the new ones copies: one uniform number per cloud.

    Particle i is copied as often as one of the points ``(j + u) / N`` falls between the sums of the weights before it
    and up to it: floor or ceiling of ``N w_i``, its expectation. Points and sums are both sorted, so that the
    particle of slot j is the number of sums that do not exceed its point, found by bisection.

    Parameters
    ----------
    w
        Weights, which sum to one over the particles.
    u
        Uniform numbers in (0, 1).

    Examples
    --------
    >>> systematic(jnp.array([[0.1], [0.6], [0.3], [0.0]]), jnp.array([0.5]))[:, 0].tolist()
    [1, 1, 1, 2]
    """
    particles, tracks = w.shape
    sums = jnp.cumsum(w, axis=0)
    sums = (sums / sums[-1]).reshape(-1)
    points = (jnp.arange(particles)[:, None] + u) / particles
    track = jnp.arange(tracks)
    halvings = max(1, (particles - 1).bit_length())

    def halve(_: Any, bracket: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = bracket
        middle = (low + high) // 2
        passed = jnp.take(sums, middle * tracks + track, mode="clip") <= points
        return jnp.where(passed, middle + 1, low), jnp.where(passed, high, middle)

    whole = jnp.zeros(w.shape, int), jnp.full(w.shape, particles - 1)
    return jax.lax.fori_loop(0, halvings, halve, whole)[0]
