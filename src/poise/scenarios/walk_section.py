"""Reading the walk of a scenario file, and making its walker on a robot."""

from dataclasses import dataclass, field
from dataclasses import fields as dataclass_fields
from typing import Any, TypeVar

from poise.control.stack import Stack
from poise.errors import ScenarioError
from poise.fields import Fields
from poise.robots.robot import Robot
from poise.sim.disturbances import Block
from poise.walking import (
    Gait,
    Ground,
    Platform,
    Stride,
    Walker,
    WalkSettings,
    plan_footsteps,
)

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
