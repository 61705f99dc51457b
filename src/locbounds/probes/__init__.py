"""What can be found out numerically about a function that somebody wrote: where it jumps, where it is too steep."""

from locbounds.probes.jumps import find_jump
from locbounds.probes.memory import once
from locbounds.probes.steepness import Steep, steepest

__all__ = ["Steep", "find_jump", "once", "steepest"]
