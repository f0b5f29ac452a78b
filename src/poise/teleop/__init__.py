"""A person's hands on the robot's feet: step-by-step teleoperation of bipeds."""

from poise.teleop.device import DeviceGuard, DeviceSample, DeviceStatus
from poise.teleop.modes import Event, Mode, draw_modes
from poise.teleop.parameters import TeleopParameters, scaled_parameters
from poise.teleop.rules import PAPER_RULES, Rules
from poise.teleop.step_teleoperator import StepTeleoperator, TeleopStatus

__all__ = [
    "PAPER_RULES",
    "DeviceGuard",
    "DeviceSample",
    "DeviceStatus",
    "Event",
    "Mode",
    "Rules",
    "StepTeleoperator",
    "TeleopParameters",
    "TeleopStatus",
    "draw_modes",
    "scaled_parameters",
]
