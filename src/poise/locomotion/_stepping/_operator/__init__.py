"""Samples of an operator, and the guard that they pass."""

from poise.locomotion._stepping._operator._guard import (
    LATE as LATE,
    LOST_AFTER as LOST_AFTER,
    SILENT_AFTER as SILENT_AFTER,
    DeviceStatus as DeviceStatus,
    Engagement as Engagement,
    OperatorGuard as OperatorGuard,
    RateLimiter as RateLimiter,
    Rotation as Rotation,
    SampleClock as SampleClock,
    Tracker as Tracker,
    rotation_of as rotation_of,
)
from poise.locomotion._stepping._operator._sample import (
    NOWHERE as NOWHERE,
    BodyCommand as BodyCommand,
    Device as Device,
    FieldError as FieldError,
    OperatorSample as OperatorSample,
    TrackedPose as TrackedPose,
    Vector as Vector,
    WarnOnce as WarnOnce,
    checked_reading as checked_reading,
    checked_sample as checked_sample,
)
from poise.locomotion._stepping._operator._scripted_device import (
    ScriptedDevice as ScriptedDevice,
    WayPoint as WayPoint,
)
