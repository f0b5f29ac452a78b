"""`Stack`: contacts, limits and tasks in strict order, as a user writes them.

Which tasks a contact stands in for.
"""

from collections.abc import Iterator, Sequence
from typing import TypeVar

from poise._checks import checked_kind, checked_number
from poise._show import html_table
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import Robot
from poise.stack._balance import BalanceLimit
from poise.stack._bound_once import Limit
from poise.stack._centroid import ComTask
from poise.stack._contact import Contact
from poise.stack._frame import FrameTask
from poise.stack._joint_limit import JointLimit
from poise.stack._joints import PostureTask
from poise.stack._self_collision import SelfCollisionLimit
from poise.stack._shipped_contacts import SurfaceContact
from poise.stack._task import Task
from poise.stack._torque_limit import SMOOTH_RATE, TorqueLimit


def is_held(task: Task, contacts: Sequence[Contact]) -> bool:
    """Return True where an active contact decides the motion of the task's frame.

    A point contact decides where its frame is, but not how it is turned, and one on an edge not
    how it rolls.
    """
    return isinstance(task, FrameTask) and any(
        c.frame == task.frame and task.components <= set(c.chosen.tolist()) for c in contacts
    )


P = TypeVar("P", Task, Contact)
L = TypeVar("L", bound=Limit)

SOFTENING = 0.05
"""Default of `Stack(softening=)` [m, rad]: a hand with kp 100 far out of reach has the stiffness of
25 rad/s along a singular direction of lever 0.3 m, which a period of 2 ms samples 130 times."""


class Stack:
    """Contacts, limits and prioritised tasks of a controller, whichever it is.

    Physics comes first, always: base dynamics with the torque limits, then contacts with the
    joint limits, then balance and self-collision limit. The user's levels follow, each strictly
    above the next.

    Args:
        contacts: where the robot touches the world.
        levels: lists of tasks, most important first.
        torque_limit: bounds of the torques.
        joint_limit: bounds of joint positions, velocities and accelerations.
        balance_limit: what keeps all tasks from toppling the robot, where torques are commanded.
        self_collision_limit: what keeps the robot's links off each other; none when None.
        softening: s in the squared weight e^2 s / (s + e) of the softening term of a level with
            the error e, against the weight of the level's own rows [m, rad]; 0 for levels that are
            strict even where they cannot be met.

    Raises:
        ConfigurationError: an empty level, a name used twice, two contacts on one frame,
            something that is neither a task nor a contact, or a softening that is negative or not
            finite.
    """

    def __init__(
        self,
        contacts: Sequence[Contact] = (),
        levels: Sequence[Sequence[Task]] = (),
        *,
        torque_limit: TorqueLimit | None = None,
        joint_limit: JointLimit | None = None,
        balance_limit: BalanceLimit | None = None,
        self_collision_limit: SelfCollisionLimit | None = None,
        softening: float = SOFTENING,
    ) -> None:
        for contact in checked_kind(contacts, Sequence, "the contacts of the stack"):
            checked_kind(contact, Contact, "a contact of the stack")
        for i, level in enumerate(checked_kind(levels, Sequence, "the levels of the stack")):
            if not isinstance(level, Sequence) or not level:
                raise ConfigurationError(
                    f"level {i} of the stack is not a list of tasks",
                    got=level,
                    wanted="a list with at least one task",
                )
            for task in level:
                checked_kind(task, Task, f"an entry of level {i} of the stack")
        self.contacts = tuple(contacts)
        self.levels = tuple(tuple(level) for level in levels)
        self.torque_limit = _limit(torque_limit, TorqueLimit, "torque_limit")
        self.joint_limit = _limit(joint_limit, JointLimit, "joint_limit")
        self.balance_limit = _limit(balance_limit, BalanceLimit, "balance_limit")
        apart = self_collision_limit or SelfCollisionLimit(enabled=False)
        self.self_collision_limit = _limit(apart, SelfCollisionLimit, "self_collision_limit")
        self.softening = checked_number(softening, "softening of the stack [m, rad]")
        _check_unique([c.frame for c in self.contacts], "two contacts of the stack on one frame")
        _check_unique([c.name for c in self.contacts], "two contacts of the stack with one name")
        _check_unique([t.name for _, t in self.tasks()], "two tasks of the stack with one name")

    def __repr__(self) -> str:
        lines = [f"  level {level}  {what}" for level, what in self._described()]
        return "\n".join(["Stack", *lines])

    def _repr_html_(self) -> str:
        return html_table("Stack", ("level", "what"), self._described())

    def _described(self) -> list[tuple[int, str]]:
        """The contents of each level; the first two are the physics."""
        contacts = [c.name + ("" if c.active else " (free)") for c in self.contacts]
        rows = [
            f"dynamics, torque limit {100.0 * self.torque_limit.scale:g}%",
            ", ".join(["contacts " + (", ".join(contacts) or "none"), "joint limit"]),
        ]
        rows += [
            "; ".join(f"{task.name} ({task.describe()})" for task in level) for level in self.levels
        ]
        return list(enumerate(rows, 1))

    def tasks(self) -> Iterator[tuple[int, Task]]:
        """All tasks with the index of their level, most important first."""
        for i, level in enumerate(self.levels):
            for task in level:
                yield i, task

    @property
    def active_contacts(self) -> tuple[Contact, ...]:
        """The contacts that may carry load now."""
        return tuple([c for c in self.contacts if c.active])

    def task(self, name: str) -> Task:
        """The task of that name.

        Raises:
            UnknownNameError: no such task; the message lists those that exist.
        """
        return _named(name, [task for _, task in self.tasks()], "task")

    def contact(self, name: str) -> Contact:
        """The contact of that name.

        Raises:
            UnknownNameError: no such contact; the message lists those that exist.
        """
        return _named(name, self.contacts, "contact")

    def bind(self, robot: Robot) -> None:
        """Resolve every name on a robot; controllers call it before the first tick."""
        limits = self.torque_limit, self.joint_limit, self.balance_limit, self.self_collision_limit
        for part in (*self.contacts, *(task for _, task in self.tasks()), *limits):
            part.bind(robot)


