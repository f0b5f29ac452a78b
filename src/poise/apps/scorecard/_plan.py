"""`Plan`: which trials a robot and its controller are put to, and each one's episodes."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from poise.apps.campaigns import Job, robot_files, version
from poise.apps.scenarios import controller_names, read_scenario, stage_scenario
from poise.apps.scorecard._card import Card, TrialResult
from poise.apps.scorecard._trials import TRIALS, VERSION, Place, Trial
from poise.errors import ConfigurationError, PoiseError, UnknownNameError
from poise.robots import Robot, load_robot
from poise.sim import Plant

NAME = "scorecard"
"""What its folder calls a card, where campaigns have their names."""

BY_HAND = "step_teleoperation"
"""The controller whose robot an operator leads: it stands by resting devices."""

_SCENES = Path(__file__).parent / "scenes"
_MOST_CASES, _MOST_SEEDS, _MOST_LOOKS = 1000, 1000, 100
"""Numbers of episodes leave room for so many."""


@dataclass(frozen=True, kw_only=True)
class Extent:
    """How thoroughly a card is made.

    Attributes:
        quick: what a card calls it.
        seeds: of each trial.
        directions: of pushes.
        phases: of a step at which a walking robot is pushed.
        looks: of each bisection.
        operators: seeds of trials that count who survives.
        operator_time: how long a bad operator goes on [s].
    """

    quick: bool
    seeds: int
    directions: int
    phases: tuple[float, ...]
    looks: int
    operators: int
    operator_time: float


QUICK = Extent(
    quick=True,
    seeds=3,
    directions=4,
    phases=(0.1, 0.7),
    looks=5,
    operators=8,
    operator_time=10.0,
)
"""Minutes on two cores."""

FULL = Extent(
    quick=False,
    seeds=10,
    directions=12,
    phases=(0.1, 0.3, 0.5, 0.7, 0.9),
    looks=8,
    operators=100,
    operator_time=60.0,
)
"""Hours on a cluster."""


@dataclass(frozen=True)
class Case:
    """A trial in one direction and at one phase, where it has those.

    Attributes:
        trial: the trial.
        index: of the case in its trial.
        angle: direction, anticlockwise from ahead [rad]; None without.
        phase: of the step; None without.
    """

    trial: Trial
    index: int = 0
    angle: float | None = None
    phase: float | None = None


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A card that is to be made.

    Attributes:
        robot: its name or file.
        controller: its name.
        strategy: how it solves; its default when None.
        extent: how thoroughly.
        trials: names of the trials; all when empty.
    """

    robot: str
    controller: str
    strategy: str | None = None
    extent: Extent = FULL
    trials: tuple[str, ...] = ()
    loaded: Robot = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        known = [trial.name for trial in TRIALS]
        for name in self.trials:
            if name not in known:
                raise UnknownNameError("no such trial", got=name, choices=known)
        if self.controller not in controller_names():
            raise UnknownNameError(
                "no such controller", got=self.controller, choices=controller_names()
            )
        robot = load_robot(self.robot)
        if not robot.floating_base or len(robot.soles) != 2:
            raise ConfigurationError(
                "a scorecard is of robots that stand on two feet",
                got=robot.name,
                wanted="a floating base and two soles",
            )
        object.__setattr__(self, "loaded", robot)

    @property
    def content(self) -> dict[str, Any]:
        """What makes two runs the same card, as JSON."""
        about = {
            "name": NAME,
            "robot": self.robot,
            "controller": self.controller,
            "strategy": self.strategy,
            "quick": self.extent.quick,
            "trials_version": VERSION,
            "version": version(),
        }
        return {"campaign": about, "scenario": {}, "robots": robot_files([self.robot])}

    def card(self, trials: Sequence[TrialResult], left_out: Mapping[str, str]) -> Card:
        """The plan's card."""
        return Card(
            robot=self.loaded.name,
            controller=self.controller,
            strategy=self.strategy,
            version=version(),
            trials_version=VERSION,
            quick=self.extent.quick,
            trials=tuple(trials),
            left_out=dict(left_out),
        )

    def cases(self) -> tuple[list[Case], dict[str, str]]:
        """All cases that can be tried, and why each of the other trials cannot, by its name."""
        cases: list[Case] = []
        left_out: dict[str, str] = {}
        refused: dict[str, str] = {}
        for trial in TRIALS:
            if self.trials and trial.name not in self.trials:
                continue
            reason = refused.get(trial.scene) or self._unfit(trial)
            if reason:
                left_out[trial.name] = reason
                if trial.scene not in refused and self._scene_unfit(trial):
                    refused[trial.scene] = reason
            else:
                cases += self.spread(trial)
        return cases, left_out

    def spread(self, trial: Trial) -> list[Case]:
        """The cases of a trial."""
        angles: Sequence[float | None] = (None,)
        phases: Sequence[float | None] = (None,)
        if trial.spread != "once":
            count = 4 if trial.spread == "quarters" else self.extent.directions
            angles = [math.tau * i / count for i in range(count)]
        if trial.spread == "phases":
            phases = self.extent.phases
        pairs = [(phase, angle) for phase in phases for angle in angles]
        return [Case(trial, i, angle, phase) for i, (phase, angle) in enumerate(pairs)]

    def seeds(self, trial: Trial) -> range:
        """Seeds of a trial."""
        return range(self.extent.operators if trial.share else self.extent.seeds)

    def job(self, case: Case, seed: int, look: int, level: float) -> Job:
        """An episode; its number and content do not depend on who runs it, or when."""
        trial, scene = case.trial, self._scene(case.trial)
        place = Place(
            robot=self.loaded,
            links=self._links,
            control_dt=scene["plant"]["control_dt"],
            angle=case.angle or 0.0,
            phase=case.phase or 0.0,
            seed=seed,
        )
        number = (TRIALS.index(trial) * _MOST_CASES + case.index) * _MOST_SEEDS + seed
        return Job(
            number=number * _MOST_LOOKS + look,
            scenario=scene,
            where=scene["name"],
            values=trial.values(level, place),
            seed=seed,
            labels={"trial_name": trial.name, "case": case.index, "look": look, "level": level},
        )

    @cached_property
    def _links(self) -> tuple[str, ...]:
        """What the plant calls the links: a description may have other names for some."""
        model = Plant(self.loaded).model
        masses = zip(range(model.nbody), model.body_mass.tolist(), strict=True)
        return tuple(model.body(i).name for i, mass in masses if mass > 0.0)

    def _scene(self, trial: Trial) -> dict[str, Any]:
        by_hand = self.controller == BY_HAND and trial.scene == "stand"
        scene, _ = read_scenario(_SCENES / f"{trial.scene}{'_by_hand' if by_hand else ''}.yaml")
        controller: dict[str, Any] = {"name": self.controller}
        if self.strategy is not None:
            controller["strategy"] = self.strategy
        robot = str(Path(self.robot).resolve()) if Path(self.robot).is_file() else self.robot
        scene |= {"robot": robot, "controller": controller}
        if trial.scene == "bad_operator":
            scene["duration"] = self.extent.operator_time
        # Plain data, without the lines of the file that its reader keeps.
        return json.loads(json.dumps(scene))

    def _unfit(self, trial: Trial) -> str:
        """Why a trial cannot be begun even at its easy end; "" where it can."""
        try:
            stage_scenario(self.job(self.spread(trial)[0], 0, 0, 0.0).make())
        except PoiseError as error:
            return str(error)
        return ""

    def _scene_unfit(self, trial: Trial) -> bool:
        """Whether it is the scene that cannot be begun."""
        try:
            job = self.job(self.spread(trial)[0], 0, 0, 0.0)
            stage_scenario(Job(number=0, scenario=job.scenario, where=job.where).make())
        except PoiseError:
            return True
        return False
