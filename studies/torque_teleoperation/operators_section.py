"""Falls under the bad operator at torque level, by robot and by what is not as described."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    BadOperator,
    run_teleop,
    terrain_blocks,
)
from poise.locomotion import Mode
from poise.robots import Robot, load_robot
from poise.sim import PlantConfig
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

_ATTITUDE = math.radians(0.5)
"""Constant error of the attitude, in a direction drawn by the seed [rad]."""

_SLOPE, _FRICTION, _MASS, _DELAY = math.radians(3.0), 0.5, 0.1, 0.010
_SPREAD = 1_000_000
"""Seeds of `--seed N` begin at N times this."""

Change = Callable[[PlantConfig, Robot, int], PlantConfig]


def _direction(seed: int) -> tuple[float, float]:
    angle = float(np.random.default_rng((seed, 7)).uniform(0.0, 2.0 * math.pi))
    return math.cos(angle), math.sin(angle)


def _as_described(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return plant


def _sloping(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot
    x, y = _direction(seed + 1)
    return replace(plant, floor_slope=(_SLOPE * x, _SLOPE * y))


def _bumpy(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    return replace(plant, blocks=terrain_blocks("bumps", robot, seed=seed))


def _slippery(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, friction=_FRICTION)


def _heavier_or_lighter(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot
    return replace(plant, mass_scale=1.0 + (_MASS if seed % 2 else -_MASS))


def _late(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, sensors=replace(plant.sensors, delay=_DELAY))


CONDITIONS: dict[str, Change] = {
    "as described": _as_described,
    "slope of 3 degrees": _sloping,
    "bumps of 2 cm": _bumpy,
    "friction 0.5": _slippery,
    "mass 10% off": _heavier_or_lighter,
    "10 ms of delay": _late,
}
"""What is not as the controller takes it to be."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a worker is asked for: a robot, a condition, a seed, and a time [s]."""

    robot: str
    condition: str
    seed: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes:
        trial: which.
        fell: whether the robot fell.
        seconds: how long it stood [s].
        steps: how often a foot was lifted.
        tilt: largest angle of the torso [rad].
    """

    trial: Trial
    fell: bool
    seconds: float
    steps: int
    tilt: float


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial."""
    robot = _robot(trial.robot)
    plant = TORQUE_TELEOP_PLANT.with_noise()
    x, y = _direction(trial.seed)
    error = (_ATTITUDE * x, _ATTITUDE * y)
    plant = replace(plant, sensors=replace(plant.sensors, base_orientation_error=error))
    run = run_teleop(
        robot,
        lambda teleoperator: BadOperator(teleoperator, trial.seed),
        CONDITIONS[trial.condition](plant, robot, trial.seed),
        duration=trial.seconds,
        seed=trial.seed,
    )
    log = run.log
    return Outcome(
        trial=trial,
        fell=run.fell,
        seconds=run.plant.time,
        steps=len(log.entries(Mode.SL)) + len(log.entries(Mode.SR)),
        tilt=float(log.tilt.max()),
    )


def operators_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    first, seconds = _SPREAD * options.seed, 20.0 if options.quick else 60.0
    trials = [
        Trial(robot=robot, condition=condition, seed=first + k, seconds=seconds)
        for robot in ("biped20", "humanoid33", "g1")
        for condition in CONDITIONS
        for k in range(_seeds(condition, quick=options.quick))
    ]
    outcomes = list(run_each(run_trial, Outcome, trials, progress).values())
    groups = {
        (robot, condition): [
            o for o in outcomes if (o.trial.robot, o.trial.condition) == (robot, condition)
        ]
        for robot in ("biped20", "humanoid33", "g1")
        for condition in CONDITIONS
    }
    return Section(
        prose=(
            f"{seconds:.0f} s a seed, from seed {first}. The operator's whims are those of the "
            "study bad-operator. Asked as described: at most one fall in a hundred seeds on G1, "
            "none on the others; otherwise at most one in ten minutes.",
        ),
        findings=tuple(_finding(*which, group) for which, group in groups.items()),
        tables=(
            Table(
                title="Bad operators",
                header="robot | condition | seeds | falls | minutes | feet lifted | "
                "lean, median [rad] | greatest [rad]",
                rows=tuple(_row(*which, group) for which, group in groups.items()),
            ),
        ),
    )


def _seeds(condition: str, *, quick: bool) -> int:
    if quick:
        return 3
    return 200 if condition == "as described" else 50


def _allowed(robot: str, condition: str, group: list[Outcome]) -> float:
    """Falls that are asked for at most."""
    if condition == "as described":
        return 0.01 * len(group) if robot == "g1" else 0.0
    return sum(o.seconds for o in group) / 600.0


def _finding(robot: str, condition: str, group: list[Outcome]) -> Finding:
    falls, allowed = sum(o.fell for o in group), _allowed(robot, condition, group)
    return Finding(
        name=f"{robot}, {condition}: falls in {len(group)} seeds",
        paper=round(allowed, 2),
        ours=falls,
        ok=falls <= allowed,
        note=f"{sum(o.steps for o in group)} feet were lifted",
    )


def _row(robot: str, condition: str, group: list[Outcome]) -> tuple[str | float, ...]:
    tilts = [o.tilt for o in group]
    return (
        robot,
        condition,
        len(group),
        sum(o.fell for o in group),
        sum(o.seconds for o in group) / 60.0,
        sum(o.steps for o in group),
        float(np.median(tilts)),
        max(tilts),
    )
