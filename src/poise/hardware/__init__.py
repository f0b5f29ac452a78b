"""The way to a real robot: one contract, `Link`, and what stands between controller and drives."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from poise.hardware._g1 import G1Link
from poise.hardware._g1_robot import G1Robot as G1Robot
from poise.hardware._g1_sdk import MODE_MACHINES as MODE_MACHINES
from poise.hardware._last_check import LastCheck
from poise.hardware._link import (
    COMMAND_FIELDS as COMMAND_FIELDS,
    STATE_FIELDS as STATE_FIELDS,
    Gains as Gains,
    Link,
    LinkInfo,
    LinkStatus,
    MotorCommand,
    MotorState,
)
from poise.hardware._process_link import ProcessLink

if TYPE_CHECKING:
    from poise.hardware._link_body import RAMP as RAMP, WARM as WARM, LinkBody
    from poise.hardware._plant_link import PlantLink, robot_state
    from poise.hardware._preflight import Preflight, PreflightCheck as PreflightCheck, preflight
    from poise.hardware._preflight_moves import Move
    from poise.hardware._torque_split import TorqueSplit
    from poise.hardware._watchdog import RULES, Action, Rule, Trouble, Verdict as Verdict, Watchdog

__all__ = [
    "RULES",
    "Action",
    "G1Link",
    "LastCheck",
    "Link",
    "LinkBody",
    "LinkInfo",
    "LinkStatus",
    "MotorCommand",
    "MotorState",
    "Move",
    "PlantLink",
    "Preflight",
    "ProcessLink",
    "Rule",
    "TorqueSplit",
    "Trouble",
    "Watchdog",
    "preflight",
    "robot_state",
]

_LATER = {
    **dict.fromkeys(("PlantLink", "robot_state"), "_plant_link"),
    **dict.fromkeys(("RAMP", "WARM", "LinkBody"), "_link_body"),
    **dict.fromkeys(("Preflight", "PreflightCheck", "preflight"), "_preflight"),
    "Move": "_preflight_moves",
    "TorqueSplit": "_torque_split",
    **dict.fromkeys(("RULES", "Action", "Rule", "Trouble", "Verdict", "Watchdog"), "_watchdog"),
}
"""Modules that import Pinocchio, which the process of a `ProcessLink` does without."""


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module 'poise.hardware' has no attribute {name!r}")
    return getattr(import_module(f"poise.hardware.{_LATER[name]}"), name)
