"""Systematic resampling of many particle clouds at once."""

import jax
import jax.numpy as jnp

from locbounds.axes import Array, Float, Int


def systematic(w: Float[Array, "particles tracks"], u: Float[Array, " tracks"]) -> Int[Array, "particles tracks"]:
    """Which particle each of the new ones copies: one uniform number per cloud.

    Particle i is copied as often as one of the points ``(j + u) / N`` falls between the sums of the weights before it
    and up to it: floor or ceiling of ``N w_i``, its expectation. The number of points before a sum is its slot; every
    particle is written into its first slot, and each of the later ones copies what stands before it.

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
    after = jnp.clip(jnp.ceil(sums / sums[-1] * particles - u), 0, particles).astype(int).at[-1].set(particles)
    first = jnp.concatenate([jnp.zeros((1, tracks), int), after[:-1]])
    number = jnp.where(after > first, jnp.arange(particles)[:, None], 0)
    slots = jnp.zeros(w.shape, int).at[jnp.minimum(first, particles - 1), jnp.arange(tracks)].max(number)
    return jax.lax.cummax(slots, axis=0)
