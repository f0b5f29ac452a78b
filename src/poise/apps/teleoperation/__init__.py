"""Step teleoperation in simulation: scripted and recorded hands, and everything noted."""

from poise.apps.teleoperation._run import (
    DEVICE_STATUSES as DEVICE_STATUSES,
    MODES,
    REAL_SENSORS as REAL_SENSORS,
    TELEOP_PLANT,
    TeleopLog,
    TeleopRun,
    noisy,
    plant_from_json as plant_from_json,
    replay_teleop,
    run_teleop,
    teleop_setup as teleop_setup,
)
from poise.apps.teleoperation._scripts import (
    Script,
    lift_one_foot,
    over_an_obstacle,
    swing_fast,
    switch_feet,
)
from poise.apps.teleoperation._terrain import terrain_blocks as terrain_blocks

__all__ = [
    "MODES",
    "TELEOP_PLANT",
    "Script",
    "TeleopLog",
    "TeleopRun",
    "lift_one_foot",
    "noisy",
    "over_an_obstacle",
    "replay_teleop",
    "run_teleop",
    "swing_fast",
    "switch_feet",
]
