"""`run_step_trial`: how much torques change from tick to tick, walking and pushed."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from poise.control import WholeBodyController
from poise.locomotion import Gait, Stride, Walker, plan_footsteps, walking_stack
from poise.robots import load_robot
from poise.sim import Block, Plant, PlantConfig, rollout
from poise.stack import Stack, TorqueLimit, default_stack

PERIOD = 0.002
"""Of the controller [s]."""

Kind = Literal["walk", "bumps", "stand"]
"""A walk on the flat, one over bumps that nobody told of, standing with small pushes."""

_STEP_TIME, _DOUBLE_SUPPORT, _LENGTH, _REST = 0.8, 0.15, 0.15, 3.0
_BUMPS, _HIGHEST = 40, 0.02
"""How many bumps lie on the way, and how high they are at most [m]."""

_PUSH_EVERY, _PUSH_TIME, _PUSH_SPEED = 1.0, 0.08, 0.1
"""Pushes on the torso: how often, how long [s], and the change of speed that they make [m/s]."""


@dataclass(frozen=True, kw_only=True)
class StepTrial:
    """What a worker is asked for.

    Attributes:
        robot: its name.
        kind: what it does.
        rate: of the torque limit [1/s].
        seed: of bumps and pushes.
        seconds: how long [s].
    """

    robot: str
    kind: Kind
    rate: float | None
    seed: int = 0
    seconds: float = 20.0


@dataclass(frozen=True, kw_only=True)
class StepOutcome:
    """What became of it.

    Attributes:
        trial: the trial.
        fell: whether the robot fell.
        largest: change of a torque from tick to tick, by its limit.
        steps: how many changes were larger than half a limit.
        worst_physics: largest residual of contacts and joint limits.
    """

    trial: StepTrial
    fell: bool
    largest: float
    steps: int
    worst_physics: float


def run_step_trial(trial: StepTrial) -> StepOutcome:
    """Walks, or stands and is pushed."""
    robot = load_robot(trial.robot)
    random = np.random.default_rng(trial.seed)
    walks = trial.kind != "stand"
    plain = walking_stack(robot) if walks else default_stack(robot)
    stack = Stack(plain.contacts, plain.levels, torque_limit=TorqueLimit(rate=trial.rate))
    blocks = tuple(_bump(random) for _ in range(_BUMPS)) if trial.kind == "bumps" else ()
    plant = Plant(robot, PlantConfig(control_dt=PERIOD, blocks=blocks))
    walker = None
    if walks:
        steps = max(1, int((trial.seconds - _REST) / (_STEP_TIME + _DOUBLE_SUPPORT)))
        gait = Gait(step_time=_STEP_TIME, double_support=_DOUBLE_SUPPORT, crouch=0.02)
        plan = plan_footsteps(robot, [Stride(steps=steps, length=_LENGTH)], gait)
        walker = Walker(robot, plan, stack)
    else:
        for start in np.arange(1.0, trial.seconds, _PUSH_EVERY).tolist():
            angle = float(random.uniform(0.0, 2.0 * np.pi))
            size = robot.weight / 9.81 * _PUSH_SPEED / _PUSH_TIME
            force = (size * float(np.cos(angle)), size * float(np.sin(angle)), 0.0)
            plant.push(robot.torso, force, _PUSH_TIME, start)
    last: Float64[np.ndarray, " nj"] | None = None
    largest = worst = 0.0
    count = 0
    controller = WholeBodyController(robot, stack)
    for tick in rollout(plant, controller, walker, duration=trial.seconds):
        torque = tick.command.torque
        if torque is not None and last is not None:
            change = np.abs(torque - last) / robot.tau_max
            largest, count = max(largest, float(change.max())), count + int((change > 0.5).sum())
        last = None if torque is None else torque.copy()
        worst = max([worst, *tick.command.residuals[1:2]])
    return StepOutcome(
        trial=trial, fell=plant.fallen, largest=largest, steps=count, worst_physics=worst
    )


def _bump(random: np.random.Generator) -> Block:
    """A flat box somewhere on the way, not under the feet at the start."""
    place = (float(random.uniform(0.25, 3.5)), float(random.uniform(-0.4, 0.4)))
    length, width = random.uniform(0.1, 0.4, size=2).tolist()
    height = float(random.uniform(0.002, _HIGHEST))
    return Block(center=place, size=(length, width, height), told=False)
