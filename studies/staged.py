"""`episode`: a scenario of a campaign beside the studies. `run_staged`: runs it with changes.

A campaign says what floors, bodies, sensors and pushes are like; what its language has no words
for, an operator or a fault of load cells, is a change here.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.campaigns import Design
from poise.apps.scenarios import Scenario, stage_scenario
from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import UnknownNameError
from poise.locomotion import Device, StepTeleoperator
from poise.robots import Robot, load_robot
from poise.sim import rollout

CAMPAIGNS = Path(__file__).parent / "campaigns"
"""Folder of the campaigns and their scenarios."""

_LONGEST = 1e3
"""No run is longer [s]."""

_LARGE = 0.5
"""Changes of a torque above this, by its limit, are counted."""

MakeDevice = Callable[[StepTeleoperator], Device]
Fault = Callable[[RobotState], RobotState]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The end of a run."""

    fell: bool  # whether the robot fell, which ends the run
    seconds: float  # when the run ended [s]
    steps: int  # how often a foot was lifted under an operator
    tilt: float  # largest angle of the base from upright [rad]
    torque_steps: int  # changes of a torque from tick to tick by more than half its limit
    trace: float  # height and velocities at the end; runs with another motion have another number


@cache
def _design(campaign: str) -> Design:
    return Design.load(CAMPAIGNS / f"{campaign}.yaml")


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def episode(
    campaign: str,  # its file, without the suffix
    case: str,  # of the campaign
    robot: str,  # name
    seed: int,  # of all that is drawn
    seconds: float,  # length [s]; what would begin later is left out
    values: Mapping[str, Any] | None = None,  # of further fields, by path
) -> Scenario:
    """Draw the scenario of a case of a campaign."""
    design = _design(campaign)
    cases = [*design.campaign.cases]
    if case not in cases:
        raise UnknownNameError(f"no such case of {campaign}", got=case, choices=cases)
    # A grid begins again at multiples of the number of episodes.
    jobs = (design.job(seed * design.count + point) for point in range(design.count))
    job = next(job for job in jobs if job.labels["case"] == case)
    fields = {**(values or {}), "duration": _LONGEST}
    # A field takes the place of all that the case sets inside it.
    within = tuple(name + mark for name in fields for mark in "[.")
    kept = {name: value for name, value in job.values.items() if not name.startswith(within)}
    drawn = replace(job, values=kept | fields).make()
    drive = drawn.drive
    if drive is not None:
        left = tuple(command for command in drive.velocities if command.at < seconds)
        drive = replace(drive, velocities=left)
    return replace(
        drawn,
        robot=robot,
        seed=seed,
        duration=seconds,
        drive=drive,
        pushes=tuple(push for push in drawn.pushes if push.at < seconds),
        checks=(),
    )


def pushes_on_torso(pushes: Sequence[tuple[float, float, float]]) -> list[dict[str, Any]]:
    """The field `pushes`: times [s], changes of velocity [m/s], directions from x to y [rad]."""
    return [
        {
            "body": "torso",
            "at": at,
            "duration": 0.1,
            "velocity_change": [speed * math.cos(angle), speed * math.sin(angle), 0.0],
        }
        for at, speed, angle in pushes
    ]


def random_velocities(seed: int, seconds: float) -> list[dict[str, Any]]:
    """The field `drive.velocities`: another one every 1 to 4 s, a fifth of them zero."""
    rng, time, found = np.random.default_rng(seed), 1.0, list[dict[str, Any]]()
    while time < seconds:
        velocity = rng.uniform((-0.4, -0.25, -0.6), (0.6, 0.25, 0.6)) * (rng.random() >= 0.2)
        found.append({"at": time, "velocity": velocity.tolist()})
        time += float(rng.uniform(1.0, 4.0))
    return found


class _Behind:
    """An estimator behind a fault of what is measured."""

    def __init__(self, estimator: object, fault: Fault) -> None:
        self._update: Fault = getattr(estimator, "update")  # noqa: B009
        self._fault = fault
        self.command = getattr(estimator, "command", _ignore)

    def update(self, state: RobotState) -> RobotState:
        """Return the estimate."""
        return self._update(self._fault(state))


def _ignore(*_: object) -> None:
    """Take no notice of a command."""


class TorqueSteps:
    """Counts changes of torques by more than half a limit from tick to tick."""

    def __init__(self, robot: Robot) -> None:
        self.large, self._limits = 0, robot.tau_max
        self._last: Float64[np.ndarray, " nj"] | None = None

    def take(self, command: Command) -> None:
        """Take the next tick's command into account."""
        torque = command.torque
        if torque is not None and self._last is not None:
            change = np.abs(torque - self._last) / self._limits
            self.large += int((change > _LARGE + 1e-9).sum())
        self._last = None if torque is None else torque.copy()


def run_staged(
    scenario: Scenario, operator: MakeDevice | None = None, fault: Fault | None = None
) -> Outcome:
    """Run a scenario to its end or a fall."""
    stage = stage_scenario(scenario, _robot(scenario.robot))
    leader, plant, estimator = stage.leader, stage.plant, stage.estimator
    by_hand = leader if isinstance(leader, StepTeleoperator) else None
    if operator is not None and by_hand is not None:
        by_hand.device = operator(by_hand)
    if fault is not None:
        estimator = _Behind(estimator, fault)
    changes, steps, lifted, upright, trace = TorqueSteps(stage.robot), 0, False, 1.0, 0.0
    for tick in rollout(
        plant, stage.controller, leader, estimator=estimator, duration=scenario.duration
    ):
        changes.take(tick.command)
        single = by_hand is not None and by_hand.mode.single
        steps += single and not lifted
        lifted, (x, y) = single, tick.truth.q[3:5].tolist()
        upright = min(upright, 1.0 - 2.0 * (x * x + y * y))
        trace = float(tick.truth.q[2] + tick.truth.v.sum())
    return Outcome(
        fell=plant.fallen,
        seconds=plant.time,
        steps=steps,
        tilt=float(np.arccos(max(upright, -1.0))),
        torque_steps=changes.large,
        trace=trace,
    )
