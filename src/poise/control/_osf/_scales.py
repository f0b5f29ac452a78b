"""`RowScales`: how well the robot can move along each row, by which loss of rank is measured."""

from collections.abc import Sequence
from itertools import accumulate, pairwise

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.stack import Contact, Stack, Task


class RowScales:
    """One over the mobility sqrt(J M^-1 J^T) of rows in the home posture, times their weight.

    Rows that share a unit and turn into one another as axes turn share the largest mobility among
    them, so that the scale does not depend on how the axes lie: a stretched arm has no mobility
    along itself, and that is what a singularity looks like. Metres, radians and momenta become
    comparable, and so do a wrist and a hip.

    Args:
        robot: the robot.

    Attributes:
        base: scales of the base's own equation of motion, one a base coordinate.
        joints: scales of rows that are single coordinates, one a coordinate of `v`.
    """

    def __init__(self, robot: Robot) -> None:
        self._home = Dynamics(robot)
        self._home.update(RobotState(robot.q_home, np.zeros(robot.nv)))
        self._mobility = np.linalg.inv(self._home.M)
        self._scales: dict[Contact | Task, Float64[np.ndarray, " m"]] = {}
        base = robot.base_dofs
        self.base = self._blocks(self._home.M[:base], (3, 3) if base else ())
        self.joints: Float64[np.ndarray, " nv"] = 1.0 / np.sqrt(np.diagonal(self._mobility))

    def learn(self, stack: Stack) -> None:
        """Measures contacts and tasks that are new; before they serve in a tick.

        They are evaluated in the home posture, and forget it again.

        Args:
            stack: contacts and tasks, bound to the robot.
        """
        for contact in stack.contacts:
            if contact not in self._scales:
                contact.evaluate(self._home)
                self._scales[contact] = self._blocks(contact.jacobian, (3,) * (contact.dim // 3))
        for _, task in stack.tasks():
            if task not in self._scales:
                task.evaluate(self._home)
                self._scales[task] = task.weight * self._blocks(task.jacobian, task.blocks)
                task.reset()

    def of(self, owner: Contact | Task) -> Float64[np.ndarray, " m"]:
        """Scales of the rows of a contact or a task that was learned."""
        return self._scales[owner]

    def _blocks(
        self, jacobian: Float64[np.ndarray, "m nv"], blocks: Sequence[int]
    ) -> Float64[np.ndarray, " m"]:
        squares = np.einsum("ij,jk,ik->i", jacobian, self._mobility, jacobian)
        scale = np.ones(len(squares))
        for start, stop in pairwise(accumulate(blocks, initial=0)):
            largest = float(squares[start:stop].max())
            # A block that nothing moves has no rank to lose.
            if largest > 0.0:
                scale[start:stop] = 1.0 / np.sqrt(largest)
        return scale
