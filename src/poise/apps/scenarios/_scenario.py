"""`Scenario`: one run, as its file describes it, checked before anything moves.

The classes here are the form of the file: their fields are its keys.
"""

import re
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, cast

import numpy as np
from jaxtyping import Float64
from pydantic import BeforeValidator, Field

from poise._schema import (
    NOT_IN_FILES,
    AnyText,
    Bounds,
    Duration,
    Number,
    Seconds,
    Text,
    Triple,
    Truth,
    Vector,
    checked,
)
from poise.apps.scenarios._by_hand import DevicePlan
from poise.apps.scenarios._drive_plan import DrivePlan
from poise.apps.scenarios._metrics import METRICS
from poise.apps.scenarios._stack_plan import StackPlan
from poise.control import ControllerPlan
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import (
    Gait,
    Ground,
    Stride,
    Walker,
    WalkSettings,
    plan_footsteps,
)
from poise.robots import Robot
from poise.sim import PlantConfig
from poise.stack import Stack

_LARGEST = 1e3
"""No point, shift or angle of a motion is larger than this [m, rad]."""

_MOST_STEPS = 200
"""No walk of a file has more steps: its references are computed before the first tick."""

_NAME = re.compile(r"[\w .+()-]*\w[\w .+()-]*")
"""A scenario's name becomes the name of a folder."""

_Goal = Annotated[
    Float64[np.ndarray, "3"], Vector(3, Bounds(most=_LARGEST, unit="m, or rad for a turn"))
]


def _given(plan: object, keys: tuple[str, ...]) -> str:
    """Which one of several keys is there."""
    found = [key for key in keys if getattr(plan, key) is not None]
    if len(found) != 1:
        raise ConfigurationError("there must be one of these keys", got=found, choices=keys)
    return found[0]


MotionKind = Literal["to", "by", "above", "reach", "turn", "joints"]
"""How a motion gives its goal, see `Motion`."""

_GOALS: tuple[MotionKind, ...] = ("to", "by", "above", "reach", "turn", "joints")


@checked()
@dataclass(frozen=True, kw_only=True)
class Reach:
    """A goal for a hand, as far as its arm goes.

    Attributes:
        direction: from the shoulder, in the world; of any length but zero.
        ratio: distance from the shoulder over the arm's length, such as 0.9.
    """

    direction: _Goal
    ratio: Annotated[float, Bounds(positive=True, most=_LARGEST)]

    def __post_init__(self) -> None:
        if not np.any(self.direction):
            raise ConfigurationError("direction is zero", got=[0.0, 0.0, 0.0], wanted="a direction")


@checked()
@dataclass(frozen=True, kw_only=True)
class Motion:
    """A task's target moves from where it is to a goal, which one of six keys gives.

    Attributes:
        task: name of the task in the stack.
        at: when it begins [s].
        over: how long it takes [s].
        to: a point in the world [m].
        by: a shift from the target as it is at `at` [m].
        above: a sole or several, over whose middle the target goes (x and y only).
        reach: a fraction of the arm's length in a direction from the shoulder.
        turn: a rotation vector in the world from the orientation as it is at `at` [rad].
        joints: angles by joint name [rad].
    """

    task: Text
    at: Seconds
    over: Seconds
    to: _Goal | None = None
    by: _Goal | None = None
    above: (
        Annotated[tuple[Text, ...], BeforeValidator(lambda v: [v] if isinstance(v, str) else v)]
        | None
    ) = None
    reach: Reach | None = None
    turn: _Goal | None = None
    joints: dict[Text, Number] | None = None

    def __post_init__(self) -> None:
        _given(self, _GOALS)
        if self.above == ():
            raise ConfigurationError("above is empty", wanted="a sole or several")

    @property
    def kind(self) -> MotionKind:
        """How the goal is given."""
        return cast("MotionKind", _given(self, _GOALS))

    @property
    def vector(self) -> Float64[np.ndarray, "3"]:
        """The point, the shift, the rotation vector, or the direction with length one."""
        if self.reach is not None:
            return self.reach.direction / np.linalg.norm(self.reach.direction)
        return next((v for v in (self.to, self.by, self.turn) if v is not None), np.zeros(3))


@checked()
@dataclass(frozen=True, kw_only=True)
class ContactChange:
    """A contact is loaded or unloaded.

    Attributes:
        load: name of the contact that is loaded, or None.
        unload: name of the contact that is unloaded, or None.
        at: when [s].
        over: length of the load ramp [s].
        touchdown: loading waits until the sole measures this force [N], for at most a second;
            zero for at once.
    """

    load: Text | None = None
    unload: Text | None = None
    at: Seconds
    over: Seconds = 0.2
    touchdown: Annotated[float, Bounds(least=0.0, unit="N")] = 0.0

    def __post_init__(self) -> None:
        _given(self, ("load", "unload"))
        if self.unload is not None and self.touchdown > 0.0:
            raise ConfigurationError("touchdown goes with load", got="unload")

    @property
    def contact(self) -> str:
        """Name of the contact in the stack."""
        return self.load or self.unload or ""


