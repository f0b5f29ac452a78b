"""Samples of an operator, the guard that they pass, and their recordings."""

from poise.locomotion._stepping._operator._fields import FieldError, checked_reading, checked_sample
from poise.locomotion._stepping._operator._guard import DeviceStatus, OperatorGuard
from poise.locomotion._stepping._operator._limits import LATE, LOST_AFTER, SILENT_AFTER
from poise.locomotion._stepping._operator._sample import (
    BodyCommand,
    Device,
    OperatorSample,
    TrackedPose,
    Vector,
)
from poise.locomotion._stepping._operator._sample_clock import SampleClock
from poise.locomotion._stepping._operator._scripted_device import ScriptedDevice, WayPoint
from poise.locomotion._stepping._operator._tracking import (
    Engagement,
    RateLimiter,
    Rotation,
    Tracker,
    rotation_of,
)
from poise.locomotion._stepping._operator._warn_once import WarnOnce

__all__ = [
    "LATE",
    "LOST_AFTER",
    "SILENT_AFTER",
    "BodyCommand",
    "Device",
    "DeviceStatus",
    "Engagement",
    "FieldError",
    "OperatorGuard",
    "OperatorSample",
    "RateLimiter",
    "Rotation",
    "SampleClock",
    "ScriptedDevice",
    "TrackedPose",
    "Tracker",
    "Vector",
    "WarnOnce",
    "WayPoint",
    "checked_reading",
    "checked_sample",
    "rotation_of",
]
