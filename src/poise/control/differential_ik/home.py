"""`HomeJacobians`: how far joints move contacts and tasks in the home posture."""

from collections.abc import Sequence
from itertools import accumulate, pairwise

import numpy as np
from jaxtyping import Float64, Int64

from poise.contacts.contact import Contact
from poise.control.differential_ik.stance import base_from_joints, constrained
from poise.control.stack import Stack
from poise.dynamics.dynamics import Dynamics
from poise.robots.robot import Robot
from poise.tasks import Task


class HomeJacobians:
    """Jacobians of a stack in the home posture, taken before the first tick.

    Loss of rank is measured against them, so that metres, radians and momenta, wrists and hips can
    be compared.

    Args:
        robot: the robot.
        stack: contacts and tasks, bound to the robot; tasks forget targets that they took from
            the robot.

    Attributes:
        nv: number of generalized velocities.
        joints: indices of all joints.
    """

    def __init__(self, robot: Robot, stack: Stack) -> None:
        dynamics = Dynamics(robot)
        self.nv = robot.nv
        self.joints: Int64[np.ndarray, " nj"] = np.arange(robot.nj)
        self._jacobians: dict[Contact | Task, Float64[np.ndarray, "m nv"]] = {}
        for contact in stack.contacts:
            contact.evaluate(dynamics)
            self._jacobians[contact] = contact.jacobian.copy()
        for _, task in stack.tasks():
            task.evaluate(dynamics)
            self._jacobians[task] = task.jacobian.copy()
            task.reset()

    def scale(
        self, owner: Contact | Task, stance: Contact | None, joints: Int64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " m"]:
        """One over the size of an owner's rows; rows that turn into one another share the largest.

        Args:
            owner: a contact or a task of the stack.
            stance: the contact that stands; None for a fixed base.
            joints: joints that may move.
        """
        jacobian = self._jacobians[owner]
        if stance is not None:
            jacobian = constrained(jacobian, base_from_joints(self._jacobians[stance]))
        sizes = np.linalg.norm(jacobian[:, joints], axis=1)
        scale = np.ones(len(sizes))
        for start, stop in pairwise(accumulate(_blocks(owner), initial=0)):
            largest = float(sizes[start:stop].max())
            # A block that nothing moves has no rank to lose.
            if largest > 0.0:
                scale[start:stop] = 1.0 / largest
        return scale


def _blocks(owner: Contact | Task) -> Sequence[int]:
    return owner.blocks if isinstance(owner, Task) else (3,) * (owner.dim // 3)
