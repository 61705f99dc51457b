"""Random walk: the position itself is disturbed."""

import equinox as eqx
import jax.numpy as jnp

from locbounds.axes import Array, Float, Scalar
from locbounds.motion.base import Motion
from locbounds.motion.intensity import check_intensity, per_axis


class RandomWalk(Motion):
    """Brownian motion of the position; state [x, y] or [x, y, z].

    Parameters
    ----------
    intensity
        Diffusion in m^2/s: the variance of the displacement per second; one number, or one per axis.
    dim
        2 or 3 position coordinates.

    Raises
    ------
    InputError
        If an intensity is negative or not finite.

    Examples
    --------
    >>> RandomWalk([0.5, 2.0]).covariance(3.0).tolist()
    [[1.5, 0.0], [0.0, 6.0]]
    """

    intensity: Float[Array, " space"]
    axes: int = eqx.field(static=True)

    def __init__(self, intensity, dim: int = 2):
        self.intensity = per_axis(intensity, dim)
        self.axes = dim

    def __check_init__(self):
        check_intensity(self.intensity, "diffusion")

    @property
    def state_names(self) -> tuple[str, ...]:
        return tuple(f"{a}_m" for a in "xyz"[: self.axes])

    @property
    def position_index(self) -> tuple[int, ...]:
        return tuple(range(self.axes))

    def transition(self, dt: Scalar) -> Float[Array, "state state"]:
        return jnp.eye(self.axes)

    def covariance(self, dt: Scalar) -> Float[Array, "state state"]:
        return jnp.diag(dt * jnp.asarray(self.intensity))
