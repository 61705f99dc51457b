"""Drawing sight conditions."""

import jax
import jax.numpy as jnp

from locbounds.axes import Array, Float, Int


def sight_from_uniforms(
    start: Float[Array, " modes"], transitions: Float[Array, "steps modes modes"], u: Float[Array, "times runs"]
) -> Int[Array, "steps runs"]:
    """Sight of one link at steps 1..K from uniform numbers at steps 0..K, by inverse distribution functions."""

    def pick(law, u):  # inverse distribution function; law [..., modes]
        return jnp.sum(u[..., None] >= jnp.cumsum(law, -1)[..., :-1], -1)

    def step(r, piece):
        T, u = piece
        r = pick(T[r], u)
        return r, r

    return jax.lax.scan(step, pick(jnp.asarray(start), u[0]), (transitions, u[1:]))[1]


def draw_sight(
    key: Array, start: Float[Array, " modes"], transitions: Float[Array, "steps modes modes"], runs: int
) -> Int[Array, "steps runs"]:
    """Sight of one link at steps 1..K; the chain starts at step 0."""
    return sight_from_uniforms(start, transitions, jax.random.uniform(key, (len(transitions) + 1, runs)))
