"""What is known of a measurement by its kind, without computing: whether it jumps, and where it is infinitely steep."""

from typing import Any, NamedTuple

import numpy as np

from locbounds.axes import ndarray
from locbounds.measurement.bearing import Bearing, Elevation
from locbounds.measurement.path_loss import PathLoss
from locbounds.measurement.range import Range
from locbounds.measurement.range_difference import RangeDifference

Anchored = Range | RangeDifference | Bearing | Elevation | PathLoss  # what has an anchor, and may be a link
KNOWN = (Range, RangeDifference, Bearing, Elevation, PathLoss)


def kind(measurement: Any) -> type | None:
    """The class of this library that says what a measurement is, or None if its function is somebody's own.

    >>> class Named(Range):
    ...     unit = "km"
    >>> class Rounded(Range):
    ...     def __call__(self, position):
    ...         return super().__call__(position).round()
    >>> [kind(of([0.0, 0.0])) for of in (Named, Rounded)]
    [<class 'locbounds.measurement.range.Range'>, None]
    """
    return next((k for k in KNOWN if type(measurement).__call__ is k.__call__), None)


def is_own(measurement: Any) -> bool:
    """Whether nothing is known of a measurement: no kind, and it does not say itself whether it is ``continuous``."""
    return kind(measurement) is None and not hasattr(measurement, "continuous")


class Pole(NamedTuple):
    """Where a measurement's slope grows like 1/r.

    Attributes
    ----------
    what
        The quantity, in words.
    place
        An anchor, [space].
    vertical
        Whether the slope does so on the whole vertical through it (in three dimensions).
    """

    what: str
    place: ndarray
    vertical: bool


def pole(measurement: Any) -> Pole | None:
    """The pole of a measurement of a known kind, or None if its slope is bounded.

    Of a bearing the slope is 1/rho, rho the horizontal distance; of an elevation and of a path loss without a near
    field it is 1/r. ``E[1/r^2]`` over a positive density is infinite where r is the distance from a set of codimension
    one or two.

    >>> pole(Range([0.0, 0.0])) is None, pole(Bearing([0.0, 0.0, 1.0])).vertical
    (True, True)
    """
    of = kind(measurement)
    if of is Bearing:
        return Pole("angle", np.asarray(measurement.anchor), True)
    if of is Elevation:
        return Pole("angle", np.asarray(measurement.anchor), False)
    if of is PathLoss and measurement.near_field_m is None:
        return Pole("strength", np.asarray(measurement.anchor), False)
    return None
