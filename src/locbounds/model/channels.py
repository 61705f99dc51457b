"""What is measured: one channel is one measurement per step whose law depends on the state and on one chain's mode.

A channel gives three things to the score engine, per mode: the log-density of the measurement, its gradient with
respect to the state (by autodiff of what the user wrote, never by hand), and a vector whose mean outer product is the
information of the measurement for a known mode.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Bool, Float, Scalar
from locbounds.errors import InputError
from locbounds.noise import Noise


class Evaluation(NamedTuple):
    """A measurement in one mode.

    Attributes
    ----------
    log_density
        ``log p(z | x, r)``.
    gradient
        Its gradient with respect to the part of the state that the channel sees, [view].
    root
        A vector with ``E[root root^T | r]`` equal to the information about that part, [view].
    """

    log_density: Scalar
    gradient: Float[Array, " view"]
    root: Float[Array, " view"]


class Channel(eqx.Module):
    """One measurement per step.

    Functions of a channel are called with Python integers for the mode, so that ``if mode == 0`` is fine, with the
    step ``k`` = 1..K as a JAX integer, and with the components ``view`` of the state.
    """

    chain: eqx.AbstractVar[int]
    view: eqx.AbstractVar[tuple[int, ...] | None]
    reports: eqx.AbstractVar[Bool[Array, " steps"] | None]

    @abstractmethod
    def draw(self, key: Array, x: Float[Array, " view"], mode: int, k: Any) -> Array:
        """One measurement in one mode."""

    @abstractmethod
    def evaluate(self, z: Array, x: Float[Array, " view"], mode: int, k: Any) -> Evaluation:
        """The measurement in one mode, as the score engine needs it."""

    @property
    @abstractmethod
    def exact_information(self) -> bool:
        """Whether ``root`` depends on the state only: then the mode's own law weighs it, without the measurement."""

    def seen(self, x: Float[Array, "*n state"]) -> Float[Array, "*n view"]:
        """The components of the state that the channel sees."""
        return x if self.view is None else x[..., np.array(self.view)]


def _mask(reports: Any) -> Any:
    return None if reports is None else np.asarray(reports, dtype=bool)


def _view(view: Any) -> tuple[int, ...] | None:
    return None if view is None else tuple(int(i) for i in view)


class AdditiveChannel(Channel):
    """``z_k = h(x_k, r_k) + w_k`` with a noise per mode.

    Parameters
    ----------
    h
        ``h(x, mode, k)``, one number; differentiable by JAX with respect to x. The BCRB needs it continuous, with
        ``E|grad h|^2`` finite, and looks for violations.
    noises
        One noise per mode.
    chain
        Which of the model's chains its mode is.
    view
        Components of the state that ``h`` is called with; None: the whole state.
    reports
        Which of the steps 1..K have a measurement, [steps]; None means all.

    Raises
    ------
    InputError
        If there is no noise, or ``h`` is no function.

    Examples
    --------
    >>> import locbounds as lb
    >>> lb.AdditiveChannel(lambda x, mode, k: x[0] * (1 + mode), [lb.Gaussian(0, 1), lb.Gaussian(0, 2)]).chain
    0
    """

    h: Callable[..., Any]
    noises: tuple[Noise, ...] = eqx.field(converter=tuple)
    chain: int = eqx.field(static=True, default=0, kw_only=True)
    view: tuple[int, ...] | None = eqx.field(static=True, default=None, converter=_view, kw_only=True)
    reports: Bool[Array, " steps"] | None = eqx.field(default=None, converter=_mask, kw_only=True)

    def __check_init__(self):
        if not callable(self.h):
            raise InputError(f"h is {self.h!r}, not a function", "Give h(x, mode, k)")
        if not self.noises:
            raise InputError("a channel has no noise", "Give one noise per mode")

    @property
    def exact_information(self) -> bool:
        return True

    def draw(self, key: Array, x: Float[Array, " view"], mode: int, k: Any) -> Array:
        return self.h(x, mode, k) + self.noises[mode].sample(key, ())

    def evaluate(self, z: Array, x: Float[Array, " view"], mode: int, k: Any) -> Evaluation:
        noise = self.noises[mode]
        h, gradient = jax.value_and_grad(lambda x: jnp.reshape(self.h(x, mode, k), ()))(x)
        w = z - h
        root = jnp.sqrt(jnp.asarray(noise.information())) * gradient
        value = noise.log_prob(w)
        score = jnp.where(value > -jnp.inf, noise.score(w), 0.0)  # a mode that cannot be has no score
        return Evaluation(value, gradient * score, root)


class DensityChannel(Channel):
    """A measurement of any kind, given by its log-density and its sampler.

    Parameters
    ----------
    log_density
        ``log_density(z, x, mode, k)``, one number; differentiable by JAX with respect to x; constants that depend on
        the mode matter, others do not.
    sample
        ``sample(key, x, mode, k)``: one measurement, a number or an array of fixed shape.
    chain, view, reports
        As for :class:`AdditiveChannel`.

    Raises
    ------
    InputError
        If one of them is no function.

    Notes
    -----
    The density must be smooth in x, with a support that does not depend on x. The engine checks on its own draws that
    the scores average to zero, which they do not where density and sampler differ.

    Examples
    --------
    Counts whose rate depends on the distance:

    >>> import jax, jax.numpy as jnp
    >>> rate = lambda x, mode: (9.0 if mode == 0 else 2.0) * jnp.exp(-x[0])
    >>> counts = DensityChannel(
    ...     lambda z, x, mode, k: z * jnp.log(rate(x, mode)) - rate(x, mode),
    ...     lambda key, x, mode, k: jax.random.poisson(key, rate(x, mode)),
    ... )
    >>> counts.view is None
    True
    """

    log_density: Callable[..., Any]
    sample: Callable[..., Any]
    chain: int = eqx.field(static=True, default=0, kw_only=True)
    view: tuple[int, ...] | None = eqx.field(static=True, default=None, converter=_view, kw_only=True)
    reports: Bool[Array, " steps"] | None = eqx.field(default=None, converter=_mask, kw_only=True)

    def __check_init__(self):
        if not (callable(self.log_density) and callable(self.sample)):
            raise InputError(
                "log_density and sample of a channel must be functions",
                "Give log_density(z, x, mode, k) and sample(key, x, mode, k)",
            )

    @property
    def exact_information(self) -> bool:
        return False

    def draw(self, key: Array, x: Float[Array, " view"], mode: int, k: Any) -> Array:
        return jnp.asarray(self.sample(key, x, mode, k), dtype=float)

    def evaluate(self, z: Array, x: Float[Array, " view"], mode: int, k: Any) -> Evaluation:
        value, gradient = jax.value_and_grad(lambda x: jnp.reshape(self.log_density(z, x, mode, k), ()))(x)
        possible = value > -jnp.inf
        gradient = jnp.where(possible, gradient, 0.0)  # a mode that cannot be has no score
        return Evaluation(value, gradient, gradient)
