"""Checks of models, bounds and filters of one's own: each call raises one error that lists everything that is wrong."""

from locbounds.testing.bound import check_bound
from locbounds.testing.filter import check_filter
from locbounds.testing.measurement import check_measurement
from locbounds.testing.motion import check_motion
from locbounds.testing.noise import check_noise
from locbounds.testing.suite import Nonconforming

__all__ = [
    "Nonconforming",
    "check_bound",
    "check_filter",
    "check_measurement",
    "check_motion",
    "check_noise",
]
