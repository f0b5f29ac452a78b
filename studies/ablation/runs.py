"""`draw` and `pushed`: a run of the design. `run`: makes it. `Rows`: the file of outcomes."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np

from poise.apps.teleoperation import BadOperator
from poise.locomotion import Device, StepTeleoperator
from poise.robots import Robot, load_robot
from poise.sim import Plant, SensorConfig, rollout
from studies.ablation.mechanisms import MECHANISMS, Mechanism, counted, without
from studies.bad_operator.conditions import MIXED, changed_plant, push
from studies.locomotion.courses import Course, make_course
from studies.locomotion.late_estimate import typical_sensors
from studies.locomotion.led_walk import LedTrial, TorqueSteps, walk_course
from studies.torque_teleoperation.everything import EverythingOperator

SECONDS = 20.0
"""Length of a run [s]."""

OFF = 0.25
"""Probability with which a run switches a mechanism off."""

TELEOPERATION, WALKING = "step teleoperation", "walking"
_TELEOPERATED, _G1 = 0.75, 0.75
"""Parts of the runs that are teleoperated, and of those on G1."""

OPERATORS: dict[str, Callable[[StepTeleoperator, int], Device]] = {
    "everything": EverythingOperator,
    "bad": BadOperator,
}
"""Operators of step teleoperation."""

_GROUNDS = (
    "bumps of 2 cm",
    "sensors off by a constant",
    "all of another plant",
    MIXED,
)
"""Conditions of step teleoperation, of `CONDITIONS` and `OTHER_PLANTS`."""

_LATE, _SLIPPERY, _CELL_ERROR, _CELL_LEVER = 0.006, 0.5, 0.01, 0.1
"""Delay [s], friction, and errors of load cells by the weight and by their forces [m]."""

TILES, OFF_CELLS, LATE = "tiles", "tiles, load cells off", "tiles, late and slippery"
_COURSES = (TILES, OFF_CELLS, LATE)
"""Conditions of walking."""

_FIRST_PUSH = {TELEOPERATION: 0.35, WALKING: 0.55}
"""Change of velocity by each push in the first run of a case [m/s]."""

FALLS = 0.2
"""Part of the runs of a case that shall end with a fall."""

_HARDER = 0.05
"""Pushes are larger by this part after a run without a fall: 14 of those double them, and 4 falls
halve them."""

_PUSH_EVERY = (2.0, 4.0)
"""From one push to the next [s]."""


@dataclass(frozen=True, kw_only=True)
class AblationTrial:
    """A run.

    Attributes:
        seed: of everything random.
        leader: `TELEOPERATION` or `WALKING`.
        robot: its name.
        condition: what is not as the controller takes it to be.
        operator: of `OPERATORS`; "" for random velocities of a walk.
        push: change of velocity by each push [m/s].
        off: names of mechanisms that are switched off.
        seconds: length unless the robot falls [s].
    """

    seed: int
    leader: str
    robot: str
    condition: str
    operator: str
    push: float
    off: tuple[str, ...]
    seconds: float


@dataclass(frozen=True, kw_only=True)
class AblationOutcome:
    """The end of a run.

    Attributes:
        trial: the run.
        fell: whether the robot fell, which ends the run.
        time: when the run ended [s].
        torque_steps: changes of a torque from tick to tick by more than half its limit.
        trace: height and velocities at the end; runs with another motion have another number.
        acts: by mechanism that is on, the calls in which it acts.
        error: what went wrong in a run that has no outcome; "" for nothing.
    """

    trial: AblationTrial
    fell: bool
    time: float
    torque_steps: int
    trace: float
    acts: dict[str, int] = field(default_factory=dict[str, int])
    error: str = ""


def draw(seed: int, seconds: float = SECONDS) -> AblationTrial:
    """The run of a seed: leader, robot, condition and switches, all at random."""
    rng = np.random.default_rng((seed, 23))
    leader = TELEOPERATION if rng.random() < _TELEOPERATED else WALKING
    robot = "g1" if rng.random() < _G1 else "humanoid33"
    conditions = _GROUNDS if leader == TELEOPERATION else _COURSES
    condition = conditions[int(rng.integers(len(conditions)))]
    operator = list(OPERATORS)[int(rng.integers(len(OPERATORS)))]
    off = rng.random(len(MECHANISMS)) < OFF
    return AblationTrial(
        seed=seed,
        leader=leader,
        robot=robot,
        condition=condition,
        operator=operator if leader == TELEOPERATION else "",
        push=_FIRST_PUSH[leader],
        off=tuple(
            mechanism.name
            for mechanism, switched in zip(MECHANISMS, off.tolist(), strict=True)
            if switched and has(leader, mechanism)
        ),
        seconds=seconds,
    )


def pushed(trial: AblationTrial, before: Sequence[AblationOutcome]) -> AblationTrial:
    """Choose the size of a run's pushes by former runs of the same leader, robot and condition.

    A weighted staircase: larger by a factor after a run without a fall, and smaller by the power
    (1 - p) / p of that factor after a fall, so that the part p = `FALLS` of the runs ends with one.
    It depends on no switch of the run itself.
    """
    case = trial.leader, trial.robot, trial.condition
    fell = [
        o.fell
        for o in before
        if not o.error and (o.trial.leader, o.trial.robot, o.trial.condition) == case
    ]
    steps = len(fell) - sum(fell) / FALLS
    return replace(trial, push=trial.push * math.exp(_HARDER * steps))


def has(leader: str, mechanism: Mechanism) -> bool:
    """Test for a mechanism of a leader."""
    return mechanism.walks or leader == TELEOPERATION


def run(trial: AblationTrial) -> AblationOutcome:
    """Make a run with its mechanisms switched off."""
    on = [m.name for m in MECHANISMS if m.name not in trial.off and has(trial.leader, m)]
    with without(trial.off), counted(on) as acts:
        try:
            made = _teleoperated(trial) if trial.leader == TELEOPERATION else _walked(trial)
            return replace(made, acts=acts)
        except Exception as error:
            # A mechanism may be what keeps another one from an error: a row says so, and hours of
            # other runs go on.
            text = f"{type(error).__name__}: {error}"
            return AblationOutcome(
                trial=trial, fell=False, time=0.0, torque_steps=0, trace=0.0, error=text
            )


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def _push_times(trial: AblationTrial) -> list[tuple[float, float]]:
    """When pushes begin [s], and their directions [rad]."""
    rng, found = np.random.default_rng((trial.seed, 29)), list[tuple[float, float]]()
    time = float(rng.uniform(*_PUSH_EVERY))
    while time < trial.seconds:
        found.append((time, float(rng.uniform(0.0, 2.0 * math.pi))))
        time += float(rng.uniform(*_PUSH_EVERY))
    return found


def _teleoperated(trial: AblationTrial) -> AblationOutcome:
    robot, seed = _robot(trial.robot), trial.seed
    config = changed_plant(robot, "torque", trial.condition, seed)
    leader = StepTeleoperator(robot)
    leader.device = OPERATORS[trial.operator](leader, seed)
    plant, changes = Plant(robot, config, seed=seed), TorqueSteps(robot)
    plant.reset(None)
    for time, angle in _push_times(trial):
        tick, force, seconds = push(robot, trial.push, angle, time, config.control_dt)
        plant.push(robot.torso, force, seconds, tick * config.control_dt)
    height = spin = 0.0
    ticks = rollout(
        plant,
        leader.controller(),
        leader,
        estimator=leader.estimator,
        duration=trial.seconds,
    )
    for tick in ticks:
        changes.take(tick.command)
        height, spin = float(tick.truth.q[2]), float(tick.truth.v.sum())
        if plant.fallen:
            break
    return AblationOutcome(
        trial=trial,
        fell=plant.fallen,
        time=plant.time,
        torque_steps=changes.large,
        trace=height + spin,
    )


def _walked(trial: AblationTrial) -> AblationOutcome:
    course, sensors = _course(trial)
    outcome = walk_course(
        LedTrial(robot=trial.robot, seed=trial.seed, seconds=trial.seconds, velocity=None),
        course,
        [(time, trial.push, angle) for time, angle in _push_times(trial)],
        sensors,
    )
    return AblationOutcome(
        trial=trial,
        fell=outcome.fell,
        time=outcome.seconds,
        torque_steps=outcome.torque_steps,
        trace=sum(outcome.reached) + outcome.torque_step,
    )


def _course(trial: AblationTrial) -> tuple[Course, SensorConfig]:
    course = replace(make_course("wandering", trial.seed), seconds=trial.seconds)
    sensors = typical_sensors(course.delay)
    if trial.condition == OFF_CELLS:
        force = _CELL_ERROR * _robot(trial.robot).weight
        sensors = replace(sensors, force_bias=force, moment_bias=_CELL_LEVER * force)
    if trial.condition == LATE:
        course = replace(course, delay=_LATE, friction=_SLIPPERY)
        sensors = typical_sensors(_LATE)
    return course, sensors


class Rows:
    """A file with a line of JSON for each run."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> list[AblationOutcome]:
        """All whole lines; one that a run left unfinished as it died is passed over."""
        if not self.path.exists():
            return []
        lines = self.path.read_text(encoding="utf-8").split("\n")
        return [_outcome(json.loads(line)) for line in lines[:-1] if line]

    def append(self, outcome: AblationOutcome) -> None:
        """Write a line, behind a whole one."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a+b") as file:
            size = file.seek(0, 2)
            if size:
                file.seek(size - 1)
                if file.read(1) != b"\n":
                    _cut_last_line(self.path)
            row = asdict(outcome)
            row = {**row.pop("trial"), **row}
            file.write(json.dumps(row).encode() + b"\n")


def _cut_last_line(path: Path) -> None:
    with path.open("r+b") as file:
        file.truncate(file.read().rfind(b"\n") + 1)


def _outcome(row: dict[str, object]) -> AblationOutcome:
    names = AblationTrial.__dataclass_fields__
    trial = {name: row.pop(name) for name in names}
    trial["off"] = tuple(trial["off"])  # type: ignore[arg-type]
    return AblationOutcome(trial=AblationTrial(**trial), **row)  # type: ignore[arg-type]
