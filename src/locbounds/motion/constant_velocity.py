"""Nearly constant velocity."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.motion.base import Motion
from locbounds.precision import float64, traced


class ConstantVelocity(Motion):
    """Constant velocity disturbed by white acceleration; state order positions first: [x, y, vx, vy].

    Parameters
    ----------
    intensity
        ``discrete=False``: power spectral density of a continuous white acceleration, m^2/s^3
        (Fritsche 2013, eq. 10, with the state order of the text).
        ``discrete=True``: variance of an acceleration that is constant during each interval, (m/s^2)^2
        (Chen 2010, eq. 15); Q is then singular.
        One number, or one per axis.
    dim
        2 or 3 position coordinates.
    discrete
        Which of the two.

    Raises
    ------
    InputError
        If an intensity is negative or not finite.

    Examples
    --------
    >>> np.asarray(ConstantVelocity(0.5).covariance(2.0))[:, 0].round(3).tolist()
    [1.333, 0.0, 1.0, 0.0]
    """

    intensity: Float[Array, " space"] = eqx.field(converter=float64)
    axes: int = eqx.field(static=True)
    discrete: bool = eqx.field(static=True)

    def __init__(self, intensity, dim: int = 2, *, discrete: bool = False):
        broadcast = jnp.broadcast_to if traced(intensity) else np.broadcast_to
        self.intensity = broadcast(float64(intensity), (dim,))
        self.axes = dim
        self.discrete = discrete

    def __check_init__(self):
        if self.axes not in (2, 3):
            raise InputError(f"motion has {self.axes} dimensions", "Use 2 or 3")
        if traced(self.intensity):
            return
        if not (np.all(np.isfinite(self.intensity)) and np.all(self.intensity >= 0)):
            raise InputError(f"acceleration intensity is {self.intensity}", "Give a finite number that is not negative")

    @property
    def state_names(self) -> tuple[str, ...]:
        axes = "xyz"[: self.axes]
        return (*(f"{a}_m" for a in axes), *(f"v{a}_m_s" for a in axes))

    @property
    def position_index(self) -> tuple[int, ...]:
        return tuple(range(self.axes))

    def transition(self, dt: Scalar) -> Float[Array, "state state"]:
        eye = jnp.eye(self.axes)
        return jnp.block([[eye, dt * eye], [jnp.zeros_like(eye), eye]])

    def covariance(self, dt: Scalar) -> Float[Array, "state state"]:
        q = jnp.diag(jnp.broadcast_to(jnp.asarray(self.intensity), (self.axes,)))
        pp, pv, vv = (dt**4 / 4, dt**3 / 2, dt**2) if self.discrete else (dt**3 / 3, dt**2 / 2, dt)
        return jnp.block([[pp * q, pv * q], [pv * q, vv * q]])
