"""How the mobile moves."""

from locbounds.motion.base import Motion
from locbounds.motion.constant_velocity import ConstantVelocity

__all__ = ["ConstantVelocity", "Motion"]
