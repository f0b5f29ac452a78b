"""Pushes on a robot that stands and makes no step: ankles, hips, arms and trunk are all it has."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from poise.control import WholeBodyController
from poise.locomotion import walking_stack
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, rollout
from poise.stack import Stack, default_stack
from studies.finding import Finding, Section, Table
from studies.locomotion.late_estimate import PERIOD, LateEstimate, typical_sensors
from studies.locomotion.led_walk import PUSH_TIME
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

STACKS: Mapping[str, Callable[[Robot], Stack]] = {
    "default_stack": default_stack,
    "walking_stack": walking_stack,
}
"""Stacks that are tried, by name."""

_ROBOT, _PUSH = "g1", 0.33
"""Asked for: what the pendulum with the robot's feet stands at most [m/s]."""

_MORE = (0.36, 0.40)
"""Pushes beyond that, for the table [m/s]."""

_AT, _SECONDS = 1.0, 4.0
"""When the push begins, and how long a trial takes [s]."""

_DIRECTIONS = 12
_SEEDS, _QUICK_SEEDS = 20, 1


@dataclass(frozen=True, kw_only=True)
class StandingPush:
    """What a worker is asked for.

    Attributes:
        stack: of `STACKS`.
        seed: of noise and biases.
        push: change of the robot's velocity [m/s].
        direction: of the push, in twelfths of a turn from ahead to the left.
    """

    stack: str
    seed: int
    push: float
    direction: int


@dataclass(frozen=True, kw_only=True)
class StandingOutcome:
    """What became of a trial.

    Attributes:
        trial: the trial.
        fell: whether the robot fell.
    """

    trial: StandingPush
    fell: bool


def run_standing_push(trial: StandingPush) -> StandingOutcome:
    """Stands, and is pushed on the torso; nobody leads the stack."""
    robot = load_robot(_ROBOT)
    config = PlantConfig(control_dt=PERIOD, sensors=typical_sensors())
    plant = Plant(robot, config, seed=trial.seed)
    force = robot.mass * trial.push / PUSH_TIME
    angle = 2.0 * math.pi * trial.direction / _DIRECTIONS
    x, y = force * math.cos(angle), force * math.sin(angle)
    plant.push(robot.torso, (x, y, 0.0), PUSH_TIME, _AT)
    controller = WholeBodyController(robot, STACKS[trial.stack](robot))
    for _ in rollout(plant, controller, estimator=LateEstimate(robot), duration=_SECONDS):
        pass
    return StandingOutcome(trial=trial, fell=plant.fallen)


def standing_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    first = options.seed * _SEEDS
    seeds = [first + i for i in range(options.count(_SEEDS, _QUICK_SEEDS))]
    directions = range(0, _DIRECTIONS, 6 if options.quick else 1)
    groups = {
        (stack, push): [
            StandingPush(stack=stack, seed=seed, push=push, direction=k)
            for seed in seeds
            for k in directions
        ]
        for stack in STACKS
        for push in ((_PUSH,) if options.quick else (_PUSH, *_MORE))
    }
    trials = [trial for group in groups.values() for trial in group]
    outcomes = run_each(run_standing_push, StandingOutcome, trials, progress, options)
    stood: dict[tuple[str, float], dict[int, float]] = {}
    for key, group in groups.items():
        falls = {k: [outcomes[t].fell for t in group if t.direction == k] for k in directions}
        stood[key] = {k: 100.0 * (1.0 - sum(fell) / len(fell)) for k, fell in falls.items()}
    return Section(
        prose=(
            f"Pushes of {PUSH_TIME:g} s on the torso of G1, which stands with its feet side by "
            "side and makes no step: nobody leads its stack. On the estimate, with noise and "
            "delay. The bound is what the linear pendulum with its feet stands.",
        ),
        findings=tuple(_finding(stack, stood[stack, _PUSH], len(seeds)) for stack in STACKS),
        tables=(_table(stood),),
    )


def _finding(stack: str, stood: Mapping[int, float], seeds: int) -> Finding:
    weakest = min(stood.values())
    return Finding(
        name=f"{_ROBOT}, {stack}: pushes of {_PUSH:g} m/s without steps, weakest direction",
        paper=95.0,
        ours=weakest,
        unit="%",
        ok=bool(weakest >= 95.0),
        note=f"survived, at least; {seeds} seeds in each of {len(stood)} directions",
    )


def _table(stood: Mapping[tuple[str, float], Mapping[int, float]]) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for (stack, push), directions in stood.items():
        weak = [f"{360 * k // _DIRECTIONS}" for k, share in directions.items() if share < 100.0]
        rows.append((stack, push, min(directions.values()), ", ".join(weak) or "none"))
    return Table(
        title="Pushes without steps",
        header="stack | push [m/s] | weakest direction [%] | directions with falls [deg]",
        rows=tuple(rows),
        caption="Directions from ahead to the left.",
    )
