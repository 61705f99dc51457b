"""The sight condition of a link over time: LOS (mode 0) or NLOS (mode 1)."""

from locbounds.sight.base import Sight
from locbounds.sight.dwell import DwellSight
from locbounds.sight.known import KnownSight
from locbounds.sight.markov import MarkovSight

__all__ = ["DwellSight", "KnownSight", "MarkovSight", "Sight"]
