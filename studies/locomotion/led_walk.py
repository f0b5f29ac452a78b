"""One robot that is led by velocities and pushed, on the estimate of its base."""

import math
from dataclasses import dataclass, replace

import numpy as np

from poise.control import WholeBodyController
from poise.dynamics import RobotState
from poise.estimation import StateEstimator
from poise.locomotion import ReactiveWalker, walking_stack
from poise.robots import load_robot
from poise.sim import Plant, PlantConfig, SensorConfig, rollout
from poise.stack import Stack
from studies.locomotion.estimated_walk import DELAY, PERIOD

Velocity = tuple[float, float, float]
"""Ahead [m/s], to the left [m/s], turning to the left [rad/s]."""

PUSH_TIME = 0.08
"""Of every push on the torso [s]."""

_BEGIN, _STEADY = 1.0, 3.0
"""When a velocity is asked for, and from when on it counts [s]."""


@dataclass(frozen=True, kw_only=True)
class LedTrial:
    """What a worker is asked for.

    Attributes:
        robot: its name.
        seed: of noise, biases, and random commands.
        seconds: how long [s].
        velocity: asked for; at random, another every few seconds, when None.
        push: change of the robot's velocity [m/s]; 0 for none.
        direction: of the push, from ahead to the left [rad].
        at: when the push begins [s].
    """

    robot: str
    seed: int
    seconds: float
    velocity: Velocity | None = (0.0, 0.0, 0.0)
    push: float = 0.0
    direction: float = 0.0
    at: float = 0.0


@dataclass(frozen=True, kw_only=True)
class LedOutcome:
    """What became of a trial.

    Attributes:
        trial: the trial.
        fell: whether the robot fell.
        rested: whether it stood still in the end, feet side by side.
        reached: mean velocity from `_STEADY` s on, as it was asked for.
        steps: how many steps it made.
    """

    trial: LedTrial
    fell: bool
    rested: bool
    reached: Velocity
    steps: int


class _Leader:
    """Asks the walker for the velocities of a trial."""

    def __init__(self, walker: ReactiveWalker, stack: Stack, trial: LedTrial) -> None:
        self.stack, self._walker, self._trial = stack, walker, trial
        self._rng = np.random.default_rng(trial.seed)
        self._next = _BEGIN

    def lead(self, state: RobotState) -> None:
        """Sets what the next tick should do."""
        if state.time >= self._next:
            self._walker.set_velocity(*self._velocity())
        self._walker.lead(state)

    def _velocity(self) -> Velocity:
        if self._trial.velocity is not None:
            self._next = math.inf
            return self._trial.velocity
        self._next += self._rng.uniform(1.0, 4.0)
        if self._rng.random() < 0.2:
            return 0.0, 0.0, 0.0
        ahead, left, turn = self._rng.uniform((-0.4, -0.25, -0.6), (0.6, 0.25, 0.6)).tolist()
        return ahead, left, turn


def run_led(trial: LedTrial) -> LedOutcome:
    """Walks."""
    robot = load_robot(trial.robot)
    sensors = replace(SensorConfig.typical(), delay=DELAY)
    plant = Plant(robot, PlantConfig(control_dt=PERIOD, sensors=sensors), seed=trial.seed)
    stack = walking_stack(robot)
    walker = ReactiveWalker(robot, stack)
    if trial.push > 0.0:
        force = robot.mass * trial.push / PUSH_TIME
        x, y = force * math.cos(trial.direction), force * math.sin(trial.direction)
        plant.push(robot.torso, (x, y, 0.0), PUSH_TIME, trial.at)
    estimator = StateEstimator(robot, q_start=plant.true_state().q)
    poses: list[tuple[float, float, float]] = []
    ticks = rollout(
        plant,
        WholeBodyController(robot, stack),
        _Leader(walker, stack, trial),
        estimator=estimator.update,
        duration=trial.seconds,
    )
    for tick in ticks:
        if tick.time >= _STEADY:
            x, y, z, w = tick.truth.q[3:7].tolist()
            yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
            poses.append((*tick.truth.q[:2].tolist(), yaw))
        if plant.fallen:
            break
    return LedOutcome(
        trial=trial,
        fell=plant.fallen,
        rested=walker.status.value == "standing",
        reached=_mean_velocity(np.array(poses)),
        steps=walker.steps_made,
    )


def _mean_velocity(poses: np.ndarray) -> Velocity:
    """Along the robot, from one tick to the next."""
    if len(poses) < 2:
        return 0.0, 0.0, 0.0
    moved, yaw = np.diff(poses[:, :2], axis=0), np.unwrap(poses[:, 2])
    c, s = np.cos(yaw[1:]), np.sin(yaw[1:])
    rate = 1.0 / (len(moved) * PERIOD)
    ahead = float(np.sum(c * moved[:, 0] + s * moved[:, 1])) * rate
    left = float(np.sum(c * moved[:, 1] - s * moved[:, 0])) * rate
    return ahead, left, float(yaw[-1] - yaw[0]) * rate