def default_stack(robot: Robot) -> Stack:
    """The stack of Ahn et al. 2024, Table 1: dynamics, contacts, balance, then the hands.

    Args:
        robot: whose soles, hands, pelvis and torso the tasks name.

    Returns:
        A new stack: both soles in contact; CoM and pelvis orientation; hand poses and, where the
        waist has three joints, torso orientation; posture. No torque jumps by more than
        `SMOOTH_RATE` allows.
    """
    balance: list[Task] = []
    if robot.floating_base:
        balance = [ComTask(kp=60.0), FrameTask(robot.pelvis, "orientation", kp=100.0)]
    upper: list[Task] = [FrameTask(hand, kp=100.0) for hand in robot.hands]
    if _can_turn_freely(robot, robot.pelvis, robot.torso):
        upper.append(FrameTask(robot.torso, "orientation", kp=100.0))
    levels = [level for level in (balance, upper) if level]
    return Stack(
        contacts=[SurfaceContact(sole) for sole in robot.soles],
        levels=[*levels, [PostureTask()]],
        torque_limit=TorqueLimit(rate=SMOOTH_RATE),
    )


def _can_turn_freely(robot: Robot, root: str, frame: str) -> bool:
    """Return True where three joints turn a frame against another; with fewer, both conflict."""
    above_root = set(robot.joints_above(root))
    return len(set(robot.joints_above(frame)) - above_root) >= 3


def _named(name: str, parts: Sequence[P], kind: str) -> P:
    for one in parts:
        if one.name == name:
            return one
    choices = [one.name for one in parts]
    raise UnknownNameError(f"unknown {kind} of the stack", got=name, choices=choices)


def _limit(limit: L | None, kind: type[L], what: str) -> L:
    return checked_kind(limit or kind(), kind, f"{what} of the stack")


def _check_unique(names: list[str], what: str) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigurationError(what, got=", ".join(twice))
