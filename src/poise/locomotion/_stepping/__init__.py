"""A person leads the robot's feet: step-by-step teleoperation of bipeds."""

from poise.locomotion._stepping._by_velocity import ComDriver, ShifterDriver
from poise.locomotion._stepping._feet import FOOT_TURNS
from poise.locomotion._stepping._operator import (
    LATE,
    LOST_AFTER,
    SILENT_AFTER,
    BodyCommand,
    Device,
    DeviceStatus,
    FieldError,
    OperatorGuard,
    OperatorSample,
    SampleClock,
    ScriptedDevice,
    TrackedPose,
    Vector,
    WarnOnce,
    WayPoint,
    checked_reading,
    rotation_of,
)
from poise.locomotion._stepping._stance import (
    TORSO_MOST,
    TeleopParameters,
    teleop_parameters,
)
from poise.locomotion._stepping._step_teleoperator import StepTeleoperator
from poise.locomotion._stepping._teleop_status import TeleopStatus
from poise.locomotion._stepping._tracked_feet import (
    FootTracker,
    TrackedFeet,
    along_ahead,
    rest_place,
)
from poise.locomotion._stepping._upper_body import GazeLeader, HandLeader, HandStatus

__all__ = [
    "FOOT_TURNS",
    "LATE",
    "LOST_AFTER",
    "SILENT_AFTER",
    "TORSO_MOST",
    "BodyCommand",
    "ComDriver",
    "Device",
    "DeviceStatus",
    "FieldError",
    "FootTracker",
    "GazeLeader",
    "HandLeader",
    "HandStatus",
    "OperatorGuard",
    "OperatorSample",
    "SampleClock",
    "ScriptedDevice",
    "ShifterDriver",
    "StepTeleoperator",
    "TeleopParameters",
    "TeleopStatus",
    "TrackedFeet",
    "TrackedPose",
    "Vector",
    "WarnOnce",
    "WayPoint",
    "along_ahead",
    "checked_reading",
    "rest_place",
    "rotation_of",
    "teleop_parameters",
]
