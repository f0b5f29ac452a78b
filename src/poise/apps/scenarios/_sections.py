"""Reading the walk of a scenario file, and making its walker on a robot.

Reading the plant's section of a scenario file into a `PlantConfig`.
Reading the hands of a scenario file into a `HandsPlan`.
"""

from dataclasses import MISSING, dataclass, field
from dataclasses import fields as dataclass_fields
from itertools import pairwise
from typing import Any, TypeVar, get_args

import numpy as np

from poise._fields import Fields
from poise.apps.scenarios._by_hand import HandsPlan
from poise.errors import ScenarioError, UnknownNameError
from poise.locomotion import (
    Gait,
    Ground,
    Platform,
    Stride,
    Walker,
    WalkSettings,
    WayPoint,
    plan_footsteps,
)
from poise.robots import Robot
from poise.sim import Actuation, Block, LinkError, Payload, PlantConfig, SensorConfig, ServoConfig
from poise.stack import Stack

_VECTORS = {"floor_slope": 2, "offset": 3, "com_offset": 3, "center": 2, "size": 3}
_FARTHEST = 1e2
"""No place or angle in a plant is farther than this [m, rad]: MuJoCo loses its accuracy there."""

_LARGEST = 1e6
"""No other number of a plant is larger, whatever its unit."""

_TEXTS = ("actuation", "frame", "link")
_SECTIONS: dict[str, type] = {"servo": ServoConfig, "sensors": SensorConfig}
_LISTS: dict[str, type] = {"blocks": Block, "link_errors": LinkError, "payloads": Payload}


def read_plant(data: object, where: str) -> PlantConfig:
    """The plant's configuration; the keys are `PlantConfig`'s own.

    Args:
        data: the section of the file.
        where: the file and the key, for messages.

    Raises:
        ScenarioError: an unknown key, a missing key, or a value of the wrong kind.
        ConfigurationError: values that cannot be right.
    """
    return _read(PlantConfig, data, where)


def _read(kind: type, data: object, where: str) -> Any:
    names = tuple(f.name for f in dataclass_fields(kind))
    fields = Fields(data, where, names, error=ScenarioError)
    values: dict[str, Any] = {}
    for name in fields:
        if name in _SECTIONS:
            values[name] = _read(_SECTIONS[name], fields.raw(name), f"{where}.{name}")
        elif name in _LISTS:
            values[name] = _read_list(_LISTS[name], fields.raw(name), f"{where}.{name}")
        elif name in _TEXTS:
            values[name] = fields.text(name)
            if name == "actuation" and values[name] not in get_args(Actuation):
                raise UnknownNameError(
                    f"unknown actuation in {where}", got=values[name], choices=get_args(Actuation)
                )
        elif name in _VECTORS:
            numbers = fields.numbers(name, _VECTORS[name])
            _check_size(fields, name, float(np.abs(numbers).max()), _FARTHEST)
            values[name] = tuple(numbers.tolist())
        else:
            values[name] = fields.number(name)
            _check_size(fields, name, abs(values[name]), _LARGEST)
    needed = [
        f.name
        for f in dataclass_fields(kind)
        if f.default is MISSING and f.default_factory is MISSING and f.name not in values
    ]
    if needed:
        raise ScenarioError(f"{where} lacks keys", got=sorted(values), choices=needed)
    return kind(**values)


def _check_size(fields: Fields, key: str, size: float, largest: float) -> None:
    if size > largest:
        raise ScenarioError(
            f"{fields.where}: {key} is out of range", got=size, wanted=f"at most {largest:g}"
        )


def _read_list(kind: type, items: object, where: str) -> tuple[Any, ...]:
    if not isinstance(items, list):
        raise ScenarioError(f"{where} has the wrong kind", got=items, wanted="a list")
    return tuple(_read(kind, item, f"{where}, entry {i + 1}") for i, item in enumerate(items))


_FARTHEST = 10.0
"""No hand goes farther from where it began [m]."""


def read_hands(data: object, where: str) -> HandsPlan:
    """What the operator's hands do.

    Args:
        data: the section of the file: `script`, or `points`.
        where: the file and the key, for messages.

    Raises:
        ScenarioError: an unknown key, a missing key, or a value of the wrong kind.
        UnknownNameError: no such script.
    """
    fields = Fields(data, where, ("script", "points"), error=ScenarioError)
    script = fields.text("script") if "script" in fields else ""
    items = fields.raw("points") if "points" in fields else []
    if not isinstance(items, list):
        raise ScenarioError(f"{where}.points has the wrong kind", got=items, wanted="a list")
    points = [
        _point(
            Fields(item, f"{where}, point {i + 1}", ("at", "left", "right"), error=ScenarioError)
        )
        for i, item in enumerate(items)
    ]
    for before, after in pairwise(points):
        if not after.at > before.at:
            raise ScenarioError(
                f"{where}: points are not in order of time",
                got=(before.at, after.at),
                wanted="times that increase",
            )
    return HandsPlan(script=script, points=tuple(points))


