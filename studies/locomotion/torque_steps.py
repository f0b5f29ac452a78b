"""`TorqueSteps`: how much torques change from tick to tick.

`run_pushed_stand`: standing while the torso is pushed again and again.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.control import Command, WholeBodyController
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, rollout
from poise.stack import Stack, TorqueLimit, default_stack
from studies.locomotion.late_estimate import PERIOD, LateEstimate, typical_sensors

_LARGE = 0.5
"""Changes above this, by the limit, are counted."""

_PUSH_EVERY, _PUSH_TIME, _PUSH_SPEED = 1.0, 0.08, 0.1
"""Pushes on the torso: how often, how long [s], and the change of speed that they make [m/s]."""


class TorqueSteps:
    """Watches commands.

    Args:
        robot: whose.

    Attributes:
        largest: change of a torque from tick to tick, by its limit.
        large: how many changes were larger than half a limit.
        worst_physics: largest residual of contacts and joint limits.
    """

    def __init__(self, robot: Robot) -> None:
        self.largest = self.worst_physics = 0.0
        self.large = 0
        self._limits = robot.tau_max
        self._last: Float64[np.ndarray, " nj"] | None = None

    def take(self, command: Command) -> None:
        """Takes the next tick's command into account."""
        torque = command.torque
        if torque is not None and self._last is not None:
            change = np.abs(torque - self._last) / self._limits
            self.largest = max(self.largest, float(change.max()))
            self.large += int((change > _LARGE + 1e-9).sum())
        self._last = None if torque is None else torque.copy()
        self.worst_physics = max([self.worst_physics, *command.residuals[1:2]])


@dataclass(frozen=True, kw_only=True)
class StandTrial:
    """What a worker is asked for.

    Attributes:
        robot: its name.
        bounded: whether the change of torques is, as it is in the default stack.
        seed: of the pushes.
        seconds: how long [s].
    """

    robot: str
    bounded: bool = True
    seed: int = 0
    seconds: float = 20.0


@dataclass(frozen=True, kw_only=True)
class StandOutcome:
    """What became of it.

    Attributes:
        trial: the trial.
        fell: whether the robot fell.
        torque_step: largest change of a torque from tick to tick, by its limit.
        torque_steps: how many changes were larger than half a limit.
        worst_physics: largest residual of contacts and joint limits.
    """

    trial: StandTrial
    fell: bool
    torque_step: float
    torque_steps: int
    worst_physics: float


def run_pushed_stand(trial: StandTrial) -> StandOutcome:
    """Stands on the estimate, and is pushed."""
    robot = load_robot(trial.robot)
    random = np.random.default_rng(trial.seed)
    plain = default_stack(robot)
    limit = plain.torque_limit if trial.bounded else TorqueLimit()
    stack = Stack(plain.contacts, plain.levels, torque_limit=limit)
    config = PlantConfig(control_dt=PERIOD, sensors=typical_sensors())
    plant = Plant(robot, config, seed=trial.seed)
    for start in np.arange(1.0, trial.seconds, _PUSH_EVERY).tolist():
        angle = float(random.uniform(0.0, 2.0 * np.pi))
        size = robot.mass * _PUSH_SPEED / _PUSH_TIME
        force = (size * float(np.cos(angle)), size * float(np.sin(angle)), 0.0)
        plant.push(robot.torso, force, _PUSH_TIME, start)
    changes = TorqueSteps(robot)
    controller, estimate = WholeBodyController(robot, stack), LateEstimate(robot)
    for tick in rollout(plant, controller, estimator=estimate, duration=trial.seconds):
        changes.take(tick.command)
    return StandOutcome(
        trial=trial,
        fell=plant.fallen,
        torque_step=changes.largest,
        torque_steps=changes.large,
        worst_physics=changes.worst_physics,
    )
