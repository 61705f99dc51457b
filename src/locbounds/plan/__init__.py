"""Plans: what is measured at a static position, with which noise and prior knowledge."""

from locbounds.plan.observations import Observations, soft
from locbounds.plan.plan import FLAT, Plan
from locbounds.plan.short import aoa, observe, rss, tdoa, toa

__all__ = ["FLAT", "Observations", "Plan", "aoa", "observe", "rss", "soft", "tdoa", "toa"]
