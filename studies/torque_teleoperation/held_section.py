"""Pushes while an operator holds one foot up, at ten places, with all that is not as described."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Bool

from poise.apps.teleoperation import TeleopRun, run_teleop
from poise.locomotion import Mode, ScriptedDevice, StepTeleoperator, WayPoint
from poise.robots import Robot, load_robot
from studies.bad_operator.conditions import MIXED, changed_plant, push
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

ROBOT = "g1"

DIRECTIONS = (0, 45, 90, 135, 180, 225, 270, 315)
"""Of the push [deg]: 0 ahead, 90 outwards, across the foot that stands."""

_PLACES = (
    (0.0, 0.0, 0.05), (0.0, 0.0, 0.15), (0.15, 0.0, 0.05), (0.25, 0.0, 0.1), (-0.15, 0.0, 0.05),
    (-0.25, 0.0, 0.1), (0.0, 0.1, 0.08), (0.15, 0.1, 0.12), (-0.15, 0.08, 0.12), (0.1, -0.03, 0.06),
)  # fmt: skip
"""Where the foot is held, from where it stood: ahead, outwards and up [m]."""

_SPEED = 0.2
"""A push changes the robot's velocity by this [m/s]."""

_BEGIN, _PUSHED, _SPREAD, _AFTER = 1.5, 4.3, 0.3, 2.5
"""When the hand begins, when it is pushed at the earliest and by how much later at most, and how
long is looked at after it [s]."""

_ALLOWED = 1.0 / 120.0
"""Part of the pushes that may throw it: in ten minutes there are so many of them under the bad
operator, and one fall is asked for at most."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a worker is asked for: where the foot is held, a direction [deg], and a seed.

    The seed draws the ground, all errors and the moment of the push; odd ones lift the left foot.
    """

    place: int
    direction: int
    seed: int


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes:
        trial: which.
        fell: whether the robot fell.
        up: whether the foot was up, and the operator's, when the push came.
        stepped: whether the robot stepped by itself afterwards.
        tilt: largest angle of the torso from then on [rad].
    """

    trial: Trial
    fell: bool
    up: bool
    stepped: bool
    tilt: float


@cache
def _robot() -> Robot:
    return load_robot(ROBOT)


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial."""
    robot, seed = _robot(), trial.seed
    plant = changed_plant(robot, "torque", MIXED, seed)
    left = bool(seed % 2)
    at = _PUSHED + _SPREAD * float(np.random.default_rng((seed, 5)).uniform())
    # Outwards is to the side of the foot that stands.
    out = -1.0 if left else 1.0
    angle = out * math.radians(trial.direction)
    run = run_teleop(
        robot,
        lambda teleoperator: _hand(teleoperator, trial.place, left=left),
        plant,
        duration=at + _AFTER,
        seed=seed,
        pushes=[push(robot, _SPEED, angle, at, plant.control_dt)],
    )
    log = run.log
    after = log.time >= at
    own = _overruled(run)
    led = log.when(Mode.SR if left else Mode.SL) & ~own
    # One that has fallen before has no such tick.
    last = max(int(np.argmax(after)) - 1, 0) if after.any() else len(log) - 1
    return Outcome(
        trial=trial,
        fell=run.fell,
        up=bool(after.any() and led[last]),
        stepped=bool(own[after].any()),
        tilt=float(log.tilt[last:].max()),
    )


def _overruled(run: TeleopRun) -> Bool[np.ndarray, " T"]:
    """When the robot led its feet by itself, a row a tick."""
    notes = run.record.notes("device")
    ticks = run.record.times("zmp_reference")
    last = np.searchsorted([time for time, _ in notes], ticks, side="right") - 1
    return np.array([text == "OVERRULED" for _, text in notes])[last]


def _hand(teleoperator: StepTeleoperator, place: int, *, left: bool) -> ScriptedDevice:
    """Lifts one device, and holds it where the foot shall be."""
    ahead, outwards, height = _PLACES[place]
    aside = outwards if left else -outwards
    ways = (
        (0.0, (0.0, 0.0, 0.0)),
        (0.4, (0.0, 0.0, height)),
        (1.3, (0.0, 0.0, height)),
        (1.8, (ahead, aside, height)),
    )
    points = [
        WayPoint(at=_BEGIN + at, left=offset) if left else WayPoint(at=_BEGIN + at, right=offset)
        for at, offset in ways
    ]
    return ScriptedDevice(points, *teleoperator.estimator.anchors)


def held_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    directions = DIRECTIONS[::4] if options.quick else DIRECTIONS
    places = range(2) if options.quick else range(len(_PLACES))
    trials = [
        Trial(
            place=place,
            direction=direction,
            seed=10_000 * options.seed + 1001 * repeat + 10 * DIRECTIONS.index(direction) + place,
        )
        for direction in directions
        for place in places
        for repeat in range(options.count(1, 1))
    ]
    outcomes = list(run_each(run_trial, Outcome, trials, progress, options).values())
    groups = [[o for o in outcomes if o.trial.direction == d] for d in directions]
    return Section(
        prose=(
            f"{ROBOT}, all conditions of the bad operator at once. A hand lifts one device and "
            f"holds it at one of {len(places)} places; 2.8 s after it has begun the torso is "
            f"pushed by {_SPEED:g} m/s, in directions from ahead, 90 degrees being outwards across "
            "the foot that stands. Whether the foot was still up then is counted apart: on a bump, "
            "or with an attitude that is off, the robot may have put it down by itself.",
        ),
        findings=(_finding(outcomes),),
        tables=(
            Table(
                title="Pushed with one foot held up",
                header="direction [deg] | pushes | foot up | own steps | falls | "
                "lean, median [rad]",
                rows=tuple(
                    (
                        group[0].trial.direction,
                        len(group),
                        sum(o.up for o in group),
                        sum(o.stepped for o in group),
                        sum(o.fell for o in group),
                        float(np.median([o.tilt for o in group])),
                    )
                    for group in groups
                ),
            ),
        ),
    )


def _finding(outcomes: list[Outcome]) -> Finding:
    falls, allowed = sum(o.fell for o in outcomes), _ALLOWED * len(outcomes)
    return Finding(
        name=f"{ROBOT}, one foot held up: falls of {len(outcomes)} pushes",
        paper=round(allowed, 2),
        ours=falls,
        ok=falls <= allowed,
        note=f"in {sum(o.up for o in outcomes)} the foot was up",
    )