def _point(fields: Fields) -> WayPoint:
    places: dict[str, Any] = {}
    for hand in ("left", "right"):
        if hand in fields:
            place = fields.numbers(hand, 3)
            if np.abs(place).max() > _FARTHEST:
                raise ScenarioError(
                    f"{fields.where}: {hand} is out of range",
                    got=place.tolist(),
                    wanted=f"at most {_FARTHEST:g} m",
                )
            places[hand] = tuple(place.tolist())
    if not places:
        raise ScenarioError(f"{fields.where} moves no hand", wanted="left, right or both")
    return WayPoint(at=fields.number("at", minimum=0.0), **places)


_MOST_STEPS = 200
"""No walk of a file has more steps: its references are computed before the first tick."""

_FARTHEST = 10.0
"""No length, time or gain of a walk is larger, whatever its unit; most are far smaller."""

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class WalkPlan:
    """Where a robot walks, and how; the steps depend on the robot.

    Attributes:
        strides: one after the other.
        gait: timing and shape of the steps.
        feedback: how the balance is kept and the ground felt.
        carry: frame tasks that go along with the body; all that are on no sole when None.
    """

    strides: tuple[Stride, ...]
    gait: Gait = field(default_factory=Gait)
    feedback: WalkSettings = field(default_factory=WalkSettings)
    carry: tuple[str, ...] | None = None

    def walker(self, robot: Robot, stack: Stack, blocks: tuple[Block, ...]) -> Walker:
        """The walker of a robot from its home posture.

        Args:
            robot: the robot.
            stack: its controller's.
            blocks: what stands on the floor.

        Raises:
            PoiseError: the robot cannot walk like this, or its stack cannot be led.
        """
        platforms = tuple(Platform(center=b.center, size=b.size, yaw=b.yaw) for b in blocks)
        plan = plan_footsteps(robot, self.strides, self.gait, ground=Ground(platforms=platforms))
        return Walker(robot, plan, stack, self.feedback, carry=self.carry)


def read_walk(data: object, where: str) -> WalkPlan:
    """The walk of a file.

    Args:
        data: the section: strides, gait, feedback, carry.
        where: the file and the key, for messages.

    Raises:
        ScenarioError: an unknown key, a missing key, or a value of the wrong kind.
        ConfigurationError: values that cannot be right.
    """
    fields = Fields(data, where, ("strides", "gait", "feedback", "carry"), error=ScenarioError)
    items = fields.raw("strides")
    if not isinstance(items, list) or not items:
        raise ScenarioError(
            f"{where}.strides has the wrong kind", got=items, wanted="a list with a stride or more"
        )
    strides = tuple(_stride(item, f"{where}, stride {i + 1}") for i, item in enumerate(items))
    if sum(stride.steps for stride in strides) > _MOST_STEPS:
        raise ScenarioError(
            f"{where}: too many steps",
            got=sum(stride.steps for stride in strides),
            wanted=f"at most {_MOST_STEPS}",
        )
    return WalkPlan(
        strides=strides,
        gait=_numbers(Gait, fields.section("gait", _names(Gait))),
        feedback=_numbers(WalkSettings, fields.section("feedback", _names(WalkSettings))),
        carry=fields.texts("carry") if "carry" in fields else None,
    )


def _stride(data: object, where: str) -> Stride:
    fields = Fields(data, where, _names(Stride), error=ScenarioError)
    steps = fields.number("steps", positive=True)
    if steps != int(steps):
        raise ScenarioError(f"{where}: steps is not whole", got=steps, wanted="1, 2, ...")
    ways: dict[str, Any] = {n: _small(fields, n) for n in fields if n != "steps"}
    return Stride(steps=int(steps), **ways)


def _names(kind: type) -> tuple[str, ...]:
    return tuple(f.name for f in dataclass_fields(kind))


def _numbers(kind: type[T], fields: Fields) -> T:
    return kind(**{name: _small(fields, name) for name in fields})


def _small(fields: Fields, key: str) -> float:
    number = fields.number(key)
    if abs(number) > _FARTHEST:
        raise ScenarioError(
            f"{fields.where}: {key} is out of range", got=number, wanted=f"at most {_FARTHEST:g}"
        )
    return number
