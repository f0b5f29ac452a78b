"""A person leads the robot's feet: step-by-step teleoperation of bipeds."""

from poise.locomotion._stepping._by_velocity import ComDriver as ComDriver
from poise.locomotion._stepping._feet import FOOT_TURNS as FOOT_TURNS
from poise.locomotion._stepping._operator import (
    LATE as LATE,
    LOST_AFTER as LOST_AFTER,
    SILENT_AFTER as SILENT_AFTER,
    BodyCommand as BodyCommand,
    Device as Device,
    DeviceStatus as DeviceStatus,
    FieldError as FieldError,
    OperatorGuard as OperatorGuard,
    OperatorSample as OperatorSample,
    SampleClock as SampleClock,
    ScriptedDevice as ScriptedDevice,
    TrackedPose as TrackedPose,
    Vector as Vector,
    WarnOnce as WarnOnce,
    WayPoint as WayPoint,
    checked_reading as checked_reading,
    rotation_of as rotation_of,
)
from poise.locomotion._stepping._stance import (
    TORSO_MOST as TORSO_MOST,
    TeleopParameters as TeleopParameters,
    teleop_parameters as teleop_parameters,
)
from poise.locomotion._stepping._step_teleoperator import (
    StepTeleoperator as StepTeleoperator,
    TeleopStatus as TeleopStatus,
)
from poise.locomotion._stepping._tracked_feet import (
    FootTracker as FootTracker,
    TrackedFeet as TrackedFeet,
    along_ahead as along_ahead,
    rest_place as rest_place,
)
from poise.locomotion._stepping._upper_body import (
    GazeLeader as GazeLeader,
    HandLeader as HandLeader,
    HandStatus as HandStatus,
)
