"""What of a stack a walker leads, found before anything moves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from poise.contacts import Contact
from poise.control.stack import Stack
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots.robot import Robot
from poise.tasks import ComTask, FrameTask
from poise.walking.carried import CarriedTarget
from poise.walking.footsteps import FootstepPlan


@dataclass(frozen=True, kw_only=True)
class Led:
    """Tasks and contacts that a walk sets.

    Attributes:
        com: the task of the centre of mass.
        feet: the pose of the left and of the right sole.
        contacts: of the left and of the right sole.
        carried: targets that go along with the body, by the name of their task.
    """

    com: ComTask
    feet: tuple[FrameTask, FrameTask]
    contacts: tuple[Contact, Contact]
    carried: dict[str, CarriedTarget]


def find_led(robot: Robot, plan: FootstepPlan, stack: Stack, carry: Sequence[str] | None) -> Led:
    """Looks for everything that a walk needs.

    Args:
        robot: the robot.
        plan: its steps.
        stack: bound to the robot.
        carry: names of frame tasks that go along; all that are on no sole when None.

    Raises:
        ConfigurationError: the stack lacks a task or a contact.
        UnknownNameError: no such frame task.
    """
    left, right = plan.soles
    return Led(
        com=_com_task(stack),
        feet=(_foot_task(stack, left), _foot_task(stack, right)),
        contacts=(_contact(stack, left), _contact(stack, right)),
        carried=_carried(robot, plan, stack, carry),
    )


def _com_task(stack: Stack) -> ComTask:
    for _, task in stack.tasks():
        if isinstance(task, ComTask) and task.dim == 3:
            return task
    raise _lacking(stack, "a ComTask of all three axes")


def _foot_task(stack: Stack, sole: str) -> FrameTask:
    for _, task in stack.tasks():
        if isinstance(task, FrameTask) and task.frame == sole and task.dim == 6:
            return task
    raise _lacking(stack, f"a FrameTask of the pose of {sole!r}")


def _lacking(stack: Stack, wanted: str) -> ConfigurationError:
    return ConfigurationError(
        "a stack without a task that a walk needs",
        got=[task.name for _, task in stack.tasks()],
        wanted=wanted,
    )


def _contact(stack: Stack, sole: str) -> Contact:
    for contact in stack.contacts:
        if contact.frame == sole:
            return contact
    raise ConfigurationError(
        "a stack without a contact that a walk needs",
        got=[contact.frame for contact in stack.contacts],
        wanted=f"a contact on {sole!r}",
    )


def _carried(
    robot: Robot, plan: FootstepPlan, stack: Stack, names: Sequence[str] | None
) -> dict[str, CarriedTarget]:
    frames = {
        task.name: task
        for _, task in stack.tasks()
        if isinstance(task, FrameTask) and task.frame not in plan.soles
    }
    for name in names or ():
        if name not in frames:
            raise UnknownNameError("no frame task to carry", got=name, choices=frames)
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, plan.q)
    begin = np.array([*plan.com[:2], plan.middle[2]])
    carried: dict[str, CarriedTarget] = {}
    for name, task in frames.items():
        if names is None or name in names:
            pose = data.oMf[robot.frame_id(task.frame)]
            carried[name] = CarriedTarget(task, pose.translation, pose.rotation, begin)
    return carried
