"""Step teleoperation where velocities are commanded."""

from poise.locomotion._stepping._by_velocity._velocity_level import (
    ComDriver,
    VelocityLevel,
    check_sway,
)
from poise.locomotion._stepping._by_velocity._velocity_tasks import velocity_numbers

__all__ = ["ComDriver", "VelocityLevel", "check_sway", "velocity_numbers"]
