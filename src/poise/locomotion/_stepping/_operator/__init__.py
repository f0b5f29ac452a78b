"""What the operator's devices say: samples, whether to believe them, and their recordings."""

from poise.locomotion._stepping._operator._device import Device, DeviceReader
from poise.locomotion._stepping._operator._faults import FaultLog
from poise.locomotion._stepping._operator._fields import FieldError
from poise.locomotion._stepping._operator._grips import (
    LATE,
    LOST_AFTER,
    Clutch,
    HandGrip,
    HeadGrip,
    TurnPursuit,
    rotation_of,
)
from poise.locomotion._stepping._operator._guard import DeviceGuard
from poise.locomotion._stepping._operator._pursuit import is_point
from poise.locomotion._stepping._operator._sample_clock import Lateness, SampleClock
from poise.locomotion._stepping._operator._samples import (
    BodySample,
    DeviceSample,
    DeviceStatus,
    HandSample,
    HeadSample,
    checked_reading,
    checked_tracker,
)
from poise.locomotion._stepping._operator._scripted_device import ScriptedDevice, WayPoint

__all__ = [
    "LATE",
    "LOST_AFTER",
    "BodySample",
    "Clutch",
    "Device",
    "DeviceGuard",
    "DeviceReader",
    "DeviceSample",
    "DeviceStatus",
    "FaultLog",
    "FieldError",
    "HandGrip",
    "HandSample",
    "HeadGrip",
    "HeadSample",
    "Lateness",
    "SampleClock",
    "ScriptedDevice",
    "TurnPursuit",
    "WayPoint",
    "checked_reading",
    "checked_tracker",
    "is_point",
    "rotation_of",
]
