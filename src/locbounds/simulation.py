"""Drawing tracks, sight conditions and measurements from a scenario."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Int
from locbounds.blocks import Stream, block_key, check_seed
from locbounds.cores import on_all_cores
from locbounds.errors import InputError
from locbounds.linalg import psd_root
from locbounds.model import JumpMarkov, jump_markov
from locbounds.motion import SwitchingMotion
from locbounds.noise import Noise
from locbounds.paths import draw_paths, moving_states
from locbounds.precision import double_precision, traced
from locbounds.scenario import Link, Scenario, alike, beyond_separation
from locbounds.sight.draws import draw_sight, sight_from_uniforms

RUNS_PER_BLOCK = 1024

__all__ = [
    "Draws",
    "draw_noise",
    "draw_sight",
    "draw_states",
    "equal_weights",
    "likelihood_ratios",
    "sight_from_uniforms",
    "simulate",
]


class Draws(NamedTuple):
    """Simulated tracks.

    Attributes
    ----------
    states
        [runs, steps+1, state]; row 0 is the state at step 0.
    sight
        [runs, steps, links], 0 = LOS, 1 = NLOS.
    measurements
        [runs, steps, links] in metres, NaN where a link did not report.

    Examples
    --------
    >>> import locbounds as lb
    >>> lb.simulate(lb.papers.fritsche2013.scenario(), runs=5).states.shape
    (5, 101, 4)
    """

    states: Float[Array, "runs times state"]
    sight: Int[Array, "runs steps links"]
    measurements: Float[Array, "runs steps links"]


def draw_states(key: Array, scenario: Scenario, runs: int) -> Float[Array, "runs times state"]:
    """Tracks from the prior and the motion model; differentiable in both."""
    if isinstance(scenario.motion, SwitchingMotion):
        chain = scenario.motion.sight
        transitions = chain.transitions(scenario.times.intervals)
        modes = draw_sight(jax.random.fold_in(key, 1), jnp.asarray(chain.start), transitions, runs)
        return jnp.moveaxis(moving_states(key, jump_markov(scenario), modes, runs), 0, 1)
    first, driving = jax.random.split(key)
    n = scenario.motion.state_size
    x0 = scenario.prior.mean + jax.random.normal(first, (runs, n)) @ psd_root(jnp.asarray(scenario.prior.covariance))
    roots = psd_root(scenario.process_noise)
    v = jnp.einsum("krj,kij->kri", jax.random.normal(driving, (scenario.steps, runs, n)), roots)

    def step(x, piece):
        F, v = piece
        x = x @ F.T + v
        return x, x

    _, later = jax.lax.scan(step, x0, (scenario.transition, v))
    return jnp.concatenate([x0[:, None], jnp.moveaxis(later, 0, 1)], axis=1)


def likelihood_ratios(
    sight: Int[Array, "steps runs"], start: Float[Array, " modes"], transitions: Float[Array, "steps modes modes"]
) -> Float[Array, "steps runs"]:
    """Ones, whose derivative with respect to the chain is that of the log-probability of the sight up to every step.

    Drawing a sight has no derivative. Means over draws that are weighted with these ratios have the right one:
    ``d E[f] = E[d f] + E[f d log p]``.
    """
    first = (jnp.asarray(start) @ transitions[0])[sight[0]]
    later = jax.vmap(lambda T, now, next: T[now, next])(transitions[1:], sight[:-1], sight[1:])
    log_p = jnp.cumsum(jnp.log(jnp.concatenate([first[None], later])), axis=0)
    return jnp.exp(log_p - jax.lax.stop_gradient(log_p))


def equal_weights(ratios: Float[Array, "steps runs"], groups: int) -> Float[Array, "steps groups runs_per_group"]:
    """Likelihood ratios as weights that sum to one in every group, which removes the noise of what all draws share."""
    grouped = ratios.reshape(len(ratios), groups, -1)
    return grouped / grouped.sum(-1, keepdims=True)


def draw_noise(key: Array, noises: tuple[Noise, ...], sight: Int[Array, "*n"]) -> Float[Array, "*n"]:
    """Noise given the sight of every sample; differentiable in the noises.

    Every mode draws from the same key and one of the draws is used, so that equal random numbers are made only once:
    by ``jax.vmap`` where all modes have laws of one structure, because XLA does not see that two loops are the same.
    """
    structures = {
        (tree, tuple((np.shape(x), jnp.result_type(x)) for x in leaves))
        for leaves, tree in map(jax.tree.flatten, noises)
    }
    if len(structures) == 1:
        laws = jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(x) for x in leaves]), *noises)
        draws = jax.vmap(lambda law: law.sample(key, sight.shape))(laws)
    else:
        draws = [noise.sample(key, sight.shape) for noise in noises]
    w = draws[0]
    for mode, draw in enumerate(draws[1:], start=1):
        w = jnp.where(sight == mode, draw, w)
    return w


@partial(jax.jit, static_argnames="runs")
def _draw_block(scenario: Scenario, seed: Array, block: Array, runs: int) -> Draws:
    states = draw_states(block_key(seed, Stream.TRACKS, block), scenario, runs)
    position = scenario.motion.position(states[:, 1:])
    intervals = jnp.asarray(scenario.times.intervals)
    base = block_key(seed, Stream.MEASUREMENTS, block)

    def observe(link: Link, m: Array) -> tuple[Array, Array]:
        chain, noise = jax.random.split(jax.random.fold_in(base, m))
        r = draw_sight(chain, link.sight.start, link.sight.transitions(intervals), runs).T
        z = jax.vmap(jax.vmap(link.measurement))(position) + draw_noise(noise, link.noises, r)
        return r, z if link.reports is None else jnp.where(link.reports, z, jnp.nan)

    order, parts = zip(
        *((index, jax.vmap(observe)(links, index)) for index, links in alike(scenario.links)), strict=True
    )
    back = np.argsort(np.concatenate(order))
    sight, measurements = (jnp.moveaxis(jnp.concatenate(part)[back], 0, -1) for part in zip(*parts, strict=True))
    return Draws(states, sight, measurements)


@eqx.filter_jit
def _draw_general_block(model: Any, seed: Any, block: Any, runs: int) -> Draws:
    paths = draw_paths(model, seed, block, runs)
    z = [
        z if channel.reports is None else jnp.where(jnp.asarray(channel.reports)[:, None], z, jnp.nan)
        for channel, z in zip(model.channels, paths.z, strict=True)
    ]
    sight = [paths.modes[channel.chain] for channel in model.channels]
    return Draws(jnp.moveaxis(paths.x, 0, 1), *(jnp.moveaxis(jnp.stack(a), (0, 1, 2), (2, 1, 0)) for a in (sight, z)))


@double_precision
def simulate_block(scenario: Scenario | JumpMarkov, *, seed: int, block: int) -> Draws:
    """One block of :data:`RUNS_PER_BLOCK` tracks of :func:`simulate`: for more runs than fit into memory.

    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=3)
    >>> few = lb.simulate(scenario, runs=3, seed=1).states
    >>> bool(np.all(simulate_block(scenario, seed=1, block=0).states[:3] == few))
    True
    """
    return jax.tree.map(np.asarray, _drawing(scenario, seed)(block))


def _drawing(scenario: Scenario | JumpMarkov, seed: int) -> Callable[[int], Draws]:
    """What draws one block."""
    check_seed(seed)
    if isinstance(scenario, JumpMarkov) or beyond_separation(scenario):
        model = scenario if isinstance(scenario, JumpMarkov) else jump_markov(scenario.anonymous())
        draw: Callable[..., Draws] = _draw_general_block
    else:
        for link in scenario.links:
            link.sight.transitions(scenario.times.intervals)  # raises where chain and times do not fit; jit does not
        model, draw = scenario.anonymous(), _draw_block
    return lambda block: draw(model, np.uint32(seed), np.uint32(block), RUNS_PER_BLOCK)


@double_precision
def simulate(scenario: Scenario | JumpMarkov, *, runs: int, seed: int = 0) -> Draws:
    """Draw tracks, sight conditions and measurements.

    Parameters
    ----------
    scenario
        What to draw from. Of a :class:`~locbounds.JumpMarkov`, whose measurements must be numbers, channels take
        the place of links.
    runs
        Number of tracks, at least 1. The first tracks are the same for any number.
    seed
        Seed of the random numbers.

    Returns
    -------
    Draws
        States [runs, steps+1, state], sight [runs, steps, links], measurements [runs, steps, links].

    Raises
    ------
    InputError
        If ``runs`` is below 1.

    Notes
    -----
    States and measurements can be differentiated with respect to prior, motion, anchors and noises, for the sight that
    was drawn; the sight itself jumps.

    Examples
    --------
    >>> import locbounds as lb
    >>> lb.simulate(lb.papers.fritsche2013.scenario(), runs=2, seed=1).measurements.shape
    (2, 100, 3)
    """
    if runs < 1 or int(runs) != runs:
        raise InputError(f"the number of runs is {runs}", "Give a whole number of at least 1")
    draw, later = _drawing(scenario, seed), range(1, -(-runs // RUNS_PER_BLOCK))
    if traced(scenario):
        return jax.tree.map(lambda *parts: jnp.concatenate(parts)[:runs], draw(0), *map(draw, later))

    def drawn(block: int) -> Draws:
        return jax.tree.map(np.asarray, draw(block))

    return jax.tree.map(lambda *parts: np.concatenate(parts)[:runs], drawn(0), *on_all_cores(drawn, later))
