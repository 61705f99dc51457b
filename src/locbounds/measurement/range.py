"""Ranges: distance to one anchor (time of arrival times the speed of light, round trips halved)."""

from typing import ClassVar

import equinox as eqx

from locbounds.axes import Array, Float, Scalar
from locbounds.measurement.base import Measurement, check_anchor, distance, far
from locbounds.precision import float64


class Range(Measurement):
    """Distance to an anchor.

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
    At the anchor itself the range has no gradient; there the gradient is defined as zero (no direction, no
    information), so that no NaN arises.

    Examples
    --------
    >>> import numpy as np
    >>> float(Range([0.0, 0.0])(np.array([3.0, 4.0])))
    5.0
    """

    anchor: Float[Array, " space"] = eqx.field(converter=float64)
    unit: ClassVar[str] = "m"
    clocked: ClassVar[bool] = True

    def __check_init__(self):
        check_anchor(self.anchor)

    @property
    def dim(self) -> int:
        return len(self.anchor)

    def __call__(self, position: Float[Array, " space"]) -> Scalar:
        return distance(position, self.anchor)

    def singular(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        return far(points, self.anchor)
