"""What an anchor measures of the mobile's position."""

from locbounds.measurement.range import Range

__all__ = ["Range"]
