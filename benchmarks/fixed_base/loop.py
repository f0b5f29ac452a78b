"""`run_loop`: controller and plant in turn, with torques held over a control period."""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from benchmarks.fixed_base.encoder import JointSensors
from benchmarks.fixed_base.plant import RigidPlant, set_gravity
from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import PoiseError
from poise.robots import Robot

CONTROL_DT = 1e-3
"""Control period [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tick:
    """One tick, right after its torque is applied.

    Attributes:
        state: what the controller was told.
        q: true joint angles [rad].
        v: true joint velocities [rad/s].
        acceleration: true joint accelerations under the torque [rad/s^2].
        torque: [N m].
        gravity: vertical gravity of the plant [m/s^2].
    """

    state: RobotState
    q: Float64[np.ndarray, " n"]
    v: Float64[np.ndarray, " n"]
    acceleration: Float64[np.ndarray, " n"]
    torque: Float64[np.ndarray, " n"]
    gravity: float


@runtime_checkable
class TorqueController(Protocol):
    """What the loop asks of a controller."""

    @property
    def robot(self) -> Robot:
        """Its model of the robot."""
        ...

    def step(self, state: RobotState) -> Command:
        """One tick: from state to torques."""
        ...


def run_loop(
    controller: TorqueController,
    plant: RigidPlant,
    aim: Callable[[float], object],
    *,
    ticks: int,
    sensors: JointSensors | None = None,
    gravity_known: bool = True,
) -> Generator[Tick]:
    """Runs a plant under a controller, a tick at a time.

    Args:
        controller: its robot must be one from `with_gravity` where gravity changes and is known.
        plant: the true robot.
        aim: sets the tasks' targets for a time [s].
        ticks: how many.
        sensors: between plant and controller; exact when None.
        gravity_known: whether the controller's model has the plant's gravity at every tick;
            otherwise it keeps its own.

    Yields:
        Every tick, before the plant moves on.

    Raises:
        PoiseError: the controller had no answer, so that there is nothing to study.
    """
    sensors = sensors or JointSensors()
    for _ in range(ticks):
        if gravity_known and controller.robot.model.gravity.linear[2] != plant.gravity:
            set_gravity(controller.robot, plant.gravity)
        state = sensors.read(plant.q, plant.v, plant.time)
        aim(plant.time)
        command = controller.step(state)
        torque = command.torque
        if torque is None or not command.status.ok:
            raise PoiseError(f"the controller failed at {plant.time:.3f} s: {command.status}")
        yield Tick(
            state=state,
            q=plant.q,
            v=plant.v,
            acceleration=plant.acceleration(torque),
            torque=torque,
            gravity=plant.gravity,
        )
        plant.advance(torque, CONTROL_DT)
