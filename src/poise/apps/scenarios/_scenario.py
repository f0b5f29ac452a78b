"""`Scenario`: one run as its file describes it, checked before anything moves.

Fields of the classes are keys of the file. `load_scenario` reads one.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, cast, get_args

import numpy as np
from jaxtyping import Float64
from pydantic import BeforeValidator, Field

from poise._schema import (
    LARGEST,
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
    read,
)
from poise._yaml import read_text, read_yaml
from poise.apps.scenarios._metrics import METRICS
from poise.apps.scenarios._stack_plan import StackPlan
from poise.apps.teleoperation import SCRIPTS
from poise.control import ControllerPlan
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import (
    Gait,
    Ground,
    Stride,
    VelocityLimits,
    Walker,
    WalkSettings,
    WayPoint,
    plan_footsteps,
)
from poise.robots import Robot
from poise.sim import PlantConfig
from poise.stack import Stack

SHIPPED = Path(__file__).parent / "shipped"
"""Folder of the scenarios that come with Poise."""

_LARGEST = 1e3
"""No point, shift or angle of a motion is larger than this [m, rad]."""

_MOST_STEPS = 200
"""No walk of a file has more steps: its references are computed before the first tick."""

_NAME = re.compile(r"[\w .+()-]*\w[\w .+()-]*")
"""Names of scenarios, which become names of folders."""

_Goal = Annotated[
    Float64[np.ndarray, "3"], Vector(3, Bounds(most=_LARGEST, unit="m, or rad for a turn"))
]
_Seed = Annotated[int, Bounds(least=0.0, whole=True)]

MotionKind = Literal["to", "by", "above", "reach", "turn", "joints"]
_GOALS: tuple[MotionKind, ...] = get_args(MotionKind)


def _given(plan: object, keys: Sequence[str]) -> str:
    """Name of the only key of several that is there."""
    found = [key for key in keys if getattr(plan, key) is not None]
    if len(found) != 1:
        raise ConfigurationError("there must be one of these keys", got=found, choices=keys)
    return found[0]


def _listed(value: object) -> object:
    return [value] if isinstance(value, str) else value


def _named(value: object) -> object:
    return {"name": value} if isinstance(value, str) else value


@checked()
@dataclass(frozen=True, kw_only=True)
class Reach:
    """A goal for a hand by the length of its arm."""

    direction: _Goal  # from the shoulder, in the world; of any length but zero
    ratio: Annotated[float, Bounds(positive=True, most=_LARGEST)]  # over the arm's length

    def __post_init__(self) -> None:
        if not np.any(self.direction):
            raise ConfigurationError("direction is zero", got=[0.0, 0.0, 0.0], wanted="a direction")


@checked()
@dataclass(frozen=True, kw_only=True)
class TargetMotion:
    """A motion of a task's target from where it is to a goal, given by one of six keys."""

    task: Text
    at: Seconds  # beginning [s]
    over: Seconds  # length [s]
    to: _Goal | None = None  # a point in the world [m]
    by: _Goal | None = None  # a shift from the target as it is at `at` [m]
    # Soles over whose middle the target goes, in x and y
    above: Annotated[tuple[Text, ...], BeforeValidator(_listed)] | None = None
    reach: Reach | None = None
    turn: _Goal | None = None  # a rotation vector in the world, from the orientation at `at` [rad]
    joints: dict[Text, Number] | None = None  # angles by joint name [rad]

    def __post_init__(self) -> None:
        _given(self, _GOALS)
        if self.above == ():
            raise ConfigurationError("above is empty", wanted="a sole or several")

    @property
    def kind(self) -> MotionKind:
        """Key by which the goal is given."""
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
    """Loading or unloading of a contact."""

    load: Text | None = None
    unload: Text | None = None
    at: Seconds
    over: Seconds = 0.2  # length of the load ramp [s]
    # Loading waits until the sole measures this force [N], for at most `TOUCHDOWN_PATIENCE`
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
    """A push, as a force or as the change of speed that it would give the whole robot."""

    body: Text  # a frame with a part to play, or a link
    at: Seconds
    duration: Duration
    force: Triple | None = None  # in the world [N]
    velocity_change: Triple | None = None  # force x duration / mass [m/s]

    def __post_init__(self) -> None:
        _given(self, ("force", "velocity_change"))

    def force_on(self, mass: float) -> tuple[float, float, float]:
        """Force in the world [N] on a robot of a mass [kg]."""
        if self.force is not None:
            return self.force
        x, y, z = self.velocity_change or (0.0, 0.0, 0.0)
        scale = mass / self.duration
        return (scale * x, scale * y, scale * z)


