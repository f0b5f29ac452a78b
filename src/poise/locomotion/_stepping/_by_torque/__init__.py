"""What leads body and feet where torques are commanded."""

from poise.locomotion._stepping._by_torque._com_feedback import ComFeedback
from poise.locomotion._stepping._by_torque._own_steps import OwnSteps
from poise.locomotion._stepping._by_torque._torque_tasks import (
    FOOT_TURNS,
    POSTURE_WEIGHT,
    TorqueTasks,
)

__all__ = [
    "FOOT_TURNS",
    "POSTURE_WEIGHT",
    "ComFeedback",
    "OwnSteps",
    "TorqueTasks",
]
