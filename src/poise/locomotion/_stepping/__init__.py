"""A person leads the robot's feet: step-by-step teleoperation of bipeds."""

from poise.locomotion._stepping._com_motion import ComDriver, ShifterDriver
from poise.locomotion._stepping._device import Device, ScriptedDevice, WayPoint
from poise.locomotion._stepping._fields import FieldError
from poise.locomotion._stepping._footing import yaw_of
from poise.locomotion._stepping._gaze import GazeLeader
from poise.locomotion._stepping._grips import rotation_of
from poise.locomotion._stepping._guard import DeviceGuard
from poise.locomotion._stepping._hands import HandLeader, HandStatus
from poise.locomotion._stepping._lean import TORSO_MOST
from poise.locomotion._stepping._modes import Mode, ModeEvent, StepEnd, draw_modes
from poise.locomotion._stepping._parameters import TeleopParameters
from poise.locomotion._stepping._recording import (
    RecordedDevice,
    RecordedPush,
    Recording,
    RecordingWriter,
    read_recording,
)
from poise.locomotion._stepping._recording_format import RecordingError
from poise.locomotion._stepping._sample_clock import Lateness
from poise.locomotion._stepping._samples import (
    BodySample,
    DeviceSample,
    DeviceStatus,
    HandSample,
    HeadSample,
    checked_reading,
)
from poise.locomotion._stepping._scaling import teleop_parameters
from poise.locomotion._stepping._step_teleoperator import StepTeleoperator
from poise.locomotion._stepping._teleop_status import TeleopStatus
from poise.locomotion._stepping._torque_tasks import FOOT_TURNS
from poise.locomotion._stepping._tracked_feet import (
    FootClutch,
    TrackedFeet,
    along_ahead,
    rest_place,
)

__all__ = [
    "FOOT_TURNS",
    "TORSO_MOST",
    "BodySample",
    "ComDriver",
    "Device",
    "DeviceGuard",
    "DeviceSample",
    "DeviceStatus",
    "FieldError",
    "FootClutch",
    "GazeLeader",
    "HandLeader",
    "HandSample",
    "HandStatus",
    "HeadSample",
    "Lateness",
    "Mode",
    "ModeEvent",
    "RecordedDevice",
    "RecordedPush",
    "Recording",
    "RecordingError",
    "RecordingWriter",
    "ScriptedDevice",
    "ShifterDriver",
    "StepEnd",
    "StepTeleoperator",
    "TeleopParameters",
    "TeleopStatus",
    "TrackedFeet",
    "WayPoint",
    "along_ahead",
    "checked_reading",
    "draw_modes",
    "read_recording",
    "rest_place",
    "rotation_of",
    "teleop_parameters",
    "yaw_of",
]
