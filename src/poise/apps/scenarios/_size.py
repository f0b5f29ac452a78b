"""A scenario written for one robot, on another: of another size, or without hands."""

import math
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar, cast

import pinocchio as pin

from poise.apps.scenarios._metrics import METRICS
from poise.apps.scenarios._scenario import (
    CheckPlan,
    PushPlan,
    Scenario,
    TargetMotion,
    VelocityCommand,
)
from poise.locomotion import Gait, Stride, WayPoint
from poise.robots import Robot
from poise.sim import Block, PlantConfig
from poise.stack import Stack

T = TypeVar("T")

_HANDS = ("left_hand", "right_hand")
"""Names of tasks of hands on a robot's own stack."""

_LENGTHS: dict[type, tuple[str, ...]] = {
    Block: ("center", "size", "top"),
    PlantConfig.Payload: ("offset", "radius"),
    Stride: ("length", "sideways"),
    Gait: ("swing_height", "crouch", "width"),
    TargetMotion: ("to", "by"),
    WayPoint: ("left", "right", *_HANDS),
}
"""Fields that go with the size of the robot."""

_SPEEDS: dict[type, tuple[str, ...]] = {
    PushPlan: ("velocity_change",),
    VelocityCommand: ("velocity",),
}
"""Fields that go with the root of its size: a pendulum c high takes an equal share of its height
to brake v = share sqrt(g c)."""


def size_ratio(scenario: Scenario, robot: Robot) -> float:
    """Height of the CoM at home over that for which the scenario is written; one where unknown."""
    if scenario.reference_com_height is None:
        return 1.0
    height = pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)[2]
    ratio = float(height) / scenario.reference_com_height
    # Heights in files are rounded.
    return 1.0 if abs(ratio - 1.0) < 1e-3 else ratio


def without_hands(scenario: Scenario, robot: Robot) -> Scenario:
    """Leave out motions and checks of hands in a walk on the own stack of a robot without any."""
    if robot.hands or scenario.stack is not None or scenario.walk is None:
        return scenario
    return replace(
        scenario,
        motions=tuple(m for m in scenario.motions if m.task not in _HANDS),
        checks=tuple(c for c in scenario.checks if c.task not in _HANDS),
    )


def sized(plan: T, ratio: float) -> T:
    """Scale the lengths and changes of speed of a scenario or a part of it, checks left out.

    Times, angles, forces and goals given by the arm's length stay.
    """
    return plan if ratio == 1.0 else _sized(plan, ratio)


def _sized(plan: Any, ratio: float) -> Any:
    if isinstance(plan, tuple):
        parts = tuple(_sized(part, ratio) for part in plan)
        return parts if any(a is not b for a, b in zip(parts, plan, strict=True)) else plan
    if not is_dataclass(plan) or isinstance(plan, CheckPlan):
        return plan
    given = {f.name: getattr(plan, f.name) for f in fields(plan)}
    made = {name: _sized(part, ratio) for name, part in given.items()}
    for name in _LENGTHS.get(type(plan), ()):
        made[name] = _scaled(given[name], ratio)
    for name in _SPEEDS.get(type(plan), ()):
        made[name] = _scaled(given[name], math.sqrt(ratio))
    if isinstance(plan, VelocityCommand):
        made["velocity"] = (*made["velocity"][:2], plan.velocity[2])
    changed = {name: part for name, part in made.items() if part is not given[name]}
    return replace(cast("Any", plan), **changed) if changed else plan


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, tuple):
        return tuple(factor * part for part in value)
    return None if value is None else factor * value


def sized_checks(
    checks: tuple[CheckPlan, ...], stack: Stack, ratio: float
) -> tuple[CheckPlan, ...]:
    """Scale bounds in metres and metres a second, but not those of whole poses, in m and rad."""
    units = {task.name: task.unit for _, task in stack.tasks()}
    made: list[CheckPlan] = []
    for check in checks:
        if (METRICS[check.metric].unit or units.get(check.task or "")) in ("m", "m/s"):
            side = "at_least" if check.at_most is None else "at_most"
            check = replace(check, **{side: ratio * check.bound})
        made.append(check)
    return tuple(made)
