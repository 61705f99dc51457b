"""Motion known by its transition density."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Float
from locbounds.errors import InputError


class DensityMotion(eqx.Module):
    """Motion of any kind, given by the log-density of a step and a sampler.

    Parameters
    ----------
    log_density
        ``log_density(x_new, x_old, mode, k)`` of the step from k-1 to k, one number; differentiable by JAX with
        respect to both states; constants that depend on the mode matter, others do not.
    sample
        ``sample(key, x_old, mode, k)``: one draw of the new state, [state].
    state_names
        Names of the components with units.
    position_index
        Which components are the position.
    switching
        Whether the motion depends on the mode; if not, ``mode`` is always 0.

    Raises
    ------
    InputError
        If the functions cannot be called or the position is not part of the state.

    Examples
    --------
    >>> import jax, jax.numpy as jnp
    >>> def mean(x, mode):
    ...     return jnp.sin(x) if mode == 0 else 0.5 * x
    >>> motion = DensityMotion(
    ...     lambda new, old, mode, k: -0.5 * jnp.sum((new - mean(old, mode)) ** 2),
    ...     lambda key, old, mode, k: mean(old, mode) + jax.random.normal(key, old.shape),
    ...     state_names=("x_m",), position_index=(0,), switching=True,
    ... )
    >>> motion.state_size
    1
    """

    log_density: Callable[..., Any]
    sample: Callable[..., Any]
    state_names: tuple[str, ...] = eqx.field(static=True, converter=tuple, kw_only=True)
    position_index: tuple[int, ...] = eqx.field(static=True, converter=tuple, kw_only=True)
    switching: bool = eqx.field(static=True, kw_only=True)

    def __check_init__(self):
        if not (callable(self.log_density) and callable(self.sample)):
            raise InputError(
                "log_density and sample of a motion must be functions",
                "Give log_density(x_new, x_old, mode, k) and sample(key, x_old, mode, k)",
            )
        n, index = len(self.state_names), self.position_index
        if not index or len(set(index)) < len(index) or not set(index) <= set(range(n)):
            raise InputError(f"the position is {index} of {n} state components", "Name different components")

    @property
    def state_size(self) -> int:
        """Number of state components."""
        return len(self.state_names)

    def position(self, x: Float[Array, "*n state"]) -> Float[Array, "*n space"]:
        """The position coordinates of a state."""
        return x[..., np.array(self.position_index)]
