"""Step teleoperation where velocities are commanded."""

from poise.locomotion._stepping._by_velocity._com_motion import ComDriver, ShifterDriver
from poise.locomotion._stepping._by_velocity._velocity_level import VelocityLevel, check_sway
from poise.locomotion._stepping._by_velocity._velocity_tasks import velocity_numbers

__all__ = ["ComDriver", "ShifterDriver", "VelocityLevel", "check_sway", "velocity_numbers"]
