"""`cells_section`: robots with a faulty load cell, or none: standing, walking, and teleoperated."""

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from poise.apps.scenarios import Scenario
from poise.robots import load_robot
from studies.locomotion.estimated_walk import FAULTS, GOOD, NO_CELLS, cell_fault
from studies.plan import StudyOptions
from studies.staged import Outcome, episode, pushes_on_torso, random_velocities, run_staged
from studies.trial_section import Case, TrialSection, total

_SECONDS, _LONG, _QUICK = 10.0, 600.0, 4.0
"""Length of a run with a fault, of one without cells, and of both with `--quick` [s]."""

_PACE, _PUSH, _PUSH_EVERY = 0.3, 0.3, 4.0
"""Velocity of walks and of pushes [m/s], and the time from one push to the next [s]."""

STANDING, WALKING, DRIVEN = "standing", "walking", "driven"
PUSHED, TELEOPERATED = "pushed", "teleoperated"


@dataclass(frozen=True, kw_only=True)
class CellTrial:
    """Run with load cells of a kind."""

    robot: str  # name
    leader: str  # standing, walking, driven at random, pushed or teleoperated
    cells: str  # a fault, see `cell_fault`
    foot: int  # with the fault, 0 for the left one
    seed: int  # of noise and commands
    seconds: float  # length [s]


def run_cells(trial: CellTrial) -> Outcome:
    """Make a run."""
    fault = cell_fault(load_robot(trial.robot), trial.cells, trial.foot)
    return run_staged(_scenario(trial), fault=fault)


def _scenario(trial: CellTrial) -> Scenario:
    robot, seed, seconds = trial.robot, trial.seed, trial.seconds
    if trial.leader == TELEOPERATED:
        return episode("bad_operators", "as described", robot, seed, seconds)
    pace = 0.0 if trial.leader == STANDING else _PACE
    values: dict[str, Any] = {"drive.velocities": [{"at": 1.0, "velocity": [pace, 0.0, 0.0]}]}
    if trial.leader == DRIVEN:
        values = {"drive.velocities": random_velocities(seed, seconds)}
    if trial.leader == PUSHED:
        rng = np.random.default_rng(seed)
        times = np.arange(_PUSH_EVERY, seconds, _PUSH_EVERY).tolist()
        pushes = [(t, _PUSH, float(rng.uniform(0.0, 2.0 * math.pi))) for t in times]
        values["pushes"] = pushes_on_torso(pushes)
    return episode("ground", "flat ground", robot, seed, seconds, values)


def _cases(options: StudyOptions) -> list[Case]:
    def trials(robot: str, leader: str, cells: str, *feet: int) -> list[CellTrial]:
        seconds = _LONG if cells in (GOOD, NO_CELLS) else _SECONDS
        return [
            CellTrial(
                robot=robot,
                leader=leader,
                cells=cells,
                foot=foot,
                seed=options.seed,
                seconds=_QUICK if options.quick else seconds,
            )
            for foot in feet
        ]

    faulty = [
        Case(
            name=f"{robot}, {leader}, one faulty cell",
            trials=[t for fault in FAULTS for t in trials(robot, leader, fault, 0, 1)],
        )
        for robot, leader in product(("g1", "humanoid33"), (STANDING, WALKING, TELEOPERATED))
    ]
    longer = (WALKING, DRIVEN, PUSHED, TELEOPERATED)
    whole = [
        Case(
            name=f"g1, {cells}",
            trials=[t for leader in longer for t in trials("g1", leader, cells, 0)],
            allowed=allowed,
        )
        for cells, allowed in ((NO_CELLS, lambda _: 2.0), (GOOD, None))
    ]
    return [*faulty, *whole]


cells_section = TrialSection(
    title="Load cells",
    prose=(
        "From 1.6 s on the cells of one sole read nothing, 160 N, 1.3 times the wrench, or are "
        "gone; without cells all wrenches are estimated from joint torques. Walks go at "
        f"{_PACE:g} m/s; pushed robots are pushed by {_PUSH:g} m/s every {_PUSH_EVERY:g} s.",
    ),
    run=run_cells,
    kind=Outcome,
    cases=_cases,
    columns={"time [s]": total("seconds")},
)
"""The section."""
