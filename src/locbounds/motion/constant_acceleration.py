"""Nearly constant acceleration."""

import equinox as eqx
import jax.numpy as jnp

from locbounds.axes import Array, Float, Scalar
from locbounds.motion.base import Motion
from locbounds.motion.intensity import check_intensity, per_axis


class ConstantAcceleration(Motion):
    """Constant acceleration disturbed by white jerk; state [x, y, vx, vy, ax, ay], positions first.

    Parameters
    ----------
    intensity
        Power spectral density of the jerk in m^2/s^5; one number, or one per axis.
    dim
        2 or 3 position coordinates.

    Raises
    ------
    InputError
        If an intensity is negative or not finite.

    Notes
    -----
    ``Q = int_0^dt F(s) G q G^T F(s)^T ds``, Bar-Shalom, Li and Kirubarajan 2001, section 6.2.3.

    Examples
    --------
    >>> ConstantAcceleration(0.5).state_size
    6
    """

    intensity: Float[Array, " space"]
    axes: int = eqx.field(static=True)

    def __init__(self, intensity, dim: int = 2):
        self.intensity = per_axis(intensity, dim)
        self.axes = dim

    def __check_init__(self):
        check_intensity(self.intensity, "jerk intensity")

    @property
    def state_names(self) -> tuple[str, ...]:
        return tuple(
            f"{p}{a}_{unit}" for p, unit in (("", "m"), ("v", "m_s"), ("a", "m_s2")) for a in "xyz"[: self.axes]
        )

    @property
    def position_index(self) -> tuple[int, ...]:
        return tuple(range(self.axes))

    def transition(self, dt: Scalar) -> Float[Array, "state state"]:
        one_axis = jnp.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
        return jnp.kron(one_axis, jnp.eye(self.axes))

    def covariance(self, dt: Scalar) -> Float[Array, "state state"]:
        one_axis = jnp.array(
            [
                [dt**5 / 20, dt**4 / 8, dt**3 / 6],
                [dt**4 / 8, dt**3 / 3, dt**2 / 2],
                [dt**3 / 6, dt**2 / 2, dt],
            ]
        )
        return jnp.kron(one_axis, jnp.diag(jnp.asarray(self.intensity)))
