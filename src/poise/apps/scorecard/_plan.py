"""`Plan`: the trials of a robot and its controller, and the job of each episode."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from poise.apps.campaigns import CampaignFolder, Job, robot_files, version
from poise.apps.scenarios import controller_names, read_scenario, stage_scenario
from poise.apps.scorecard._card import Card, TrialResult
from poise.apps.scorecard._trials import TRIALS, VERSION, Place, Trial
from poise.errors import ConfigurationError, PoiseError, UnknownNameError
from poise.robots import Robot, load_robot
from poise.sim import Plant

_NAME = "scorecard"  # of a card in its folder, where campaigns have their names

BY_HAND = "step_teleoperation"
"""The controller of step teleoperation, with devices at rest."""

_SCENES = Path(__file__).parent / "scenes"


@dataclass(frozen=True, kw_only=True)
class Extent:
    """The thoroughness of a card."""

    quick: bool  # its name in a card
    seeds: int  # of each trial
    directions: int  # of pushes
    phases: tuple[float, ...]  # of a step at which a walking robot is pushed
    looks: int  # of each bisection
    operators: int  # seeds of trials that count who survives
    operator_time: float  # duration of a bad operator [s]


QUICK = Extent(
    quick=True, seeds=3, directions=4, phases=(0.1, 0.7), looks=5, operators=8, operator_time=10.0
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
    """A trial in one direction and at one phase, where it has those."""

    trial: Trial
    index: int = 0  # in the trial
    angle: float | None = None  # anticlockwise from ahead [rad]
    phase: float | None = None  # of the step


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A card that is to be made."""

    robot: str  # name or file
    controller: str
    strategy: str | None = None  # the controller's default when None
    extent: Extent = FULL
    trials: tuple[str, ...] = ()  # by name; all when empty

    def __post_init__(self) -> None:
        for what, given, known in (
            ("trial", self.trials, [trial.name for trial in TRIALS]),
            ("controller", (self.controller,), controller_names()),
        ):
            for name in given:
                if name not in known:
                    raise UnknownNameError(f"no such {what}", got=name, choices=known)
        if not self.loaded.floating_base or len(self.loaded.soles) != 2:
            raise ConfigurationError(
                "a scorecard is of robots that stand on two feet",
                got=self.loaded.name,
                wanted="a floating base and two soles",
            )

    @classmethod
    def of(cls, folder: CampaignFolder) -> "Plan":
        """The plan of the card in a folder."""
        about = folder.content()["campaign"]
        if about.get("name") != _NAME:
            raise ConfigurationError("no scorecard in this folder", got=str(folder.path))
        kept = {key: about[key] for key in ("robot", "controller", "strategy")}
        return cls(**kept, extent=QUICK if about["quick"] else FULL)

    @cached_property
    def loaded(self) -> Robot:
        """The robot."""
        return load_robot(self.robot)

    @property
    def content(self) -> dict[str, Any]:
        """All that makes two runs the same card, as JSON."""
        about = {
            "name": _NAME,
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
        scenes: dict[str, str] = {}
        for trial in TRIALS:
            if self.trials and trial.name not in self.trials:
                continue
            # Even at its easy end.
            job = self.job(self.spread(trial)[0], 0, 0, 0.0)
            reason = scenes.get(trial.scene) or _unfit(job)
            if not reason:
                cases += self.spread(trial)
                continue
            left_out[trial.name] = reason
            if trial.scene not in scenes:
                bare = Job(number=0, scenario=job.scenario, where=job.where)
                scenes[trial.scene] = reason if _unfit(bare) else ""
        return cases, left_out

    def spread(self, trial: Trial) -> list[Case]:
        """The cases of a trial."""
        count = {"once": 0, "quarters": 4}.get(trial.spread, self.extent.directions)
        angles = [math.tau * i / count for i in range(count)] or [None]
        phases = self.extent.phases if trial.spread == "phases" else (None,)
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
        # There is room for 1000 cases of 1000 seeds of 100 looks.
        number = (TRIALS.index(trial) * 1000 + case.index) * 1000 + seed
        return Job(
            number=number * 100 + look,
            scenario=scene,
            where=scene["name"],
            values=trial.values(level, place),
            seed=seed,
            labels={"trial_name": trial.name, "case": case.index, "look": look, "level": level},
        )

    @cached_property
    def _links(self) -> tuple[str, ...]:
        """The plant's names of the links: a description may have other names for some."""
        model = Plant(self.loaded).model
        masses = zip(range(model.nbody), model.body_mass.tolist(), strict=True)
        return tuple(model.body(i).name for i, mass in masses if mass > 0.0)

    def _scene(self, trial: Trial) -> dict[str, Any]:
        by_hand = self.controller == BY_HAND and trial.scene == "stand"
        scene, _ = read_scenario(_SCENES / f"{trial.scene}{'_by_hand' if by_hand else ''}.yaml")
        strategy = {} if self.strategy is None else {"strategy": self.strategy}
        robot = str(Path(self.robot).resolve()) if Path(self.robot).is_file() else self.robot
        scene |= {"robot": robot, "controller": {"name": self.controller, **strategy}}
        if trial.scene == "bad_operator":
            scene["duration"] = self.extent.operator_time
        # Plain data, without the lines of the file that its reader keeps.
        return json.loads(json.dumps(scene))


def _unfit(job: Job) -> str:
    """Return the reason why an episode cannot begin; "" for none."""
    try:
        stage_scenario(job.make())
    except PoiseError as error:
        return str(error)
    return ""
