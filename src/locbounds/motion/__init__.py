"""How the mobile moves."""

from locbounds.motion.base import Motion
from locbounds.motion.constant_acceleration import ConstantAcceleration
from locbounds.motion.constant_velocity import ConstantVelocity
from locbounds.motion.coordinated_turn import CoordinatedTurn
from locbounds.motion.linear import LinearMotion
from locbounds.motion.random_walk import RandomWalk
from locbounds.motion.switching import SwitchingMotion

__all__ = [
    "ConstantAcceleration",
    "ConstantVelocity",
    "CoordinatedTurn",
    "LinearMotion",
    "Motion",
    "RandomWalk",
    "SwitchingMotion",
]
