"""Step teleoperation in simulation: scripted and recorded foot devices, and everything noted."""

from poise.apps.teleoperation._haptics import (
    HapticArm,
    HapticDriver,
    HapticFeet,
    SimulatedArm,
    foot_forces as foot_forces,
)
from poise.apps.teleoperation._log import MODES as MODES, TeleopLog
from poise.apps.teleoperation._operators import BadOperator, PoorLink
from poise.apps.teleoperation._recording import (
    RecordedDevice as RecordedDevice,
    RecordedPush as RecordedPush,
    Recording as Recording,
    TeleopRecorder as TeleopRecorder,
    read_recording as read_recording,
    write_recording as write_recording,
)
from poise.apps.teleoperation._run import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    TeleopRun,
    replay_teleop,
    run_teleop,
)
from poise.apps.teleoperation._scripts import SCRIPTS, Script
from poise.apps.teleoperation._setup import (
    RecordingError as RecordingError,
    TeleopSetup as TeleopSetup,
    plant_from_json as plant_from_json,
    recorded_robot as recorded_robot,
)
from poise.apps.teleoperation._teleop_file import convert_recording as convert_recording
from poise.apps.teleoperation._terrain import terrain_blocks

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
    "terrain_blocks",
]
