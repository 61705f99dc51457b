"""Coordinated turn at a known rate."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.motion.base import Motion
from locbounds.motion.intensity import check_intensity
from locbounds.precision import float64, traced

SLOW = 1e-2  # below this angle in radians a step is summed as a series: the closed form cancels digits
_TERMS = 6  # of the series: the rest is below rounding


def _turned(angle: Scalar) -> tuple[Array, Array, Array, Array]:
    """``sin(a)/a``, ``(1 - cos a)/a``, ``(1 - cos a)/a^2`` and ``(a - sin a)/a^2``, also at zero."""
    a = jnp.asarray(angle, dtype=float)
    slow = jnp.abs(a) < SLOW
    safe = jnp.where(slow, 1.0, a)
    n = np.arange(_TERMS)
    sign = (-1.0) ** n
    even = a ** (2 * n)
    factorials = np.cumprod(np.concatenate([[1.0], np.arange(1.0, 2 * _TERMS + 3)]))
    sine = jnp.sum(sign * even / factorials[2 * n + 1])  # sin(a)/a
    half = jnp.sum(sign * even / factorials[2 * n + 2])  # (1 - cos a)/a^2
    rest = a * jnp.sum(sign * even / factorials[2 * n + 3])  # (a - sin a)/a^2
    closed = (
        jnp.sin(safe) / safe,
        (1 - jnp.cos(safe)) / safe,
        (1 - jnp.cos(safe)) / safe**2,
        (safe - jnp.sin(safe)) / safe**2,
    )
    series = (sine, a * half, half, rest)
    s, c, h, r = (jnp.where(slow, x, y) for x, y in zip(series, closed, strict=True))
    return s, c, h, r


class CoordinatedTurn(Motion):
    """Turn at a known constant rate in the horizontal plane, disturbed by white acceleration; state [x, y, vx, vy].

    In 3-D the height moves with nearly constant velocity. Rates that switch: one turn per mode, see
    :class:`SwitchingMotion`.

    Parameters
    ----------
    rate_rad_s
        Turn rate in rad/s, positive to the left; zero is constant velocity.
    intensity
        Power spectral density of the acceleration in m^2/s^3, the same in every direction.
    dim
        2 or 3 position coordinates.

    Raises
    ------
    InputError
        If the rate is not finite, or the intensity negative or not finite.

    Notes
    -----
    With positions and velocities as complex numbers, ``v' = i w v + a``: ``F`` holds ``exp(i w dt)`` and
    ``(exp(i w dt) - 1) / (i w)``, and ``Q`` the integral of their products; Bar-Shalom, Li and Kirubarajan 2001,
    section 11.7, with continuous instead of piecewise constant acceleration.

    Examples
    --------
    A quarter turn in one second:

    >>> turn = CoordinatedTurn(np.pi / 2, 0.1)
    >>> (np.asarray(turn.transition(1.0)) @ [0.0, 0.0, 1.0, 0.0]).round(3).tolist()
    [0.637, 0.637, 0.0, 1.0]
    """

    rate_rad_s: Scalar = eqx.field(converter=float64)
    intensity: Scalar = eqx.field(converter=float64)
    axes: int = eqx.field(static=True)

    def __init__(self, rate_rad_s, intensity, dim: int = 2):
        self.rate_rad_s = rate_rad_s
        self.intensity = intensity
        self.axes = dim

    def __check_init__(self):
        if self.axes not in (2, 3):
            raise InputError(f"motion has {self.axes} dimensions", "Use 2 or 3")
        if not traced(self.rate_rad_s) and not np.all(np.isfinite(self.rate_rad_s)):
            raise InputError(f"turn rate is {self.rate_rad_s} rad/s", "Give a finite number")
        if np.ndim(self.rate_rad_s) or np.ndim(self.intensity):
            raise InputError("a turn has one rate and one intensity", "Give one number each")
        check_intensity(self.intensity, "acceleration intensity")

    @property
    def state_names(self) -> tuple[str, ...]:
        axes = "xyz"[: self.axes]
        return (*(f"{a}_m" for a in axes), *(f"v{a}_m_s" for a in axes))

    @property
    def position_index(self) -> tuple[int, ...]:
        return tuple(range(self.axes))

    def _matrix(self, blocks: list[list[tuple[Scalar, Scalar, Scalar]]]) -> Float[Array, "state state"]:
        """From (real, imaginary, vertical) parts of every block: complex numbers as rotations of the plane."""

        def block(real, imaginary, vertical):
            plane = jnp.array([[real, -imaginary], [imaginary, real]])
            if self.axes == 2:
                return plane
            return jnp.zeros((3, 3)).at[:2, :2].set(plane).at[2, 2].set(vertical)

        return jnp.block([[block(*parts) for parts in row] for row in blocks])

    def transition(self, dt: Scalar) -> Float[Array, "state state"]:
        angle = self.rate_rad_s * dt
        sine, cosine, _, _ = _turned(angle)
        moved = (dt * sine, dt * cosine, dt)
        return self._matrix([[(1.0, 0.0, 1.0), moved], [(0.0, 0.0, 0.0), (jnp.cos(angle), jnp.sin(angle), 1.0)]])

    def covariance(self, dt: Scalar) -> Float[Array, "state state"]:
        angle, q = self.rate_rad_s * dt, self.intensity
        _, _, half, rest = _turned(angle)
        # (a - sin a)/a^3 as the angle goes to zero is 1/6
        small = jnp.abs(angle) < SLOW
        cubic = jnp.where(small, 1 / 6 - angle**2 / 120 + angle**4 / 5040, rest / jnp.where(small, 1.0, angle))
        pp = (2 * q * dt**3 * cubic, 0.0, q * dt**3 / 3)
        pv = (q * dt**2 * half, -q * dt**2 * rest, q * dt**2 / 2)
        vp = (q * dt**2 * half, q * dt**2 * rest, q * dt**2 / 2)
        return self._matrix([[pp, pv], [vp, (q * dt, 0.0, q * dt)]])
