"""Range differences: time differences of arrival times the speed of light."""

from typing import ClassVar

import equinox as eqx
import numpy as np

from locbounds.axes import Array, Float, Scalar
from locbounds.errors import InputError
from locbounds.measurement.base import Measurement, check_anchor, distance, far
from locbounds.precision import float64, traced


class RangeDifference(Measurement):
    """Distance to an anchor minus the distance to a reference anchor.

    Parameters
    ----------
    anchor
        Position of the anchor in metres, [space].
    reference
        Position of the reference anchor in metres, [space].

    Raises
    ------
    InputError
        If a position is not 2 or 3 finite numbers, or both anchors are at the same place.

    Notes
    -----
    Derivatives are taken as zero for the part of the anchor at which the mobile is.

    Examples
    --------
    >>> float(RangeDifference([6.0, 0.0], reference=[0.0, 0.0])(np.array([3.0, 4.0])))
    0.0
    """

    anchor: Float[Array, " space"] = eqx.field(converter=float64)
    reference: Float[Array, " space"] = eqx.field(converter=float64)
    size: ClassVar[int] = 1
    unit: ClassVar[str] = "m"

    def __check_init__(self):
        if traced(self.anchor, self.reference):
            return
        check_anchor(self.anchor)
        check_anchor(self.reference, "reference anchor", (len(self.anchor),))
        if np.array_equal(self.anchor, self.reference):
            raise InputError(
                f"the anchor and its reference are both at {self.anchor.tolist()}", "Give two different positions"
            )

    @property
    def dim(self) -> int:
        return len(self.anchor)

    def __call__(self, position: Float[Array, " space"]) -> Scalar:
        return distance(position, self.anchor) - distance(position, self.reference)

    def singular(self, points: Float[Array, "points space"]) -> Float[Array, " points"]:
        return np.minimum(far(points, self.anchor), far(points, self.reference))