@checked()
@dataclass(frozen=True, kw_only=True)
class Measurement:
    """A metric of a run, on its subject, in a window of time."""

    metric: Text  # a key of `METRICS`
    task: Text | None = None
    sole: Text | None = None
    level: Annotated[int, Bounds(least=0.0, whole=True)] | None = None
    axis: Literal["x", "y", "z"] | None = None
    begin: Annotated[Seconds, Field(alias="from")] = 0.0
    end: Annotated[Duration, Field(alias="until")] = LARGEST  # of the window [s]: of the run then

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
        """The task, sole or level, "" where the metric needs none."""
        return self.task or self.sole or ("" if self.level is None else str(self.level))

    @property
    def axis_index(self) -> int | None:
        """0, 1, 2 for x, y, z."""
        return None if self.axis is None else "xyz".index(self.axis)


@checked()
@dataclass(frozen=True, kw_only=True)
class CheckPlan(Measurement):
    """A bound on a metric, in its unit."""

    at_most: Number | None = None
    at_least: Number | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        _given(self, ("at_most", "at_least"))

    @property
    def relation(self) -> Literal["<=", ">="]:
        """Relation of a good value to the bound."""
        return "<=" if self.at_most is not None else ">="

    @property
    def bound(self) -> float:
        """The bound, in the metric's unit."""
        return cast("float", self.at_most if self.at_most is not None else self.at_least)


@checked()
@dataclass(frozen=True, kw_only=True)
class WalkPlan:
    """A walk by footsteps, which depend on the robot."""

    strides: tuple[Stride, ...]
    gait: Gait = field(default_factory=Gait)
    feedback: WalkSettings = field(default_factory=WalkSettings)
    carry: tuple[Text, ...] | None = None  # tasks that go along; all that are on no sole when None

    def __post_init__(self) -> None:
        steps = sum(stride.steps for stride in self.strides)
        if not 0 < steps <= _MOST_STEPS:
            raise ConfigurationError(
                "too many steps" if steps else "strides is empty",
                got=steps,
                wanted=f"at least one and at most {_MOST_STEPS}",
            )


@checked()
@dataclass(frozen=True, kw_only=True)
class VelocityCommand:
    """A velocity of a walk from a time on, cut at the limits."""

    at: Seconds
    # Ahead [m/s], to the left [m/s], and turning to the left [rad/s]
    velocity: Annotated[tuple[float, float, float], Vector(3, Bounds(most=10.0, unit="m/s, rad/s"))]


@checked()
@dataclass(frozen=True, kw_only=True)
class DrivePlan:
    """A walk by commanded velocities; its steps are planned online."""

    velocities: tuple[VelocityCommand, ...]  # the robot stands until the first
    gait: Gait | None = None  # by the robot's size when None
    feedback: WalkSettings = field(default_factory=WalkSettings)
    limits: VelocityLimits = field(default_factory=VelocityLimits)
    carry: tuple[Text, ...] | None = None  # tasks that go along; all that are on no sole when None

    def __post_init__(self) -> None:
        times = [command.at for command in self.velocities]
        if not times or any(a >= b for a, b in pairwise(times)):
            raise ConfigurationError(
                "velocities of a drive are not one after the other",
                got=times,
                wanted="one or more, at times that grow",
            )


@checked()
@dataclass(frozen=True, kw_only=True)
class DevicePlan:
    """Motion of the foot devices in one of four ways, and the link from them to the robot."""

    script: str = ""  # one of `SCRIPTS`, with its blocks and its posture at the start
    points: tuple[WayPoint, ...] = ()  # offsets from where each foot stood at the start
    bad_operator: Truth = False  # random motion
    recording: AnyText = ""  # file of a recorded run of any robot
    latency: Seconds = 0.0
    # Probability that the sample of a tick does not arrive
    loss: Annotated[float, Bounds(least=0.0, most=1.0)] = 0.0
    cut: Seconds | None = None  # nothing arrives from this time on [s]

    def __post_init__(self) -> None:
        if self.script and self.script not in SCRIPTS:
            raise UnknownNameError("no such script of devices", got=self.script, choices=SCRIPTS)
        ways = ("script", "points", "bad_operator", "recording")
        given = [way for way in ways if getattr(self, way)]
        if len(given) != 1:
            raise ConfigurationError(
                "devices are led in one way", got=given, wanted="one key", choices=ways
            )


