"""`run_reach`: a robot whose targets move and rest, and its motion in the last second."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.control import (
    Controller,
    DifferentialIK,
    OperationalSpaceController,
    ReducedController,
    WholeBodyController,
)
from poise.dynamics import RobotState
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, rollout
from poise.stack import ComTask, FrameTask, Stack, TorqueLimit, default_stack
from studies.locomotion.late_estimate import LateEstimate, typical_sensors

ARMS = ("panda", "upper17")
"""Robots on a fixed base: controlled every 1 ms, others every 2 ms."""

REACH_TIME, REST_FROM = 2.0, 0.3
"""Duration of a target's motion, and its beginning [s]."""

_TORQUE: dict[str, Any] = {
    "whole_body": WholeBodyController,
    "reduced": ReducedController,
    "osf": OperationalSpaceController,
}

Vector = Float64[np.ndarray, " n"]

Move = tuple[str, tuple[float, float, float]]
"""Name of a task, and displacement of its target [m]."""


@dataclass(frozen=True, kw_only=True)
class Reach:
    """One trial."""

    robot: str  # its name
    controller: str = "whole_body"  # "whole_body", "reduced", "osf" or "differential_ik"
    moves: tuple[Move, ...] = ()  # displacement of each task's target [m]
    softening: float | None = None  # of the stack; 0 for strict levels and feedback without bounds
    rate_limited: bool = True  # whether torques have the rate limit of the default stack
    sensed: bool = False  # whether sensors have noise and the state is estimated
    seconds: float = 5.0  # how long [s]


@dataclass(frozen=True, kw_only=True)
class Rest:
    """Outcome of a trial."""

    step: float  # largest change of a command from tick to tick in the last second, over its limit
    speed: float  # largest joint speed in the last second [rad/s]
    error: float  # distance of the targets from the frames at the end [m]
    fell: bool  # whether the robot fell


@cache
def robot_named(name: str) -> Robot:
    """Return a robot of the catalog, loaded once a process."""
    return load_robot(name)


def run_reach(trial: Reach) -> Rest:
    """Run one trial."""
    robot = robot_named(trial.robot)
    period = 1e-3 if trial.robot in ARMS else 2e-3
    controller = _controller(trial, robot, period)
    by_velocity = isinstance(controller, DifferentialIK)
    lead = _Leader(controller.stack, trial)
    limits = robot.v_max if by_velocity else robot.tau_max
    run = _follow if by_velocity else _simulate
    commands, speeds, error = list[Vector](), list[float](), 0.0
    fallen, last = False, round(1.0 / period)
    for values, speed, fell in run(trial, robot, controller, lead, period):
        fallen |= fell
        commands.append(values.copy())
        speeds.append(speed)
        error = lead.error()
    steps = np.abs(np.diff(np.array(commands[-last:]), axis=0)) / limits
    return Rest(
        step=float(steps.max()),
        speed=max(speeds[-last:]),
        error=error,
        fell=fallen,
    )


def _simulate(
    trial: Reach, robot: Robot, controller: Controller, lead: "_Leader", period: float
) -> Iterator[tuple[Vector, float, bool]]:
    """Yield torques and largest joint speed of each tick, and whether the robot fell."""
    sensors = typical_sensors() if trial.sensed else PlantConfig().sensors
    plant = Plant(robot, PlantConfig(control_dt=period, sensors=sensors), seed=1)
    estimator = LateEstimate(robot) if trial.sensed else None
    for tick in rollout(plant, controller, lead, estimator=estimator, duration=trial.seconds):
        torque = tick.command.torque
        assert torque is not None
        yield torque, float(np.abs(tick.truth.v[-robot.nj :]).max()), plant.fallen


def _follow(
    trial: Reach, robot: Robot, controller: Controller, lead: "_Leader", period: float
) -> Iterator[tuple[Vector, float, bool]]:
    """Yield the same of joints that follow velocities exactly, the first sole at its place."""
    model, data = robot.model, robot.model.createData()
    q, v = robot.q_home.copy(), np.zeros(robot.nv)
    sole = robot.frame_id(next(iter(robot.soles))) if robot.floating_base else 0

    def placed(q: Vector) -> pin.SE3:
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[sole].copy()

    stance = placed(q)
    for k in range(round(trial.seconds / period)):
        state = RobotState(q.copy(), v.copy(), time=k * period)
        lead.lead(state)
        velocity = controller.step(state).velocity
        assert velocity is not None
        before = q.copy()
        q[-robot.nj :] += period * velocity
        if robot.floating_base:
            base = pin.XYZQUATToSE3(q[:7])
            q[:7] = pin.SE3ToXYZQUAT(stance * placed(q).inverse() * base)
        v = np.asarray(pin.difference(model, before, q)) / period
        yield velocity, float(np.abs(velocity).max()), False


def random_moves(name: str, count: int, seed: int) -> list[tuple[Move, ...]]:
    """Draw displacements of the CoM or of a hand of the default stack, 0.1 to 0.5 m (arms: 1 m)."""
    stack = default_stack(robot_named(name))
    tasks = [
        task.name
        for _, task in stack.tasks()
        if isinstance(task, ComTask)
        or (isinstance(task, FrameTask) and "orientation" not in task.name)
    ]
    rng = np.random.default_rng(seed)
    far = 2.0 if name in ARMS else 1.0
    found: list[tuple[Move, ...]] = []
    for _ in range(count):
        task = tasks[rng.integers(len(tasks))]
        way = rng.normal(size=3)
        way *= far * rng.uniform(0.1, 0.5) / np.linalg.norm(way)
        found.append(((task, (float(way[0]), float(way[1]), float(way[2]))),))
    return found


def _controller(trial: Reach, robot: Robot, period: float) -> Controller:
    plain = default_stack(robot)
    changed: dict[str, Any] = {}
    if trial.softening is not None:
        changed["softening"] = trial.softening
    stack = Stack(
        plain.contacts,
        plain.levels,
        torque_limit=plain.torque_limit if trial.rate_limited else TorqueLimit(),
        **changed,
    )
    if trial.softening == 0.0:
        _as_published(stack, robot)
    if trial.controller == "differential_ik":
        return DifferentialIK(robot, stack, dt=period, strategy="hqp")
    make = _TORQUE[trial.controller]
    return make(robot, stack)


def _as_published(stack: Stack, robot: Robot) -> None:
    """Take the bounds of feedback away."""
    stack.bind(robot)
    for _, task in stack.tasks():
        task.set_speed(np.inf)


class _Leader:
    """Move targets along a minimum-jerk course, then hold them."""

    def __init__(self, stack: Stack, trial: Reach) -> None:
        self.stack = stack
        self._tasks: list[Any] = [stack.task(name) for name, _ in trial.moves]
        self._ways = [np.array(way) for _, way in trial.moves]
        self._starts: list[Float64[np.ndarray, "3"]] = []

    def lead(self, state: RobotState) -> None:
        if state.time < REST_FROM:
            return
        if not self._starts:
            self._starts = [task.target_position.copy() for task in self._tasks]
        u = min(1.0, (state.time - REST_FROM) / REACH_TIME)
        done = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        for task, start, way in zip(self._tasks, self._starts, self._ways, strict=True):
            task.set_target(start + done * way)

    def error(self) -> float:
        """Return the largest distance of a target from its frame [m]."""
        return max((float(np.linalg.norm(task.error[:3])) for task in self._tasks), default=0.0)
