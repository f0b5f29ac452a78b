"""Samples of an operator, and the guard that they pass."""

from poise.locomotion._stepping._operator._fields import (
    FieldError as FieldError,
    WarnOnce as WarnOnce,
    checked_reading as checked_reading,
    checked_sample as checked_sample,
)
from poise.locomotion._stepping._operator._guard import (
    DeviceStatus as DeviceStatus,
    OperatorGuard as OperatorGuard,
)
from poise.locomotion._stepping._operator._sample import (
    BodyCommand as BodyCommand,
    Device as Device,
    OperatorSample as OperatorSample,
    TrackedPose as TrackedPose,
    Vector as Vector,
)
from poise.locomotion._stepping._operator._sample_clock import (
    LATE as LATE,
    LOST_AFTER as LOST_AFTER,
    SILENT_AFTER as SILENT_AFTER,
    Engagement as Engagement,
    SampleClock as SampleClock,
)
from poise.locomotion._stepping._operator._scripted_device import (
    ScriptedDevice as ScriptedDevice,
    WayPoint as WayPoint,
)
from poise.locomotion._stepping._operator._tracking import (
    RateLimiter as RateLimiter,
    Rotation as Rotation,
    Tracker as Tracker,
    rotation_of as rotation_of,
)