@checked()
@dataclass(frozen=True, kw_only=True, eq=False)
class Scenario:
    """One run: robot, controller, stack, references over time, disturbances and checks."""

    name: Text  # of the scenario and of folders of its runs
    description: AnyText = ""  # a sentence or two
    robot: AnyText = "humanoid33"  # name or path
    controller: Annotated[ControllerPlan, BeforeValidator(_named)] = field(
        default_factory=ControllerPlan
    )
    # Height of the centre of mass at home of the robot for which lengths and bounds in the file are
    # written; for another robot they are scaled by the ratio of their heights [m]. Lengths are
    # absolute when None
    reference_com_height: (
        Annotated[float, Bounds(positive=True, most=_LARGEST, unit="m")] | None
    ) = None
    duration: Duration
    seed: _Seed = 0  # of everything random
    plant: PlantConfig = field(default_factory=PlantConfig)
    # Blocks besides those of the plant, by a name of `terrain_blocks`, drawn by the seed;
    # unknown to the planner of a walk
    terrain: AnyText = "flat"
    # Feed controller and leader the base's pose and velocity as the plant measures them, which no
    # robot can, in place of an estimate. A robot that is walked by hand has an estimator of its own
    # either way, and a fixed base needs none
    ground_truth: Truth = False
    # The plant's actuation was given by name; otherwise the controller's own is taken
    actuation_given: bool = field(default=True, metadata=NOT_IN_FILES)
    stack: StackPlan | None = None  # the robot's default when None
    devices: DevicePlan | None = None  # of the feet of a robot that is walked by hand
    walk: WalkPlan | None = None  # by footsteps
    drive: DrivePlan | None = None  # by velocities, in place of `walk`
    motions: tuple[TargetMotion, ...] = ()
    contact_changes: Annotated[tuple[ContactChange, ...], Field(alias="contacts")] = ()
    pushes: tuple[PushPlan, ...] = ()
    checks: tuple[CheckPlan, ...] = ()  # besides: no fall, no missed tick, physics levels met

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
        """True for a robot that walks by itself."""
        return self.walk is not None or self.drive is not None

    def later(self, by: float) -> "Scenario":
        """Return the scenario after a time of standing [s]; devices and walks by footsteps apart.

        Devices keep their own time, and a walk begins when its leader is first called.
        """

        def moved(items: Any, key: str = "at") -> Any:
            return tuple(replace(item, **{key: getattr(item, key) + by}) for item in items)

        # Windows end with the scenario, where a robot may have to do something else after it.
        last = self.duration
        checks = (replace(c, begin=c.begin + by, end=min(c.end, last) + by) for c in self.checks)
        drive = self.drive
        return replace(
            self,
            duration=self.duration + by,
            motions=moved(self.motions),
            contact_changes=moved(self.contact_changes),
            pushes=moved(self.pushes),
            checks=tuple(checks),
            drive=drive and replace(drive, velocities=moved(drive.velocities)),
        )

    def walker(self, robot: Robot, stack: Stack) -> Walker | None:
        """Make the leader of a robot that walks from its home posture; None for one that stays.

        Args:
            robot: the robot.
            stack: its controller's.

        Raises:
            PoiseError: the robot cannot walk so, or its stack cannot be used for it.
        """
        told = [b for b in self.plant.blocks if b.told]
        platforms = [Ground.Platform(center=b.center, size=b.size, yaw=b.yaw) for b in told]
        ground, walk, drive = Ground(platforms=tuple(platforms)), self.walk, self.drive
        if walk is not None:
            plan = plan_footsteps(robot, walk.strides, walk.gait, ground=ground)
            return Walker(robot, stack, settings=walk.feedback, plan=plan, carry=walk.carry)
        if drive is None:
            return None
        settings = (drive.gait, drive.feedback, drive.limits)
        return Walker(robot, stack, *settings, ground=ground, carry=drive.carry)


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with Poise."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.yaml")))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Read a scenario by its shipped name or from a file.

    Args:
        name_or_path: one of `shipped_scenarios()`, or the path of a YAML file.

    Raises:
        UnknownNameError: neither a shipped scenario nor a file.
        ConfigurationError: an unknown key, a missing key, or a value of the wrong kind.
        ConfigurationError: values that cannot be right.
    """
    return make_scenario(*read_scenario(name_or_path))


def parse_scenario(text: str, where: str) -> Scenario:
    """Read a scenario from YAML text."""
    return make_scenario(read_yaml(text, where, error=ConfigurationError), where)


def read_scenario(name_or_path: str | Path) -> tuple[dict[Any, Any], str]:
    """Read the content of a scenario's file as written, and the file's name for messages."""
    path, shipped = Path(name_or_path), shipped_scenarios()
    if str(name_or_path) in shipped:
        path = SHIPPED / f"{name_or_path}.yaml"
    if not path.is_file():
        what = "neither a shipped scenario nor a file"
        raise UnknownNameError(what, got=str(name_or_path), choices=shipped)
    text = read_text(path, error=ConfigurationError)
    return read_yaml(text, path.name, error=ConfigurationError), path.name


def make_scenario(data: Mapping[Any, Any], where: str) -> Scenario:
    """Make a scenario from the content of a file."""
    scenario = read(Scenario, data, where, error=ConfigurationError)
    return replace(scenario, actuation_given="actuation" in (data.get("plant", {})))
