"""What leads body and feet where velocities are commanded."""

from poise.locomotion._stepping._by_velocity._body_momentum import BodyMomentum
from poise.locomotion._stepping._by_velocity._com_motion import ComDriver, ComMotion, ShifterDriver
from poise.locomotion._stepping._by_velocity._sway import check_sway
from poise.locomotion._stepping._by_velocity._velocity_tasks import VelocityTasks

__all__ = [
    "BodyMomentum",
    "ComDriver",
    "ComMotion",
    "ShifterDriver",
    "VelocityTasks",
    "check_sway",
]
