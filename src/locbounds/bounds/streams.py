"""Tracks, sights and noises drawn step by step: nothing that is kept grows with the steps.

Every step has keys of its own, so that a step's draws do not depend on how many steps come after it.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Bool, Float, Int
from locbounds.blocks import Stream, block_key
from locbounds.bounds.expectation import Expectation, Prior
from locbounds.bounds.score_covariance import NoiseProcess, mode_information, noise_process
from locbounds.linalg import psd_root
from locbounds.scenario import Link, Scenario, alike
from locbounds.sight.draws import next_sight
from locbounds.simulation import draw_noise


class Kind(NamedTuple):
    """Links of one structure, numbers with a leading axis of links."""

    first: int  # number of the first of them, for keys
    link: Link
    process: NoiseProcess
    information: Float[Array, "links modes"]


class Drawn(NamedTuple):
    """One step's draws for links of one structure."""

    sight: Int[Array, "groups links paths"]
    noise: Float[Array, "groups links paths"]
    gradient: Float[Array, "groups space links paths"]


class Step(NamedTuple):
    """What drawing a step needs of the model: its number, motion, chains, positions where these are not streamed."""

    k: Int[Array, ""]
    F: Float[Array, "state state"]
    root: Float[Array, "state state"]
    transitions: Sequence[Float[Array, "links modes modes"]]
    positions: Float[Array, "paths space"] | None


class Draws:
    """Independent draws of one block, ``groups`` of ``paths`` each; sights and noises by link, tracks for all links."""

    def __init__(self, scenario: Scenario, expectation: Expectation, seed, block, groups: int, paths: int):
        self.scenario, self.groups, self.paths = scenario, groups, paths
        self.tracks = block_key(seed, Stream.TRACKS, block)
        self.noise = block_key(seed, Stream.SIGHT_AND_NOISE, block)
        self.streamed = isinstance(expectation, Prior)
        self.given = None
        if not self.streamed:
            positions = expectation.positions(scenario, self.tracks, groups * paths)
            self.given = jnp.moveaxis(positions, 0, 1)
        self.kinds, first = [], 0
        for members, link in alike(scenario.links):
            each = [noise_process(scenario, scenario.links[m]) for m in members]
            process = jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(x) for x in leaves]), *each)
            information = jnp.stack([mode_information(process) for process in each])
            self.kinds.append(Kind(first, link, process, information))
            first += len(members)

    def first(self) -> tuple[Any, list[Drawn]]:
        """States and sights at step 0, with noises and gradients of nothing."""
        n, shape = self.groups * self.paths, (self.groups, self.paths)
        prior = self.scenario.prior
        x = None
        if self.streamed:
            root = psd_root(jnp.asarray(prior.covariance))
            x = prior.mean + jax.random.normal(jax.random.fold_in(self.tracks, 0), (n, len(root))) @ root

        def draw(law, key):
            return next_sight(law[None], jnp.zeros(shape, int), jax.random.uniform(key, shape))

        drawn = []
        for kind in self.kinds:
            sight = jax.vmap(draw, 0, 1)(kind.process.start, self._keys(kind, 0))
            drawn.append(
                Drawn(sight, jnp.zeros(sight.shape), jnp.zeros((len(sight), self.scenario.dim, *sight.shape[1:])))
            )
        return x, drawn

    def steps(self) -> Step:
        """What :meth:`next` needs, for steps 1..K along the leading axis."""
        scenario = self.scenario
        transitions = tuple(jnp.swapaxes(kind.process.transitions, 0, 1) for kind in self.kinds)
        roots = psd_root(scenario.process_noise)
        return Step(jnp.arange(1, scenario.steps + 1), scenario.transition, roots, transitions, self.given)

    def next(self, x, drawn: list[Drawn], step: Step) -> tuple[Any, list[Drawn]]:
        """States and draws of a step from those of the step before."""
        if self.streamed:
            x = x @ step.F.T + jax.random.normal(jax.random.fold_in(self.tracks, step.k), x.shape) @ step.root
            position = self.scenario.motion.position(x)
        else:
            assert step.positions is not None
            position = jnp.broadcast_to(step.positions, (self.groups * self.paths, self.scenario.dim))

        def draw(key, T, sight, noises):
            change, disturb = jax.random.split(key)
            sight = next_sight(T, sight, jax.random.uniform(change, sight.shape))
            return sight, draw_noise(disturb, noises, sight)

        def gradients(link):
            u = jax.vmap(jax.grad(link.measurement))(position)
            return jnp.moveaxis(u.reshape(self.groups, self.paths, -1), 2, 1)

        after = []
        for kind, before, T in zip(self.kinds, drawn, step.transitions, strict=True):
            sight, noise = jax.vmap(draw, (0, 0, 1, 0), 1)(
                self._keys(kind, step.k), T, before.sight, kind.process.noises
            )
            after.append(Drawn(sight, noise, jax.vmap(gradients, 0, 2)(kind.link)))
        return x, after

    def _keys(self, kind: Kind, k) -> Array:
        links = kind.first + np.arange(len(kind.information))
        return jax.vmap(partial(jax.random.fold_in, jax.random.fold_in(self.noise, k)))(links)


def reports_of(kind: Kind) -> Bool[Array, "steps links"]:
    """Which of the links reported when."""
    return jnp.swapaxes(kind.process.reports, 0, 1)
