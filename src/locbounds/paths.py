"""Draws of modes, states and measurements from a jump-Markov model."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from locbounds.axes import Array, Float, Int
from locbounds.blocks import Stream, block_key
from locbounds.linalg import psd_root
from locbounds.model import DensityMotion, JumpMarkov
from locbounds.priors import GaussianPrior
from locbounds.sight.draws import draw_sight


class Paths(NamedTuple):
    """Draws, steps first.

    Attributes
    ----------
    x
        [steps+1, samples, state].
    modes
        Per chain [steps, samples].
    z
        Per channel [steps, samples, ...].
    """

    x: Float[Array, "times samples state"]
    modes: tuple[Int[Array, "steps samples"], ...]
    z: tuple[Array, ...]


@eqx.filter_jit
def draw_paths(model: JumpMarkov, seed: Any, block: Any, samples: int) -> Paths:
    """Independent paths of one block; modes first, then states given modes, then measurements given both."""
    modes = tuple(
        draw_sight(
            jax.random.fold_in(block_key(seed, Stream.SCHEDULES, block), c),
            jnp.asarray(chain.start),
            model.transitions(c),
            samples,
        )
        for c, chain in enumerate(model.chains)
    )
    x = moving_states(block_key(seed, Stream.TRACKS, block), model, modes[model.motion_chain], samples)
    measurements = block_key(seed, Stream.MEASUREMENTS, block)
    z = []
    for c, channel in enumerate(model.channels):
        key, mode = jax.random.fold_in(measurements, c), modes[channel.chain]

        def one(number, x, k, mode, channel=channel, key=key):
            return _chosen(
                mode,
                [channel.draw(jax.random.fold_in(key, number), x, r, k) for r in range(model.modes(channel.chain))],
            )

        steps = jnp.arange(1, model.steps + 1)
        number = jnp.arange(model.steps * samples, dtype=jnp.uint32).reshape(model.steps, samples)
        z.append(jax.vmap(jax.vmap(one, (0, 0, None, 0)))(number, channel.seen(x[1:]), steps, mode))
    return Paths(x, modes, tuple(z))


def _chosen(mode: Array, by_mode: list[Array]) -> Array:
    """The entry of the present mode."""
    out = by_mode[0]
    for r, value in enumerate(by_mode[1:], start=1):
        out = jnp.where(mode == r, value, out)
    return out


def moving_states(key: Array, model: JumpMarkov, modes: Int[Array, "steps n"], n: int) -> Float[Array, "times n state"]:
    """States given the modes of the motion's chain, steps first."""
    first, driving = jax.random.split(key)
    prior, motion = model.prior, model.motion
    if isinstance(prior, GaussianPrior):
        root = psd_root(jnp.asarray(prior.covariance))
        x0 = prior.mean + jax.random.normal(first, (n, model.state_size)) @ root
    else:
        x0 = jax.vmap(prior.sample)(jax.random.split(first, n)).astype(float)
    steps = jnp.arange(1, model.steps + 1)
    keys = jax.random.split(driving, model.steps)

    if isinstance(motion, DensityMotion):
        count = model.modes(model.motion_chain) if motion.switching else 1

        def step(x, inputs):
            k, key, mode = inputs

            def one(key, x, mode):
                return _chosen(mode, [jnp.asarray(motion.sample(key, x, r, k), dtype=float) for r in range(count)])

            x = jax.vmap(one)(jax.random.split(key, n), x, mode)
            return x, x

        inputs = (steps, keys, modes)
    else:
        motions = motion if isinstance(motion, tuple) else (motion,)
        F = jnp.stack([m.transitions(model.times.intervals) for m in motions], 1)
        roots = psd_root(jnp.stack([m.covariances(model.times.intervals) for m in motions], 1))

        def step(x, inputs):
            F, root, key, mode = inputs
            noise = jax.random.normal(key, x.shape)
            moved = [x @ F[r].T + noise @ root[r] for r in range(len(motions))]
            x = _chosen(mode[:, None], moved)
            return x, x

        inputs = (F, roots, keys, modes)
    return jnp.concatenate([x0[None], jax.lax.scan(step, x0, inputs)[1]])
