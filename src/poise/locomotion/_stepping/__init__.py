"""A person leads the robot's feet: step-by-step teleoperation of bipeds."""

from poise.locomotion._stepping._com import ComDriver, ShifterDriver
from poise.locomotion._stepping._device import (
    Device,
    DeviceGuard,
    DeviceSample,
    DeviceStatus,
    ScriptedDevice,
    WayPoint,
)
from poise.locomotion._stepping._modes import Mode, ModeEvent, draw_modes
from poise.locomotion._stepping._parameters import TeleopParameters, scaled_parameters
from poise.locomotion._stepping._recording import (
    RecordedDevice,
    RecordedPush,
    Recording,
    RecordingError,
    RecordingWriter,
    RowKind,
    read_recording,
)
from poise.locomotion._stepping._step_teleoperator import StepTeleoperator, TeleopStatus

__all__ = [
    "ComDriver",
    "Device",
    "DeviceGuard",
    "DeviceSample",
    "DeviceStatus",
    "Mode",
    "ModeEvent",
    "RecordedDevice",
    "RecordedPush",
    "Recording",
    "RecordingError",
    "RecordingWriter",
    "RowKind",
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
