"""Drawing sight conditions."""

import jax
import jax.numpy as jnp

from locbounds.axes import Array, Float, Int


def sight_from_uniforms(
    start: Float[Array, " modes"], transitions: Float[Array, "steps modes modes"], u: Float[Array, "times runs"]
) -> Int[Array, "steps runs"]:
    """Sight of one link at steps 1..K from uniform numbers at steps 0..K, by inverse distribution functions."""

    def step(r, piece):
        T, u = piece
        r = next_sight(T, r, u)
        return r, r

    first = next_sight(jnp.asarray(start)[None], jnp.zeros(u.shape[1:], int), u[0])
    return jax.lax.scan(step, first, (transitions, u[1:]))[1]


def next_sight(
    transition: Float[Array, "before modes"], sight: Int[Array, "*runs"], u: Float[Array, "*runs"]
) -> Int[Array, "*runs"]:
    """Sight one step later from uniform numbers, by inverse distribution functions.

    >>> next_sight(jnp.array([[0.9, 0.1], [0.2, 0.8]]), jnp.array([0, 0, 1]), jnp.array([0.5, 0.95, 0.1])).tolist()
    [0, 1, 0]
    """
    modes = len(transition)
    below = jnp.cumsum(jnp.asarray(transition), -1)
    return sum(
        (
            (u >= sum((jnp.where(sight == i, below[i, j], 0.0) for i in range(modes)), 0.0)).astype(int)
            for j in range(below.shape[1] - 1)
        ),
        jnp.zeros(u.shape, int),
    )


def draw_sight(
    key: Array, start: Float[Array, " modes"], transitions: Float[Array, "steps modes modes"], runs: int
) -> Int[Array, "steps runs"]:
    """Sight of one link at steps 1..K; the chain starts at step 0."""
    return sight_from_uniforms(start, transitions, jax.random.uniform(key, (len(transitions) + 1, runs)))
