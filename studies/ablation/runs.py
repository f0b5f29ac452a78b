"""`draw` and `pushed`: a run of the design. `run`: makes it. `Rows`: the file of outcomes."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from poise.apps.campaigns import RowLog
from poise.apps.scenarios import Scenario
from studies.ablation.mechanisms import MECHANISMS, Mechanism, counted, without
from studies.staged import episode, pushes_on_torso, random_velocities, run_staged
from studies.torque_teleoperation.everything import EverythingOperator

SECONDS = 20.0
"""Length of a run [s]."""

OFF = 0.25
"""Probability with which a run switches a mechanism off."""

TELEOPERATION, WALKING = "step teleoperation", "walking"
_TELEOPERATED, _G1 = 0.75, 0.75
"""Parts of the runs that are teleoperated, and of those on G1."""

EVERYTHING = "everything"
OPERATORS = (EVERYTHING, "bad")
"""Operators of step teleoperation."""

_GROUNDS = {
    "bumps of 2 cm": "bad_operators",
    "sensors off by a constant": "bad_operators",
    "all of another plant": "other_plants",
    "all of them": "bad_operators",
}
"""Conditions of step teleoperation: cases, each with its campaign."""

_TILES, _OFF_CELLS, _LATE = "tiles", "tiles, load cells off", "tiles, late and slippery"
_COURSES: dict[str, dict[str, Any]] = {
    _TILES: {},
    _OFF_CELLS: {"plant.sensors.force_bias": 4.0, "plant.sensors.moment_bias": 0.4},
    _LATE: {"plant.sensors.delay": 0.006, "plant.friction": 0.5},
}
"""Conditions of walking, each with what it changes in the campaign's wandering over tiles."""

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
    """A run."""

    seed: int  # of everything random
    leader: str  # `TELEOPERATION` or `WALKING`
    robot: str  # its name
    condition: str  # what is not as the controller takes it to be
    operator: str  # of `OPERATORS`; "" for random velocities of a walk
    push: float  # change of velocity by each push [m/s]
    off: tuple[str, ...]  # names of mechanisms that are switched off
    seconds: float  # length unless the robot falls [s]


@dataclass(frozen=True, kw_only=True)
class AblationOutcome:
    """The end of a run."""

    trial: AblationTrial  # the run
    fell: bool  # whether the robot fell, which ends the run
    time: float  # when the run ended [s]
    torque_steps: int  # changes of a torque from tick to tick by more than half its limit
    trace: float  # height and velocities at the end; runs with another motion have another number
    # By mechanism that is on, the calls in which it acts
    acts: dict[str, int] = field(default_factory=dict[str, int])
    error: str = ""  # what went wrong in a run that has no outcome; "" for nothing


def draw(seed: int, seconds: float = SECONDS) -> AblationTrial:
    """The run of a seed: leader, robot, condition and switches, all at random."""
    rng = np.random.default_rng((seed, 23))
    leader = TELEOPERATION if rng.random() < _TELEOPERATED else WALKING
    robot = "g1" if rng.random() < _G1 else "humanoid33"
    conditions = [*(_GROUNDS if leader == TELEOPERATION else _COURSES)]
    condition = conditions[int(rng.integers(len(conditions)))]
    operator = OPERATORS[int(rng.integers(len(OPERATORS)))]
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
            operator = None
            if trial.operator == EVERYTHING:
                operator = lambda leader: EverythingOperator(leader, trial.seed)  # noqa: E731
            made = run_staged(_scenario(trial), operator)
            return AblationOutcome(
                trial=trial,
                fell=made.fell,
                time=made.seconds,
                torque_steps=made.torque_steps,
                trace=made.trace,
                acts=acts,
            )
        except Exception as error:
            # A mechanism may be what keeps another one from an error: a row says so, and hours of
            # other runs go on.
            text = f"{type(error).__name__}: {error}"
            return AblationOutcome(
                trial=trial, fell=False, time=0.0, torque_steps=0, trace=0.0, error=text
            )


def _push_times(trial: AblationTrial) -> list[tuple[float, float]]:
    """When pushes begin [s], and their directions [rad]."""
    rng, found = np.random.default_rng((trial.seed, 29)), list[tuple[float, float]]()
    time = float(rng.uniform(*_PUSH_EVERY))
    while time < trial.seconds:
        found.append((time, float(rng.uniform(0.0, 2.0 * math.pi))))
        time += float(rng.uniform(*_PUSH_EVERY))
    return found


def _scenario(trial: AblationTrial) -> Scenario:
    pushes = [(time, trial.push, angle) for time, angle in _push_times(trial)]
    values: dict[str, Any] = {"pushes": pushes_on_torso(pushes)}
    campaign, case = _GROUNDS.get(trial.condition), trial.condition
    if campaign is None:
        campaign, case = "ground", "wandering over tiles"
        values |= _COURSES[trial.condition]
        values["drive.velocities"] = random_velocities(trial.seed, trial.seconds)
    return episode(campaign, case, trial.robot, trial.seed, trial.seconds, values)


class Rows:
    """A file with a line of JSON for each run; one that a run left unfinished is passed over."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> list[AblationOutcome]:
        """All whole lines."""
        return [_outcome(dict(row)) for row in RowLog(self.path).rows]

    def append(self, outcome: AblationOutcome) -> None:
        """Write a line, behind a whole one."""
        row = asdict(outcome)
        RowLog(self.path).add({**row.pop("trial"), **row})


def _outcome(row: dict[str, Any]) -> AblationOutcome:
    trial = {name: row.pop(name) for name in AblationTrial.__dataclass_fields__}
    trial["off"] = tuple(trial["off"])
    return AblationOutcome(trial=AblationTrial(**trial), **row)
