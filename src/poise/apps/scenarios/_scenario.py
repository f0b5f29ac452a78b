"""`Scenario`: one run, as its file describes it, checked before anything moves."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float64

from poise.apps.scenarios._by_hand import HandsPlan
from poise.apps.scenarios._sections import WalkPlan
from poise.apps.scenarios._stack_plan import StackPlan
from poise.control import ControllerPlan
from poise.errors import ScenarioError
from poise.sim import PlantConfig

MotionKind = Literal["to", "by", "above", "reach", "turn", "joints"]
"""How a motion names its goal, see `Motion`."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A task's target moves from where it is to a goal.

    Attributes:
        task: name of the task in the stack.
        at: when it begins [s].
        over: how long it takes [s].
        kind: how the goal is given:
            "to", a point in the world [m];
            "by", a shift from the target as it is at `at` [m];
            "above", a sole or several, over whose middle the target goes (x and y only);
            "reach", along `vector` from the shoulder by `share` of the arm's length;
            "turn", a rotation vector in the world from the orientation as it is at `at` [rad];
            "joints", angles by joint name [rad].
        vector: the point, shift, direction or rotation vector.
        share: share of the arm's length, for "reach".
        soles: soles, for "above".
        joints: angles, for "joints".
    """

    task: str
    at: float
    over: float
    kind: MotionKind
    vector: Float64[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    share: float = 0.0
    soles: tuple[str, ...] = ()
    joints: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class ContactChange:
    """A contact is loaded or unloaded.

    Attributes:
        contact: name of the contact in the stack.
        at: when [s].
        load: whether it is loaded; unloaded otherwise.
        over: length of the load ramp [s].
        touchdown: loading waits until the sole measures this force [N], for at most a second;
            zero for at once.
    """

    contact: str
    at: float
    load: bool
    over: float
    touchdown: float = 0.0


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

    body: str
    at: float
    duration: float
    force: tuple[float, float, float] | None = None
    velocity_change: tuple[float, float, float] | None = None

    def force_on(self, mass: float) -> tuple[float, float, float]:
        """The force on a robot of a mass [kg], in the world [N]."""
        if self.force is not None:
            return self.force
        x, y, z = self.velocity_change or (0.0, 0.0, 0.0)
        scale = mass / self.duration
        return (scale * x, scale * y, scale * z)


@dataclass(frozen=True, kw_only=True)
class CheckPlan:
    """Something that must hold of the run.

    Attributes:
        metric: what is measured, see `poise.scenarios.metrics`.
        relation: how a good value stands to the bound.
        bound: in the metric's unit.
        subject: the task or sole it is measured on, "" where the metric needs none.
        axis: 0, 1, 2 for x, y, z where the metric takes one.
        begin: start of the window [s].
        end: end of the window [s], infinite for the end of the run.
    """

    metric: str
    relation: Literal["<=", ">="]
    bound: float
    subject: str = ""
    axis: int | None = None
    begin: float = 0.0
    end: float = float("inf")


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenario:
    """One run: robot, controller, stack, references over time, disturbances and checks.

    Attributes:
        name: what it is called.
        description: what it is about, in a sentence or two.
        robot: name or path of the robot.
        controller: which controller.
        duration: how long it lasts [s].
        seed: seed of everything random.
        plant: the plant.
        actuation_given: whether the plant's actuation was asked for by name; where it was not, the
            controller's own is taken.
        stack: contacts, limits and tasks; None for the default stack of the robot.
        hands: what the operator of a robot that is walked by hand does; None for other robots.
        walk: where the robot walks; None for one that stays.
        motions: how targets move, by time.
        contact_changes: contacts loaded and unloaded, by time.
        pushes: pushes, by time.
        checks: what must hold besides: no fall, no missed tick, physics levels met.
    """

    name: str
    description: str = ""
    robot: str = "humanoid33"
    controller: ControllerPlan = field(default_factory=ControllerPlan)
    duration: float = 5.0
    seed: int = 0
    plant: PlantConfig = field(default_factory=PlantConfig)
    actuation_given: bool = True
    stack: StackPlan | None = None
    hands: HandsPlan | None = None
    walk: WalkPlan | None = None
    motions: tuple[Motion, ...] = ()
    contact_changes: tuple[ContactChange, ...] = ()
    pushes: tuple[PushPlan, ...] = ()
    checks: tuple[CheckPlan, ...] = ()

    def __post_init__(self) -> None:
        if not self.plant.control_dt <= self.duration < float("inf"):
            raise ScenarioError(
                f"duration of scenario {self.name!r} is out of range",
                got=self.duration,
                wanted=f"seconds, one control period of {self.plant.control_dt:g} s or more",
            )
        times = [(f"a motion of task {m.task!r}", m.at) for m in self.motions]
        times += [(f"a change of contact {c.contact!r}", c.at) for c in self.contact_changes]
        times += [(f"a push on {p.body!r}", p.at) for p in self.pushes]
        times += [(f"the window of a check of {c.metric!r}", c.begin) for c in self.checks]
        for what, time in times:
            if not 0.0 <= time < self.duration:
                raise ScenarioError(
                    f"{what} begins outside the run",
                    got=time,
                    wanted=f"seconds, from 0 to less than the duration of {self.duration:g}",
                )
