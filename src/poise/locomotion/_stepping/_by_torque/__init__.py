"""Step teleoperation where torques are commanded."""

from poise.locomotion._stepping._by_torque._torque_level import TorqueLevel
from poise.locomotion._stepping._by_torque._torque_tasks import POSTURE_WEIGHT

__all__ = ["POSTURE_WEIGHT", "TorqueLevel"]
