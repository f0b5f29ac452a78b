"""Step teleoperation in simulation: scripted and recorded foot devices, and their records."""

from poise.apps.teleoperation._haptics import (
    HapticArm,
    HapticDriver,
    HapticFeet,
    SimulatedArm,
    foot_forces as foot_forces,
)
from poise.apps.teleoperation._operators import BadOperator, PoorLink
from poise.apps.teleoperation._recording import (
    RecordedDevice as RecordedDevice,
    RecordedPush as RecordedPush,
    Recording as Recording,
    RecordingError as RecordingError,
    TeleopRecorder as TeleopRecorder,
    TeleopSetup as TeleopSetup,
    plant_from_json as plant_from_json,
    read_recording as read_recording,
    recorded_robot as recorded_robot,
    write_recording as write_recording,
)
from poise.apps.teleoperation._run import (
    MODES as MODES,
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    TeleopLog,
    TeleopRun,
    replay_teleop,
    run_teleop,
)
from poise.apps.teleoperation._scripts import (
    SCRIPTS,
    Script,
    terrain_blocks as terrain_blocks,
)

__all__ = [
    "SCRIPTS",
    "TORQUE_TELEOP_PLANT",
    "VELOCITY_TELEOP_PLANT",
    "BadOperator",
    "HapticArm",
    "HapticDriver",
    "HapticFeet",
    "PoorLink",
    "Script",
    "SimulatedArm",
    "TeleopLog",
    "TeleopRun",
    "replay_teleop",
    "run_teleop",
]
