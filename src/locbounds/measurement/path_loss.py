"""Path loss: received signal strength of a transmitter of known power."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.measurement.base import TINY_M, Measurement, check_anchor, distance, far
from locbounds.precision import float64, traced


class PathLoss(Measurement):
    """Path loss ``10 exponent log10(distance)`` in dB; constants (transmit power, frequency) carry no information.

    Parameters
    ----------
    anchor
        Position of the anchor in metres, [space].
    exponent
        Path loss exponent alpha: 2 in free space, 2 to 4 in built-up areas.
    near_field_m
        Radius below which the path loss no longer depends on distance. None: there is no such radius, and the expected
        information of a mobile that may come to the anchor is infinite.

    Raises
    ------
    InputError
        If the position is not 2 or 3 finite numbers, the exponent or the radius not positive.

    Notes
    -----
    Within the near field, and at the anchor itself (where the value is that of a nanometre's distance), the derivative
    is zero.

    Examples
    --------
    >>> float(PathLoss([0.0, 0.0], exponent=3.0)(np.array([0.0, 100.0])))
    60.0
    """

    anchor: Float[Array, " space"] = eqx.field(converter=float64)
    exponent: Scalar = eqx.field(converter=float64, default=3.0)
    near_field_m: Scalar | None = eqx.field(converter=float64, default=None)
    size: ClassVar[int] = 1
    unit: ClassVar[str] = "dB"

    def __check_init__(self):
        if traced(self.anchor, self.exponent, self.near_field_m):
            return
        check_anchor(self.anchor)
        if not (np.shape(self.exponent) == () and np.isfinite(self.exponent) and self.exponent > 0):
            raise InputError(f"the path loss exponent is {self.exponent}", "Give a positive number, for example 3")
        near = self.near_field_m
        if near is not None and not (np.shape(near) == () and np.isfinite(near) and near > 0):
            raise InputError(f"the near-field radius is {near} m", "Give a positive number of metres, or leave it out")

    @property
    def dim(self) -> int:
        return len(self.anchor)

    def __call__(self, position: Float[Array, " space"]) -> Scalar:
        d, near = distance(position, self.anchor), TINY_M if self.near_field_m is None else self.near_field_m
        beyond = d > near
        return 10.0 * self.exponent / np.log(10.0) * jnp.log(jnp.where(beyond, d, near))

    def singular(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        d = far(points, self.anchor)
        return d if self.near_field_m is None else np.abs(d - self.near_field_m)