@checked()
@dataclass(frozen=True, kw_only=True)
class PushPlan:
    """A push, as a force or as the change of speed it would give the whole robot.

    Attributes:
        body: a frame with a part to play, or a link.
        at: when it begins [s].
        duration: how long it lasts [s].
        force: in the world [N], None where `velocity_change` is given.
        velocity_change: force x duration / mass [m/s], None where `force` is given.
    """

    body: Text
    at: Seconds
    duration: Duration
    force: Triple | None = None
    velocity_change: Triple | None = None

    def __post_init__(self) -> None:
        _given(self, ("force", "velocity_change"))

    def force_on(self, mass: float) -> tuple[float, float, float]:
        """The force on a robot of a mass [kg], in the world [N]."""
        if self.force is not None:
            return self.force
        x, y, z = self.velocity_change or (0.0, 0.0, 0.0)
        scale = mass / self.duration
        return (scale * x, scale * y, scale * z)


@checked()
@dataclass(frozen=True, kw_only=True)
class Measurement:
    """Something that is measured on a run.

    Attributes:
        metric: what is measured, a key of `METRICS`.
        task: the task it is measured on, for a metric of tasks.
        sole: the sole it is measured on, for a metric of soles.
        level: the level it is measured on, for a metric of levels.
        axis: the axis, for a metric that takes one.
        begin: start of the window, `from` in a file [s].
        end: end of the window, `until` in a file; infinite for the end of the run [s].
    """

    metric: Text
    task: Text | None = None
    sole: Text | None = None
    level: Annotated[int, Bounds(least=0.0, whole=True)] | None = None
    axis: Literal["x", "y", "z"] | None = None
    begin: Annotated[Seconds, Field(alias="from")] = 0.0
    end: Annotated[Duration, Field(alias="until")] = float("inf")

    def __post_init__(self) -> None:
        if self.metric not in METRICS:
            raise UnknownNameError("unknown metric", got=self.metric, choices=METRICS)
        metric = METRICS[self.metric]
        given = [k for k in ("task", "sole", "level") if getattr(self, k) is not None]
        if given != ([metric.subject] if metric.subject else []):
            raise ConfigurationError(
                f"metric {self.metric!r} is measured on something else",
                got=given,
                wanted=f"the key {metric.subject!r}" if metric.subject else "no task, sole, level",
            )
        if self.axis is not None and not metric.takes_axis:
            raise ConfigurationError("axis", got=self.axis, wanted="no axis with this metric")
        if self.begin >= self.end:
            raise ConfigurationError(
                "the window is empty", got=(self.begin, self.end), wanted="from < until"
            )

    @property
    def subject(self) -> str:
        """The task, sole or level it is measured on, "" where the metric needs none."""
        return self.task or self.sole or ("" if self.level is None else str(self.level))

    @property
    def axis_index(self) -> int | None:
        """0, 1, 2 for x, y, z."""
        return None if self.axis is None else "xyz".index(self.axis)


@checked()
@dataclass(frozen=True, kw_only=True)
class CheckPlan(Measurement):
    """Something that must hold of the run.

    Attributes:
        at_most: upper bound in the metric's unit, or None.
        at_least: lower bound in the metric's unit, or None.
    """

    at_most: Number | None = None
    at_least: Number | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        _given(self, ("at_most", "at_least"))

    @property
    def relation(self) -> Literal["<=", ">="]:
        """How a good value stands to the bound."""
        return "<=" if self.at_most is not None else ">="

    @property
    def bound(self) -> float:
        """The bound, in the metric's unit."""
        return cast("float", self.at_most if self.at_most is not None else self.at_least)


@checked()
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
    carry: tuple[Text, ...] | None = None

    def __post_init__(self) -> None:
        steps = sum(stride.steps for stride in self.strides)
        if not 0 < steps <= _MOST_STEPS:
            raise ConfigurationError(
                "too many steps" if steps else "strides is empty",
                got=steps,
                wanted=f"at least one and at most {_MOST_STEPS}",
            )

    def walker(self, robot: Robot, stack: Stack, ground: Ground) -> Walker:
        """The walker of a robot from its home posture."""
        plan = plan_footsteps(robot, self.strides, self.gait, ground=ground)
        return Walker(robot, stack, settings=self.feedback, plan=plan, carry=self.carry)


