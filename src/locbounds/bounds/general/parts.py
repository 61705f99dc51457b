"""A model in independent parts: one chain each, with everything that follows it."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.bounds.general.switching_motion import Steps, step_score
from locbounds.model import Channel, DensityMotion, JumpMarkov


class Part(eqx.Module):
    """One chain, the channels that follow it, and the motion's transition density where that belongs to it.

    Attributes
    ----------
    motion
        Transition densities by step and mode (linear), or the user's; None where the motion is no part of this.
    components
        State components that the part's scores are about.
    """

    start: Float[Array, " modes"]
    transitions: Float[Array, "steps modes modes"]
    channels: tuple[Channel, ...]
    reports: tuple[Array, ...]
    motion: Steps | DensityMotion | None
    components: tuple[int, ...] = eqx.field(static=True)
    size: int = eqx.field(static=True)

    @property
    def lag(self) -> int:
        """1 where the scores of a step are also about the state before it."""
        return int(self.motion is not None)

    @property
    def modes(self) -> int:
        """Number of modes."""
        return len(self.start)

    def evaluate(
        self, x: Array, before: Array, z: tuple[Array, ...], motion: Steps | None, k: Array, reported: tuple[Array, ...]
    ) -> tuple[Float[Array, " modes"], Float[Array, "modes m"], Float[Array, "modes roots m"]]:
        """Log-densities of one sample's step by mode, their gradients, and roots of the known-mode information.

        The gradients are about the part's components at this step and, with lag 1, at the step before.
        """
        here = {i: position for position, i in enumerate(self.components)}
        width = len(self.components)
        values, gradients, roots = [], [], []
        for r in range(self.modes):
            value, gradient, root = jnp.zeros(()), jnp.zeros((1 + self.lag) * width), []
            for channel, z_c, reported_c in zip(self.channels, z, reported, strict=True):
                e = channel.evaluate(z_c, channel.seen(x), r, k)
                view = range(self.size) if channel.view is None else channel.view
                at = np.array([here[i] for i in view])
                value = value + jnp.where(reported_c, e.log_density, 0.0)
                gradient = gradient.at[at].add(jnp.where(reported_c, e.gradient, 0.0))
                root.append(jnp.zeros_like(gradient).at[at].set(jnp.where(reported_c, e.root, 0.0)))
            if isinstance(self.motion, DensityMotion):
                new, old = x, before
                law = self.motion.log_density
                e = jax.value_and_grad(lambda new, old, r=r, law=law: jnp.reshape(law(new, old, r, k), ()), (0, 1))(
                    new, old
                )
                g = jnp.concatenate(e[1])
                value, gradient = value + e[0], gradient + g
                root.append(g)
            elif motion is not None:
                step_value, g = step_score(motion, r, x, before)
                value, gradient = value + step_value, gradient + g
            values.append(value)
            gradients.append(gradient)
            roots.append(jnp.stack(root) if root else jnp.zeros((0, gradient.size)))
        return jnp.stack(values), jnp.stack(gradients), jnp.stack(roots)

    def densities(self) -> np.ndarray:
        """Which roots are scores of densities that the user wrote."""
        own = [not channel.exact_information for channel in self.channels]
        return np.array(own + [True] * isinstance(self.motion, DensityMotion), dtype=bool)

    def exact_roots(self) -> np.ndarray:
        """Which roots the mode's own law weighs: those that do not depend on the measurement, nor on the mode."""
        own = [channel.exact_information and self.motion is None for channel in self.channels]
        return np.array(own + [False] * isinstance(self.motion, DensityMotion), dtype=bool)


def parts(model: JumpMarkov, whole: bool, linear: Steps | None) -> list[Part]:
    """The parts of a model: the motion's (if its density is needed), then one per chain that channels follow.

    Parameters
    ----------
    model
        The model.
    whole
        Whether the whole state's score is needed: then all scores are about all components.
    linear
        Transition densities of a linear motion that switches.
    """
    out = []
    density = model.motion if isinstance(model.motion, DensityMotion) else linear
    used = {channel.chain for channel in model.channels} | ({model.motion_chain} if density is not None else set())
    for c in sorted(used):
        following = [channel for channel in model.channels if channel.chain == c]
        with_motion = density is not None and model.switching and c == model.motion_chain
        if following or with_motion:
            out.append(_part(model, c, following, density if with_motion else None, whole))
    if density is not None and not model.switching:  # a density without modes: a chain of one mode
        out.append(
            Part(
                np.ones(1),
                jnp.ones((model.steps, 1, 1)),
                (),
                (),
                density,
                tuple(range(model.state_size)),
                model.state_size,
            )
        )
    return out


def _part(
    model: JumpMarkov, c: int, channels: list[Channel], motion: Steps | DensityMotion | None, whole: bool
) -> Part:
    everything = tuple(range(model.state_size))
    views = {i for channel in channels for i in (everything if channel.view is None else channel.view)}
    components = everything if motion is not None else tuple(sorted(views))
    always = jnp.ones(model.steps, dtype=bool)
    reports = tuple(always if channel.reports is None else jnp.asarray(channel.reports) for channel in channels)
    start = jnp.asarray(model.chains[c].start)
    bare = tuple(dataclasses.replace(channel, chain=0, reports=None) for channel in channels)  # one compiled kernel
    return Part(start, model.transitions(c), bare, reports, motion, components, model.state_size)
