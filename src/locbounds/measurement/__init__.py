"""What an anchor measures of the mobile's position."""

from locbounds.measurement.by_sight import BySight
from locbounds.measurement.range import Range

__all__ = ["BySight", "Range"]
