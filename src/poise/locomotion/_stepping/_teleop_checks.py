"""What a step teleoperator may be made with: start, actuation, driver, controller."""

from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.control import CONTROLLERS, fault_of
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion._stepping._by_velocity import ComDriver, ShifterDriver
from poise.robots import Robot

_ACTUATIONS = ("velocity", "torque")
"""What the controller of the stack may command."""

_STRAIGHT = 0.1
"""How far a robot may be turned to be walked at velocity level [rad]."""


def checked_start(robot: Robot, q_start: Any) -> Float64[np.ndarray, " nq"]:
    """A configuration to start in."""
    if q_start is None:
        return robot.q_home
    try:
        q = np.array(q_start, dtype=np.float64)
    except (TypeError, ValueError):
        raise ConfigurationError(
            f"the start is no configuration of {robot.name}",
            got=q_start,
            wanted="one like Robot.q_home",
        ) from None
    fault = fault_of(RobotState(q, np.zeros(robot.nv)), robot)
    if fault:
        raise ConfigurationError(
            f"the start is no configuration of {robot.name}: {fault}",
            wanted="one like Robot.q_home",
        )
    return q


def check_straight(ahead: float) -> None:
    """Refuses a start that is turned, for velocities."""
    if abs(ahead) > _STRAIGHT:
        raise ConfigurationError(
            "at velocity level soles keep the world's yaw, and the robot starts turned",
            got=f"{ahead:.2f} rad",
            wanted="feet along the world's x axis, or torques",
        )


def checked_actuation(actuation: str, driver: ComDriver | None = None) -> str:
    """Return a known actuation whose driver goes with it."""
    if actuation not in _ACTUATIONS:
        raise UnknownNameError(
            "no such actuation of step teleoperation", got=actuation, choices=_ACTUATIONS
        )
    if actuation == "torque" and not (driver is None or isinstance(driver, ShifterDriver)):
        raise ConfigurationError(
            "torques need the COM shifter, whose feedback is on what is measured",
            got=type(driver).__name__,
            wanted="ShifterDriver, or none",
        )
    return actuation


def checked_controller(name: str | None, actuation: str) -> str:
    """That controller, or the first one that commands so."""
    choices = [each for each, kind in CONTROLLERS.items() if kind.actuation == actuation]
    if name is None:
        return choices[0]
    if name not in choices:
        raise UnknownNameError(
            f"no such controller for step teleoperation by {actuation}", got=name, choices=choices
        )
    return name
