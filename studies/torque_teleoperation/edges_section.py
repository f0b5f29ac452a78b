"""A foot put down on the edge of a bump, the other lifted at once and kicked about."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from jaxtyping import Float64

from poise.apps.teleoperation import run_teleop
from poise.locomotion import Mode, ScriptedDevice, StepTeleoperator, WayPoint
from poise.robots import Robot, load_robot
from poise.sim import Block
from studies.bad_operator.conditions import MIXED, changed_plant
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

ROBOTS = ("g1", "biped20", "humanoid33")

_SEEDS = 20
"""Of each robot."""

_STRIDE = 1.15
"""Length of the step onto the bump, over that of the sole."""

_HEIGHTS, _SIZES = (0.01, 0.02), (0.03, 0.15)
"""Of the bump, and of either of its sides [m]; its middle lies anywhere under the sole, or beside
it by a tenth of that at most."""

_UP, _CLEAR, _PRESS = 0.10, 0.08, 0.03
"""How high the foot is held that is kicked about, and each on its way, and how far below its ground
the hand presses it [m]."""

_LANDED, _KICKED, _KICK = 3.4, 4.8, 0.5
"""When the other foot is lifted, when kicks begin, and how long one takes [s]."""

_KICKS = ((-0.1, 0.3), (0.0, 0.1), (0.05, 0.2))
"""Where kicks go to, from where the foot stood: ahead, outwards, up; least and most [m]."""

_REST = 1.0
"""How long is looked at after the foot has been put down [s]."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a worker is asked for; the seed draws bump, kicks, and all that is not as described."""

    robot: str
    seed: int


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes:
        trial: which.
        fell: whether the robot fell.
        alone: how long the foot on the bump carried alone [s].
        stepped: whether the robot stepped by itself.
        tilt: largest angle of the torso [rad].
    """

    trial: Trial
    fell: bool
    alone: float
    stepped: bool
    tilt: float


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial."""
    robot, rng = _robot(trial.robot), np.random.default_rng((trial.seed, 5))
    stride = _STRIDE * robot.soles["right_sole"].length
    start = StepTeleoperator(robot).estimator.anchors[1]
    block = _bump(robot, start[:2] + np.array([stride, 0.0]), rng)
    points = _points(stride, block.size[2], rng)
    plant = replace(changed_plant(robot, "torque", MIXED, trial.seed), blocks=(block,))
    run = run_teleop(
        robot,
        lambda t: ScriptedDevice(points, *t.estimator.anchors),
        plant,
        duration=points[-1].at + _REST,
        seed=trial.seed,
    )
    return Outcome(
        trial=trial,
        fell=run.fell,
        alone=float(run.log.when(Mode.SR).sum()) * plant.control_dt,
        stepped=any(status == "OVERRULED" for _, status in run.record.notes("device")),
        tilt=float(run.log.tilt.max()),
    )


def _bump(robot: Robot, under: Float64[np.ndarray, "2"], rng: np.random.Generator) -> Block:
    """A bump somewhere under a sole whose centre comes to lie there [m]."""
    sole = robot.soles["right_sole"]
    off = rng.uniform(-0.6, 0.6, 2) * (sole.length, sole.width)
    x, y = (under + off).tolist()
    length, width = rng.uniform(*_SIZES, 2).tolist()
    height, yaw = float(rng.uniform(*_HEIGHTS)), float(rng.uniform(0.0, np.pi))
    return Block(center=(x, y), size=(length, width, height), yaw=yaw)


def _points(stride: float, height: float, rng: np.random.Generator) -> list[WayPoint]:
    """The right foot goes onto the bump, the left one up, about, and beside it."""
    points = [
        WayPoint(at=at, right=place)
        for at, place in (
            (0.5, (0.0, 0.0, 0.0)),
            (0.9, (0.0, 0.0, _CLEAR)),
            (1.6, (stride, 0.0, _CLEAR)),
            (2.1, (stride, 0.0, height - _PRESS)),
            (2.4, (stride, 0.0, height - 0.01)),
        )
    ]
    places = [
        (_LANDED, (0.0, 0.0, 0.0)),
        (_LANDED + 0.2, (0.0, 0.0, _UP)),
        (_KICKED, (0.0, 0.0, _UP)),
    ]
    time = _KICKED
    for _ in range(4):
        x, y, z = (float(rng.uniform(least, most)) for least, most in _KICKS)
        places += [(time + 0.7 * _KICK, (x, y, z)), (time + _KICK, (x, y, z))]
        time += _KICK
    places += [
        (time + 0.5, (stride, 0.0, _CLEAR)),
        (time + 0.9, (stride, 0.0, -_PRESS)),
    ]
    return [*points, *(WayPoint(at=at, left=place) for at, place in places)]


def edges_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robots = ROBOTS[:1] if options.quick else ROBOTS
    trials = [
        Trial(robot=robot, seed=10_000 * options.seed + seed)
        for robot in robots
        for seed in range(options.count(_SEEDS, 3))
    ]
    outcomes = list(run_each(run_trial, Outcome, trials, progress, options).values())
    groups = [[o for o in outcomes if o.trial.robot == robot] for robot in robots]
    return Section(
        prose=(
            "All conditions of the bad operator at once but pushes, and one bump, 1 to 2 cm high, "
            "at a random place under the sole that a step of the right foot puts down. Then the "
            "left foot is lifted within 0.2 s, kicked about for two seconds, and put down.",
        ),
        findings=tuple(_finding(group) for group in groups),
        tables=(
            Table(
                title="On the edge of a bump",
                header="robot | trials | falls | own steps | alone on the bump, median [s] | "
                "lean, most [rad]",
                rows=tuple(
                    (
                        group[0].trial.robot,
                        len(group),
                        sum(o.fell for o in group),
                        sum(o.stepped for o in group),
                        float(np.median([o.alone for o in group])),
                        max(o.tilt for o in group),
                    )
                    for group in groups
                ),
            ),
        ),
    )


def _finding(outcomes: list[Outcome]) -> Finding:
    falls = sum(o.fell for o in outcomes)
    return Finding(
        name=f"{outcomes[0].trial.robot}, on the edge of a bump: falls of {len(outcomes)} trials",
        paper=0,
        ours=falls,
        ok=falls == 0,
        note=f"in {sum(o.stepped for o in outcomes)} it stepped by itself",
    )
