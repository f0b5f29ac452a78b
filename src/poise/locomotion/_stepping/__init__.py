"""Step-by-step teleoperation of bipeds: an operator moves the feet."""

from poise.locomotion._stepping._biped import (
    TeleopParameters as TeleopParameters,
    teleop_parameters as teleop_parameters,
)
from poise.locomotion._stepping._devices import (
    FootTracker as FootTracker,
    ScriptedDevice as ScriptedDevice,
    TrackedFeet as TrackedFeet,
    WayPoint as WayPoint,
    along_ahead as along_ahead,
    rest_place as rest_place,
)
from poise.locomotion._stepping._feet import FOOT_TURNS as FOOT_TURNS
from poise.locomotion._stepping._footing import TORSO_MOST as TORSO_MOST
from poise.locomotion._stepping._guard import (
    LATE as LATE,
    LOST_AFTER as LOST_AFTER,
    SILENT_AFTER as SILENT_AFTER,
    DeviceStatus as DeviceStatus,
    OperatorGuard as OperatorGuard,
    SampleClock as SampleClock,
    rotation_of as rotation_of,
)
from poise.locomotion._stepping._hands import (
    GazeLeader as GazeLeader,
    HandLeader as HandLeader,
    HandStatus as HandStatus,
)
from poise.locomotion._stepping._limbs import Goal as Goal
from poise.locomotion._stepping._sample import (
    BodyCommand as BodyCommand,
    Device as Device,
    FieldError as FieldError,
    OperatorSample as OperatorSample,
    TrackedPose as TrackedPose,
    Vector as Vector,
    WarnOnce as WarnOnce,
    checked_reading as checked_reading,
)
from poise.locomotion._stepping._step_teleoperator import (
    StepTeleoperator as StepTeleoperator,
    TeleopStatus as TeleopStatus,
)
from poise.locomotion._stepping._velocity_level import ComDriver as ComDriver
