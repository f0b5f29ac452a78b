"""Step teleoperation in simulation: scripted and recorded hands, and everything noted."""

from poise.apps.teleoperation._run import (
    DEVICE_STATUSES,
    MODES,
    REAL_SENSORS,
    TELEOP_PLANT,
    TeleopLog,
    TeleopRun,
    noisy,
    plant_from_json,
    replay_teleop,
    run_teleop,
    teleop_setup,
)
from poise.apps.teleoperation._scripts import (
    Script,
    lift_one_foot,
    over_an_obstacle,
    swing_fast,
    switch_feet,
)
from poise.apps.teleoperation._terrain import terrain_blocks

__all__ = [
    "DEVICE_STATUSES",
    "MODES",
    "REAL_SENSORS",
    "TELEOP_PLANT",
    "Script",
    "TeleopLog",
    "TeleopRun",
    "lift_one_foot",
    "noisy",
    "over_an_obstacle",
    "plant_from_json",
    "replay_teleop",
    "run_teleop",
    "swing_fast",
    "switch_feet",
    "teleop_setup",
    "terrain_blocks",
]
