"""Robots that stand where the ground or the attitude is off, their velocities commanded."""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, run_teleop
from poise.locomotion import ScriptedDevice
from poise.robots import Robot, load_robot
from poise.sim import PlantConfig
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

ROBOTS = ("biped20", "humanoid33", "g1", "talos", "icub", "romeo", "simple_humanoid")
"""All bipeds of the catalog that step teleoperation takes at velocity level."""

_SLOPE, _ATTITUDE = math.radians(2.0), math.radians(1.0)
"""Of the floor, and constant error of the attitude [rad]."""

_DIRECTIONS = 8


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a worker is asked for: a robot, what is off, in which direction [rad], a time [s]."""

    robot: str
    off: str
    direction: float
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes:
        trial: which.
        fell: whether the robot fell.
        seconds: how long it stood [s].
        sway: how far the measured ZMP went to and fro in the last second, the longer way [m].
    """

    trial: Trial
    fell: bool
    seconds: float
    sway: float


def _slope(plant: PlantConfig, x: float, y: float) -> PlantConfig:
    return replace(plant, floor_slope=(_SLOPE * x, _SLOPE * y))


def _attitude(plant: PlantConfig, x: float, y: float) -> PlantConfig:
    error = (_ATTITUDE * x, _ATTITUDE * y)
    return replace(plant, sensors=replace(plant.sensors, base_orientation_error=error))


_OFF = {"slope of 2 degrees": _slope, "attitude off by 1 degree": _attitude}


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial."""
    direction = trial.direction
    plant = _OFF[trial.off](VELOCITY_TELEOP_PLANT, math.cos(direction), math.sin(direction))
    run = run_teleop(
        _robot(trial.robot),
        lambda teleoperator: ScriptedDevice([], *teleoperator.estimator.anchors),
        plant,
        duration=trial.seconds,
    )
    last = run.log.zmp[run.log.time > run.log.time[-1] - 1.0]
    return Outcome(
        trial=trial,
        fell=run.fell,
        seconds=run.plant.time,
        sway=float(np.ptp(last, axis=0).max()),
    )


def standing_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    seconds = 5.0 if options.quick else 30.0
    count = _DIRECTIONS // 2 if options.quick else _DIRECTIONS
    groups = [(robot, off) for robot in ROBOTS for off in _OFF]
    trials = [
        Trial(robot=robot, off=off, direction=2.0 * math.pi * k / count, seconds=seconds)
        for robot, off in groups
        for k in range(count)
    ]
    outcomes = list(run_each(run_trial, Outcome, trials, progress, options).values())
    findings: list[Finding] = []
    rows: list[tuple[str | float, ...]] = []
    for robot, off in groups:
        group = [o for o in outcomes if (o.trial.robot, o.trial.off) == (robot, off)]
        falls = sum(o.fell for o in group)
        findings.append(
            Finding(
                name=f"{robot}, velocities, {off}: falls in {count} directions",
                paper=0,
                ours=falls,
                ok=falls == 0,
            )
        )
        least, sway = min(o.seconds for o in group), max(o.sway for o in group)
        rows.append((robot, off, falls, least, sway))
    return Section(
        prose=(
            f"Nobody commands anything; joint velocities are commanded, not torques. {seconds:.0f} "
            "s each, with ideal sensors but for the error that is named. A robot is put down as at "
            "home, its soles level: on a slope it begins on their edges.",
        ),
        findings=tuple(findings),
        tables=(
            Table(
                title="Standing",
                header="robot | off | falls | stood at least [s] | greatest sway of the ZMP [m]",
                rows=tuple(rows),
            ),
        ),
    )
