"""A foot put down with one edge on a ridge that its ankle cannot follow, and stood on."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from poise.apps.teleoperation import run_teleop
from poise.locomotion import ScriptedDevice, StepTeleoperator, WayPoint
from poise.robots import Robot, load_robot
from poise.sim import Block
from studies.bad_operator.conditions import DESCRIBED, MIXED, changed_plant
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

ROBOTS = ("g1", "biped20", "humanoid33")

_HEIGHT, _WIDTH, _LONGER = 0.02, 0.5, 1.05
"""Of the ridge [m]; its width over that of the sole, its length over the sole's."""

_BESIDE = (-0.5, -0.35, 0.35, 0.5)
"""Middle of the ridge beside the middle of the sole, over its width; positive is outwards."""

_STRIDE, _CLEAR, _PRESS = 0.75, 0.08, 0.03
"""Length of the step, over that of the sole; how high the foot is held on its way, and how far
below the ground the hand presses it [m]."""

_STANDS, _END = 4.0, 8.0
"""From when, and until when it is looked at how the robot stands [s]."""

_SEEDS = 3
"""Of each place of the ridge, as described and under all conditions but pushes and bumps."""

_LEAN_MOST = 0.35
"""Bound of the trunk's lean [rad], as the scenarios have it."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a worker is asked for; the seed draws noise, slope and whatever is not as described."""

    robot: str
    condition: str
    beside: float
    seed: int


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes:
        trial: which.
        fell: whether the robot fell.
        lean: largest angle of the torso while it stands there [rad].
        shaking: standard deviation of a foot's load meanwhile, the larger one, over the weight.
    """

    trial: Trial
    fell: bool
    lean: float
    shaking: float


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial."""
    robot = _robot(trial.robot)
    sole, start = robot.soles["right_sole"], StepTeleoperator(robot).estimator.anchors[1]
    stride = _STRIDE * sole.length
    ridge = Block(
        center=(float(start[0]) + stride, float(start[1]) - trial.beside * sole.width),
        size=(_LONGER * sole.length, _WIDTH * sole.width, _HEIGHT),
    )
    plant = changed_plant(robot, "torque", trial.condition, trial.seed)
    points = [
        WayPoint(at=at, right=place)
        for at, place in (
            (0.5, (0.0, 0.0, 0.0)),
            (0.9, (0.0, 0.0, _CLEAR)),
            (1.6, (stride, 0.0, _CLEAR)),
            (2.3, (stride, 0.0, -_PRESS)),
            (2.6, (stride, 0.0, -0.01)),
        )
    ]
    run = run_teleop(
        robot,
        lambda t: ScriptedDevice(points, *t.estimator.anchors),
        replace(plant, blocks=(ridge,)),
        duration=_END,
        seed=trial.seed,
    )
    stands = run.log.time > _STANDS
    loads = run.log.loads[stands] / robot.weight
    return Outcome(
        trial=trial,
        fell=run.fell,
        lean=float(run.log.tilt[stands].max(initial=0.0)),
        shaking=float(loads.std(axis=0).max()) if stands.any() else float("nan"),
    )


def ridges_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robots = ROBOTS[:1] if options.quick else ROBOTS
    trials = [
        Trial(robot=robot, condition=condition, beside=beside, seed=10_000 * options.seed + seed)
        for robot in robots
        for condition in (DESCRIBED, MIXED)
        for beside in _BESIDE
        for seed in range(options.count(_SEEDS, 1))
    ]
    outcomes = list(run_each(run_trial, Outcome, trials, progress, options).values())
    groups = [
        [o for o in outcomes if (o.trial.robot, o.trial.condition) == (robot, condition)]
        for robot in robots
        for condition in (DESCRIBED, MIXED)
    ]
    return Section(
        prose=(
            "A step puts the right foot onto a ridge 2 cm high, half as wide as the sole and along "
            "it, under one edge: steeper than some ankles roll. Then the robot stands there for "
            f"{_END - _STANDS:.0f} s. All conditions are those of the bad operator, but for pushes "
            "and other bumps.",
        ),
        findings=tuple(_finding(group) for group in groups),
        tables=(
            Table(
                title="One edge on a ridge",
                header="robot | condition | trials | falls | lean where it stands, median, most "
                "[rad] | deviation of a foot's load, median, most [weights]",
                rows=tuple(_row(group) for group in groups),
            ),
        ),
    )


def _row(group: list[Outcome]) -> tuple[str | int | float, ...]:
    stood = [o for o in group if not o.fell]
    leans, shaking = ([getattr(o, name) for o in stood] or [np.nan] for name in ("lean", "shaking"))
    return (
        group[0].trial.robot,
        group[0].trial.condition,
        len(group),
        sum(o.fell for o in group),
        f"{np.median(leans):.3f}, {max(leans):.3f}",
        f"{np.median(shaking):.3f}, {max(shaking):.3f}",
    )


def _finding(outcomes: list[Outcome]) -> Finding:
    trial, falls = outcomes[0].trial, sum(o.fell for o in outcomes)
    leans = sum(o.lean > _LEAN_MOST for o in outcomes if not o.fell)
    return Finding(
        name=f"{trial.robot}, one edge on a ridge, {trial.condition}: falls and leans of more than "
        f"{_LEAN_MOST} rad, of {len(outcomes)} trials",
        paper=0,
        ours=falls + leans,
        ok=falls + leans == 0,
        note=f"{falls} falls",
    )
