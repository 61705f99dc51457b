"""Any jump-Markov model: chains of modes, a motion and measurements that may depend on them."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError
from locbounds.model.channels import AdditiveChannel, Channel
from locbounds.model.density_motion import DensityMotion
from locbounds.motion import Motion
from locbounds.motion.switching import SwitchingMotion, check_alike
from locbounds.priors import DensityPrior, GaussianPrior
from locbounds.sight import Sight
from locbounds.times import Times


def _tuple(value: Any) -> tuple:
    return (value,) if isinstance(value, Sight | Channel) else tuple(value)


class JumpMarkov(eqx.Module):
    """A jump-Markov model, for what :class:`Scenario` cannot say.

    ``x_0 ~ prior``, ``x_k ~ p(x_k | x_{k-1}, r_k)``, ``z_k ~ p(z_k | x_k, r_k)``; each channel's (and the motion's)
    mode follows one of the chains, which are independent of each other. Channels are independent given state and
    modes.

    Parameters
    ----------
    times
        Times of steps 0..K.
    prior
        Law of the state at step 0: Gaussian, or a density with a sampler.
    motion
        A motion; a tuple of linear motions, one per mode of the motion's chain; or a transition density with a
        sampler.
    channels
        What is measured.
    chains
        Markov chains of the modes; a single one governs everything. Chains with the same modes for several channels
        (and the motion) make these switch together.
    motion_chain
        Which chain a switching motion follows.
    title
        One line that names it.

    Raises
    ------
    InputError
        If pieces do not fit: dimensions, numbers of modes or steps, what the functions return.

    Examples
    --------
    A walker who climbs or rests, seen by one sensor that is better at rest:

    >>> import numpy as np, locbounds as lb
    >>> ones = np.ones((20, 1, 1))
    >>> model = lb.JumpMarkov(
    ...     times=lb.Times.uniform(step_s=1.0, steps=20),
    ...     prior=lb.GaussianPrior([0.0], [[1.0]]),
    ...     motion=[lb.LinearMotion(ones, q * ones, position_index=(0,)) for q in (1.0, 0.01)],
    ...     channels=lb.AdditiveChannel(lambda x, mode, k: x[0], [lb.Gaussian(0, 2), lb.Gaussian(0, 1)]),
    ...     chains=lb.MarkovSight.stay(0.9),
    ... )
    >>> model.steps, model.switching
    (20, True)
    """

    times: Times
    prior: GaussianPrior | DensityPrior
    motion: Motion | DensityMotion | tuple[Motion, ...]
    channels: tuple[Channel, ...]
    chains: tuple[Sight, ...]
    motion_chain: int = eqx.field(static=True)
    title: str = eqx.field(static=True)

    def __init__(self, *, times, prior, motion, channels, chains, motion_chain=0, title=""):
        self.times = times
        self.prior = prior
        self.motion = motion if isinstance(motion, Motion | DensityMotion) else tuple(motion)
        self.channels = _tuple(channels)
        self.chains = _tuple(chains)
        self.motion_chain = int(motion_chain)
        self.title = title

    def __check_init__(self):
        if not self.channels:
            raise InputError("the model has no channel", "Give at least one measurement")
        if not self.chains:
            raise InputError("the model has no chain", "Give at least one; MarkovSight([1.0], [[1.0]]) has one mode")
        if isinstance(self.motion, SwitchingMotion):
            raise InputError("a model has its chains beside its motion", "Give the motions, tuple(motion.motions)")
        if isinstance(self.motion, tuple):
            check_alike(self.motion)
            self._check_modes("the motion", len(self.motion), self.motion_chain)
        elif self.switching:
            self._check_modes("the motion", None, self.motion_chain)
        if isinstance(self.prior, GaussianPrior) and len(self.prior.mean) != self.state_size:
            raise InputError(
                f"the prior has {len(self.prior.mean)} components, the state {self.state_size}",
                f"Give one number per state component: {', '.join(self.state_names)}",
            )
        for c, channel in enumerate(self.channels):
            noises = len(channel.noises) if isinstance(channel, AdditiveChannel) else None
            self._check_modes(f"channel {c}", noises, channel.chain)
            if channel.view is not None and not set(channel.view) <= set(range(self.state_size)):
                raise InputError(f"channel {c} sees {channel.view} of {self.state_size} components", "Correct its view")
            if channel.reports is not None and np.shape(channel.reports) != (self.steps,):
                raise InputError(
                    f"channel {c} says for {np.shape(channel.reports)[0]} steps whether it reported, the model has "
                    f"{self.steps}",
                    "Give one truth value per step 1..K",
                )
        with jax.enable_x64(True):
            self._check_shapes()

    def _check_modes(self, what: str, modes: int | None, chain: int) -> None:
        if not 0 <= chain < len(self.chains):
            raise InputError(f"{what} follows chain {chain} of {len(self.chains)}", "Count chains from 0")
        if modes is not None and modes != len(self.chains[chain].start):
            raise InputError(
                f"{what} has {modes} modes, its chain {len(self.chains[chain].start)}", "Give one of each per mode"
            )

    def _check_shapes(self) -> None:
        """Trace every function once, without computing: wrong shapes are found here and not inside the engine."""
        key, k = jax.random.key(0), jax.ShapeDtypeStruct((), jnp.result_type(int))
        x = jax.ShapeDtypeStruct((self.state_size,), jnp.result_type(float))

        def shape(what: str, function, *arguments):
            try:
                return jax.eval_shape(function, *arguments).shape
            except (TypeError, ValueError, IndexError, AttributeError) as error:
                raise InputError(f"{what} fails: {error}", "Correct the function; it is traced by JAX") from error

        def same(what: str, got: tuple[int, ...], wanted: tuple[int, ...]) -> None:
            if got != wanted:
                raise InputError(f"{what} returns shape {got}", f"Return shape {wanted}")

        if isinstance(self.prior, DensityPrior):
            same("sample of the prior", shape("sample of the prior", self.prior.sample, key), x.shape)
            same("log_density of the prior", shape("log_density of the prior", self.prior.log_density, x), ())
        if isinstance(self.motion, DensityMotion):
            motion = self.motion
            for r in range(self.modes(self.motion_chain) if motion.switching else 1):
                drawn = shape("sample of the motion", lambda x, k, r=r: motion.sample(key, x, r, k), x, k)
                same("sample of the motion", drawn, x.shape)
                value = shape("log_density of the motion", lambda x, k, r=r: motion.log_density(x, x, r, k), x, k)
                same("log_density of the motion", value, ())
        for c, channel in enumerate(self.channels):
            for r in range(self.modes(channel.chain)):

                def draw(x, k, channel=channel, r=r):
                    return channel.draw(key, channel.seen(x), r, k)

                def log_density(z, x, k, channel=channel, r=r):
                    return channel.evaluate(z, channel.seen(x), r, k).log_density

                z = shape(f"channel {c}", draw, x, k)
                if isinstance(channel, AdditiveChannel):
                    same(f"h of channel {c}", z, ())
                shape(f"channel {c}", log_density, jax.ShapeDtypeStruct(z, x.dtype), x, k)

    @property
    def steps(self) -> int:
        """Number of measurement steps K."""
        return self.times.steps

    @property
    def switching(self) -> bool:
        """Whether the motion depends on the modes."""
        return self.motion.switching if isinstance(self.motion, DensityMotion) else isinstance(self.motion, tuple)

    @property
    def _like(self) -> Motion | DensityMotion:
        return self.motion[0] if isinstance(self.motion, tuple) else self.motion

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the state components."""
        return self._like.state_names

    @property
    def state_size(self) -> int:
        """Number of state components."""
        return len(self.state_names)

    @property
    def position_index(self) -> tuple[int, ...]:
        """Indices of the position coordinates in the state."""
        return self._like.position_index

    def modes(self, chain: int) -> int:
        """Number of modes of a chain."""
        return len(self.chains[chain].start)

    def transitions(self, chain: int) -> Float[Array, "steps modes modes"]:
        """Transition matrices of a chain, step by step."""
        return jnp.asarray(self.chains[chain].transitions(self.times.intervals))
