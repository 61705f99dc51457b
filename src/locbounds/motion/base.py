"""What every motion model offers."""

from abc import abstractmethod

import equinox as eqx
import jax
import jax.numpy as jnp

from locbounds.axes import Array, Float, Scalar


class Motion(eqx.Module):
    """Linear Gaussian motion ``x_k = F(dt) x_{k-1} + v``, ``v ~ N(0, Q(dt))``; Q may be singular.

    Position is a view of the state: :attr:`position_index` says where it is, in any state order.
    """

    @property
    @abstractmethod
    def state_names(self) -> tuple[str, ...]:
        """Names of the state components with units, for example ``x_m`` and ``vx_m_s``."""

    @property
    @abstractmethod
    def position_index(self) -> tuple[int, ...]:
        """Indices of the position coordinates in the state."""

    @abstractmethod
    def transition(self, dt: Scalar) -> Float[Array, "state state"]:
        """F for an interval of ``dt`` seconds."""

    @abstractmethod
    def covariance(self, dt: Scalar) -> Float[Array, "state state"]:
        """Q for an interval of ``dt`` seconds."""

    def transitions(self, intervals: Float[Array, " steps"]) -> Float[Array, "steps state state"]:
        """F of every step, given the intervals in seconds."""
        return _every_step(self, jnp.asarray(intervals), covariance=False)

    def covariances(self, intervals: Float[Array, " steps"]) -> Float[Array, "steps state state"]:
        """Q of every step, given the intervals in seconds."""
        return _every_step(self, jnp.asarray(intervals), covariance=True)

    @property
    def state_size(self) -> int:
        """Number of state components."""
        return len(self.state_names)

    @property
    def dim(self) -> int:
        """Number of position coordinates."""
        return len(self.position_index)

    def position(self, x: Float[Array, "*n state"]) -> Float[Array, "*n space"]:
        """The position coordinates of a state."""
        return x[..., list(self.position_index)]


@eqx.filter_jit
def _every_step(motion: Motion, intervals: Array, *, covariance: bool) -> Array:
    return jax.vmap(motion.covariance if covariance else motion.transition)(intervals)
