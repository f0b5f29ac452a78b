"""A person's hands on the robot's feet: step-by-step teleoperation of bipeds."""

from poise.teleop.com_driver import ComDriver, PreviewDriver, ShifterDriver
from poise.teleop.device import DeviceGuard, DeviceSample, DeviceStatus
from poise.teleop.modes import Event, Mode, draw_modes
from poise.teleop.parameters import TeleopParameters, scaled_parameters
from poise.teleop.recording import RecordedDevice, Recording, read_recording
from poise.teleop.recording_format import RecordingError
from poise.teleop.recording_writer import RecordingWriter
from poise.teleop.rules import PAPER_RULES, Rules
from poise.teleop.scripted import Device, ScriptedDevice, WayPoint
from poise.teleop.status import TeleopStatus
from poise.teleop.step_teleoperator import StepTeleoperator

__all__ = [
    "PAPER_RULES",
    "ComDriver",
    "Device",
    "DeviceGuard",
    "DeviceSample",
    "DeviceStatus",
    "Event",
    "Mode",
    "PreviewDriver",
    "RecordedDevice",
    "Recording",
    "RecordingError",
    "RecordingWriter",
    "Rules",
    "ScriptedDevice",
    "ShifterDriver",
    "StepTeleoperator",
    "TeleopParameters",
    "TeleopStatus",
    "WayPoint",
    "draw_modes",
    "read_recording",
    "scaled_parameters",
]
