"""Angles of arrival: bearings (azimuths) and elevations."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.measurement.base import Measurement, check_anchor, distance, far
from locbounds.precision import float64


class Bearing(Measurement):
    """Angle of the direction from an anchor to the mobile, in radians from the x-axis; in 3-D the azimuth.

    Parameters
    ----------
    anchor
        Position of the anchor in metres, [space] with 2 or 3 coordinates.

    Raises
    ------
    InputError
        If the position is not 2 or 3 finite numbers.

    Notes
    -----
    Periodic: differences are wrapped into (-pi, pi], so that the branch cut carries no information. At the anchor (in
    3-D on the vertical through it) the derivative is zero.

    Examples
    --------
    >>> float(Bearing([0.0, 0.0])(np.array([0.0, 2.0])) / np.pi)
    0.5
    """

    anchor: Float[Array, " space"] = eqx.field(converter=float64)
    size: ClassVar[int] = 1
    unit: ClassVar[str] = "rad"
    periodic: ClassVar[bool] = True

    def __check_init__(self):
        check_anchor(self.anchor)

    @property
    def dim(self) -> int:
        return len(self.anchor)

    def __call__(self, position: Float[Array, " space"]) -> Scalar:
        dx, dy = position[..., 0] - self.anchor[..., 0], position[..., 1] - self.anchor[..., 1]
        somewhere = (dx != 0) | (dy != 0)
        return jnp.where(somewhere, jnp.arctan2(dy, jnp.where(somewhere, dx, 1.0)), 0.0)

    def singular(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        return far(points[..., :2], self.anchor[:2])


class Elevation(Measurement):
    """Angle of the direction from an anchor to the mobile above the horizontal plane, in radians; 3-D only.

    Parameters
    ----------
    anchor
        Position of the anchor in metres, [3].

    Raises
    ------
    InputError
        If the position is not 3 finite numbers.

    Notes
    -----
    On the vertical through the anchor the derivative is zero.

    Examples
    --------
    >>> float(Elevation([0.0, 0.0, 0.0])(np.array([3.0, 4.0, 5.0])) / np.pi)
    0.25
    """

    anchor: Float[Array, " 3"] = eqx.field(converter=float64)
    size: ClassVar[int] = 1
    unit: ClassVar[str] = "rad"

    def __check_init__(self):
        check_anchor(self.anchor, dims=(3,))

    @property
    def dim(self) -> int:
        return 3

    def __call__(self, position: Float[Array, " space"]) -> Scalar:
        level = distance(position[..., :2], self.anchor[..., :2])
        height = position[..., 2] - self.anchor[..., 2]
        return jnp.where(
            level > 0, jnp.arctan2(height, jnp.where(level > 0, level, 1.0)), 0.5 * np.pi * jnp.sign(height)
        )

    def singular(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        return far(points[..., :2], self.anchor[:2])
