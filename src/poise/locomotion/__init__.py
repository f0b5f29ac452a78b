"""Balance on the cart-flywheel-table: where the COM goes so that the ZMP goes elsewhere."""

from poise.locomotion._pendulum import (
    BodyRotator as BodyRotator,
    ComShifter,
    natural_frequency as natural_frequency,
    pole_zero_damping as pole_zero_damping,
)
from poise.locomotion._preview import PreviewControl
from poise.locomotion._stepping import (
    ComDriver as ComDriver,
    Device,
    DeviceSample,
    DeviceStatus as DeviceStatus,
    Mode,
    RecordedDevice as RecordedDevice,
    RecordedPush as RecordedPush,
    Recording as Recording,
    RecordingError as RecordingError,
    RecordingWriter as RecordingWriter,
    RowKind as RowKind,
    ScriptedDevice,
    StepTeleoperator,
    TeleopParameters,
    TeleopStatus,
    WayPoint,
    draw_modes as draw_modes,
    read_recording as read_recording,
)
from poise.locomotion._support import (
    SupportPolygon as SupportPolygon,
    convex_hull as convex_hull,
    signed_margin as signed_margin,
    sole_rectangle as sole_rectangle,
)
from poise.locomotion._walking import (
    CarriedTarget as CarriedTarget,
    FootstepPlan,
    Gait,
    Ground,
    ReactiveWalker,
    Stride,
    VelocityLimits,
    Walker,
    WalkSettings,
    plan_footsteps,
    walking_stack,
)

__all__ = [
    "ComShifter",
    "Device",
    "DeviceSample",
    "FootstepPlan",
    "Gait",
    "Ground",
    "Mode",
    "PreviewControl",
    "ReactiveWalker",
    "ScriptedDevice",
    "StepTeleoperator",
    "Stride",
    "TeleopParameters",
    "TeleopStatus",
    "VelocityLimits",
    "WalkSettings",
    "Walker",
    "WayPoint",
    "plan_footsteps",
    "walking_stack",
]
