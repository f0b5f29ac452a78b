"""Step teleoperation in simulation: scripted and recorded hands, and everything noted."""

from poise.teleop_sim.log import DEVICE_STATUSES, MODES, TeleopLog
from poise.teleop_sim.plant import REAL_SENSORS, TELEOP_PLANT, noisy
from poise.teleop_sim.run import TeleopRun, replay_teleop, run_teleop, teleop_setup

__all__ = [
    "DEVICE_STATUSES",
    "MODES",
    "REAL_SENSORS",
    "TELEOP_PLANT",
    "TeleopLog",
    "TeleopRun",
    "noisy",
    "replay_teleop",
    "run_teleop",
    "teleop_setup",
]