def _named(value: Any) -> Any:
    """A controller may be given by its name alone."""
    return {"name": value} if isinstance(value, str) else value


@checked()
@dataclass(frozen=True, kw_only=True, eq=False)
class Scenario:
    """One run: robot, controller, stack, references over time, disturbances and checks.

    Attributes:
        name: what it is called.
        description: what it is about, in a sentence or two.
        robot: name or path of the robot.
        controller: which controller.
        reference_com_height: height of the centre of mass at home of the robot that the lengths in
            the file are for; those of another robot are scaled by the ratio of their heights, and
            so are bounds of checks [m]. Lengths are what they are when None.
        duration: how long it lasts [s].
        seed: seed of everything random.
        plant: the plant.
        ground_truth: whether controller and leader are told the base's pose and velocity as the
            plant measures them, which no robot can; else they are estimated. A robot that is walked
            by hand has an estimator of its own either way, and a fixed base needs none.
        actuation_given: whether the plant's actuation was asked for by name; where it was not, the
            controller's own is taken.
        stack: contacts, limits and tasks; None for the default stack of the robot.
        devices: how the operator of a robot that is walked by hand moves its foot devices; None for
            other robots.
        walk: where the robot walks; None for one that stays.
        drive: with which velocities it walks, in place of `walk`.
        motions: how targets move, by time.
        contact_changes: contacts loaded and unloaded, by time.
        pushes: pushes, by time.
        checks: what must hold besides: no fall, no missed tick, physics levels met.
    """

    name: Text
    description: AnyText = ""
    robot: AnyText = "humanoid33"
    controller: Annotated[ControllerPlan, BeforeValidator(_named)] = field(
        default_factory=ControllerPlan
    )
    reference_com_height: (
        Annotated[float, Bounds(positive=True, most=_LARGEST, unit="m")] | None
    ) = None
    duration: Duration
    seed: Annotated[int, Bounds(least=0.0, whole=True)] = 0
    plant: PlantConfig = field(default_factory=PlantConfig)
    ground_truth: Truth = False
    actuation_given: bool = field(default=True, metadata=NOT_IN_FILES)
    stack: StackPlan | None = None
    devices: DevicePlan | None = None
    walk: WalkPlan | None = None
    drive: DrivePlan | None = None
    motions: tuple[Motion, ...] = ()
    contact_changes: Annotated[tuple[ContactChange, ...], Field(alias="contacts")] = ()
    pushes: tuple[PushPlan, ...] = ()
    checks: tuple[CheckPlan, ...] = ()

    def __post_init__(self) -> None:
        if _NAME.fullmatch(self.name) is None:
            raise ConfigurationError(
                "name of a scenario cannot name a folder",
                got=self.name,
                wanted="letters, digits, spaces and any of _ - . + ( )",
            )
        if self.duration < self.plant.control_dt:
            raise ConfigurationError(
                f"duration of scenario {self.name!r} is out of range",
                got=self.duration,
                wanted=f"seconds, one control period of {self.plant.control_dt:g} s or more",
            )
        if self.walk is not None and self.drive is not None:
            raise ConfigurationError(
                f"scenario {self.name!r} walks and is driven",
                got="walk and drive",
                wanted="one of the two",
            )
        times = [(f"a motion of task {m.task!r}", m.at) for m in self.motions]
        times += [(f"a change of contact {c.contact!r}", c.at) for c in self.contact_changes]
        if self.drive is not None:
            times += [("a velocity of the drive", v.at) for v in self.drive.velocities]
        times += [(f"a push on {p.body!r}", p.at) for p in self.pushes]
        times += [(f"the window of a check of {c.metric!r}", c.begin) for c in self.checks]
        for what, time in times:
            if not 0.0 <= time < self.duration:
                raise ConfigurationError(
                    f"{what} begins outside the run",
                    got=time,
                    wanted=f"seconds, from 0 to less than the duration of {self.duration:g}",
                )

    @property
    def walks(self) -> bool:
        """Whether the robot walks by itself."""
        return self.walk is not None or self.drive is not None

    def walker(self, robot: Robot, stack: Stack) -> Walker | None:
        """Who leads the feet of a robot that walks; None for one that stays.

        Args:
            robot: the robot.
            stack: its controller's.

        Raises:
            PoiseError: the robot cannot walk like this, or its stack cannot be led.
        """
        plan = self.walk or self.drive
        if plan is None:
            return None
        told = [b for b in self.plant.blocks if b.told]
        platforms = [Ground.Platform(center=b.center, size=b.size, yaw=b.yaw) for b in told]
        return plan.walker(robot, stack, Ground(platforms=tuple(platforms)))
