"""A person leads the robot's feet: step-by-step teleoperation of bipeds."""

from poise.locomotion._stepping._by_torque import FOOT_TURNS
from poise.locomotion._stepping._by_velocity import ComDriver, ShifterDriver
from poise.locomotion._stepping._operator import (
    BodySample,
    Device,
    DeviceGuard,
    DeviceSample,
    DeviceStatus,
    FaultLog,
    FieldError,
    HandSample,
    HeadSample,
    Lateness,
    ScriptedDevice,
    WayPoint,
    checked_reading,
    rotation_of,
)
from poise.locomotion._stepping._scaling import teleop_parameters
from poise.locomotion._stepping._stance import (
    TORSO_MOST,
    Mode,
    ModeEvent,
    StepEnd,
    TeleopParameters,
    draw_modes,
    yaw_of,
)
from poise.locomotion._stepping._step_teleoperator import StepTeleoperator
from poise.locomotion._stepping._teleop_status import TeleopStatus
from poise.locomotion._stepping._tracked_feet import (
    FootClutch,
    TrackedFeet,
    along_ahead,
    rest_place,
)
from poise.locomotion._stepping._upper_body import GazeLeader, HandLeader, HandStatus

__all__ = [
    "FOOT_TURNS",
    "TORSO_MOST",
    "BodySample",
    "ComDriver",
    "Device",
    "DeviceGuard",
    "DeviceSample",
    "DeviceStatus",
    "FaultLog",
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
    "rest_place",
    "rotation_of",
    "teleop_parameters",
    "yaw_of",
]
