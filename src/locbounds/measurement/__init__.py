"""What an anchor measures of the mobile's position."""

from locbounds.measurement.base import Measurement
from locbounds.measurement.bearing import Bearing, Elevation
from locbounds.measurement.by_sight import BySight
from locbounds.measurement.function import Function
from locbounds.measurement.nature import Anchored, Pole, is_own, pole
from locbounds.measurement.path_loss import PathLoss
from locbounds.measurement.range import Range
from locbounds.measurement.range_difference import RangeDifference

__all__ = [
    "Anchored",
    "Bearing",
    "BySight",
    "Elevation",
    "Function",
    "Measurement",
    "PathLoss",
    "Pole",
    "Range",
    "RangeDifference",
    "is_own",
    "pole",
]
