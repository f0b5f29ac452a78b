"""Robots with a faulty load cell, or none: standing, walking, and teleoperated."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from poise.apps.teleoperation import BadOperator
from poise.dynamics import RobotState
from poise.locomotion import StepTeleoperator
from poise.robots import load_robot
from poise.sim import Plant, rollout
from studies.bad_operator.conditions import DESCRIBED, changed_plant
from studies.finding import Finding, Section, Table
from studies.locomotion.courses import Course
from studies.locomotion.led_walk import LedTrial, walk_course
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

_BEGIN = 1.6
"""Beginning of a fault [s]."""

_STUCK, _BIAS = 160.0, 1.3
"""Force of a stuck cell [N], and what a biased one makes of the true one."""

_SECONDS, _LONG, _QUICK = 10.0, 600.0, 4.0
"""Length of a run with a fault, of one without cells, and of both with `--quick` [s]."""

_PACE, _PUSH, _PUSH_EVERY = 0.3, 0.3, 4.0
"""Velocity of walks and of pushes [m/s], and the time from one push to the next [s]."""

FAULTS = ("zero", "stuck", "biased", "gone")
NO_CELLS, GOOD = "no cells", "good"
STANDING, WALKING, DRIVEN, PUSHED, TELEOPERATED = (
    "standing",
    "walking",
    "driven",
    "pushed",
    "teleoperated",
)


@dataclass(frozen=True, kw_only=True)
class CellTrial:
    """Run with load cells of a kind.

    Attributes:
        robot: name.
        leader: standing, walking, driven, pushed or teleoperated.
        cells: a fault, or "no cells", or "good".
        foot: with the fault, 0 for the left one.
        seed: of noise and commands.
        seconds: length [s].
    """

    robot: str
    leader: str
    cells: str
    foot: int
    seed: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class CellOutcome:
    """End of a run: whether the robot fell, and when it ended [s]."""

    trial: CellTrial
    fell: bool
    seconds: float


def cells_section(options: StudyOptions, progress: Progress) -> Section:
    """Return the section."""
    seconds = _QUICK if options.quick else _SECONDS
    longer = _QUICK if options.quick else _LONG
    faulty = [
        CellTrial(
            robot=robot, leader=leader, cells=cells, foot=foot, seed=options.seed, seconds=seconds
        )
        for robot, leader, cells, foot in product(
            ("g1", "humanoid33"), (STANDING, WALKING, TELEOPERATED), FAULTS, (0, 1)
        )
    ]
    without = [
        CellTrial(robot="g1", leader=leader, cells=cells, foot=0, seed=options.seed, seconds=longer)
        for leader, cells in product((WALKING, DRIVEN, PUSHED, TELEOPERATED), (GOOD, NO_CELLS))
    ]
    trials = [*faulty, *without]
    outcomes = run_each(run_cells, CellOutcome, trials, progress, options)
    fell = sum(outcomes[t].fell for t in faulty)
    gone = sum(outcomes[t].fell for t in without if t.cells == NO_CELLS)
    good = sum(outcomes[t].fell for t in without if t.cells == GOOD)
    rows = tuple(
        (
            t.robot,
            t.leader,
            t.cells,
            ("left", "right")[t.foot],
            o.seconds,
            "yes" if o.fell else "no",
        )
        for t, o in outcomes.items()
    )
    return Section(
        prose=(
            f"From {_BEGIN:g} s on the cells of one sole read nothing, {_STUCK:g} N, "
            f"{_BIAS:g} times the wrench, or are gone; without cells all wrenches are estimated "
            f"from joint torques. Walks go at {_PACE:g} m/s; pushed robots are pushed by "
            f"{_PUSH:g} m/s every {_PUSH_EVERY:g} s. A run ends with a fall.",
        ),
        findings=(
            Finding(
                name="one faulty cell: falls",
                paper=0,
                ours=fell,
                ok=fell == 0,
                note=f"of {len(faulty)}",
            ),
            Finding(
                name="G1 without cells: falls",
                paper=2,
                ours=gone,
                ok=gone <= 2,
                note=f"at most; of {len(without) // 2} runs, with cells {good}",
            ),
        ),
        tables=(
            Table(title="Runs", header="robot | leader | cells | sole | end [s] | fell", rows=rows),
        ),
    )


def run_cells(trial: CellTrial) -> CellOutcome:
    """Make a run."""
    if trial.leader == TELEOPERATED:
        return _teleoperated(trial)
    led = LedTrial(robot=trial.robot, seed=trial.seed, seconds=trial.seconds)
    velocity = (0.0 if trial.leader == STANDING else _PACE, 0.0, 0.0)
    commands = () if trial.leader == DRIVEN else ((1.0, velocity),)
    course = Course(seconds=trial.seconds, commands=commands)
    pushes: list[tuple[float, float, float]] = []
    if trial.leader == PUSHED:
        rng = np.random.default_rng(trial.seed)
        times = np.arange(_PUSH_EVERY, trial.seconds, _PUSH_EVERY).tolist()
        pushes = [(t, _PUSH, float(rng.uniform(0.0, 2.0 * math.pi))) for t in times]
    outcome = walk_course(led, course, pushes, fault=_fault(trial))
    return CellOutcome(trial=trial, fell=outcome.fell, seconds=outcome.seconds)


def _teleoperated(trial: CellTrial) -> CellOutcome:
    robot, seed = load_robot(trial.robot), trial.seed
    plant = Plant(robot, changed_plant(robot, "torque", DESCRIBED, seed), seed=seed)
    leader, fault = StepTeleoperator(robot), _fault(trial)
    leader.device = BadOperator(leader, seed)
    ticks = rollout(
        plant,
        leader.controller(),
        leader,
        estimator=_Behind(leader, fault),
        duration=trial.seconds,
    )
    for _ in ticks:
        if plant.fallen:
            break
    return CellOutcome(trial=trial, fell=plant.fallen, seconds=plant.time)


class _Behind:
    """Estimator of a teleoperator behind a fault."""

    def __init__(self, leader: StepTeleoperator, fault: Callable[[RobotState], RobotState]) -> None:
        self._estimator, self._fault = leader.estimator, fault
        self.command = leader.estimator.command

    def update(self, state: RobotState) -> RobotState:
        """Return the estimate."""
        return self._estimator.update(self._fault(state))


def _fault(trial: CellTrial) -> Callable[[RobotState], RobotState]:
    sole = tuple(load_robot(trial.robot).soles)[trial.foot]

    def change(state: RobotState) -> RobotState:
        if trial.cells == NO_CELLS:
            return replace(state, contacts={})
        if trial.cells == GOOD or state.time < _BEGIN:
            return state
        contacts = dict(state.contacts)
        wrench = contacts.pop(sole)
        if trial.cells == "zero":
            contacts[sole] = np.zeros(6)
        elif trial.cells == "stuck":
            contacts[sole] = np.array([0.0, 0.0, _STUCK, 0.0, 0.0, 0.0])
        elif trial.cells == "biased":
            contacts[sole] = _BIAS * wrench
        return replace(state, contacts=contacts)

    return change
