"""`VelocityRows`: contacts and the user's levels as rows on joint velocities.

`RowWeights`: W_A, the weight of each row in its level; may change every tick.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import Numbers
from poise.control._differential_ik._bounds import LedJoints
from poise.control._differential_ik._kernels import (
    ConstrainedRows,
    PriorityRows,
    VelocityLevels,
    constrain,
)
from poise.control._rank import block_scales
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import Robot
from poise.stack import BASE, Contact, Stack, StackRows, Task, checked_gain, home_jacobians

ROW_WEIGHT = 1e4
"""W_A of a row whose task has weight one.

The SR-inverse weighs rows against the joint velocities themselves: a row that moves a radian a unit
then misses a ten-thousandth of its reference."""


EXACT = 2
"""Levels that the closed form meets exactly: held contacts, and the first of the user's."""


class RowWeights:
    """Diagonal of W_A in (20) of Zhang and Kikuuwe, by task: `weights[task] = 100.0`.

    It is `ROW_WEIGHT` times the task's own weight squared, because a level's slack is measured as
    |W w|; `Task.set_weight` sets the same. Weights count within a level, and in the closed form
    against the joint velocities; the exact levels of the closed form have none.
    """

    def __init__(self, stack: Stack) -> None:
        self._tasks = {task.name: task for _, task in stack.tasks()}

    def __getitem__(self, task: Task | str) -> Float64[np.ndarray, " m"]:
        """Return the weights of a task's rows, a copy."""
        weight = self._task(task).weight
        return ROW_WEIGHT * weight * weight

    def __setitem__(self, task: Task | str, weight: Numbers) -> None:
        """Set the weights of a task's rows, one number or one a row."""
        found = self._task(task)
        what = f"row weight of task {found.name!r}"
        rows = checked_gain(weight, found.dim, what)
        if rows.min() <= 0.0:
            raise ConfigurationError(f"{what} must be positive", got=weight, wanted="> 0")
        found.set_weight(np.sqrt(rows / ROW_WEIGHT))

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the tasks, most important first."""
        return iter(self._tasks)

    def __len__(self) -> int:
        """Return the number of tasks."""
        return len(self._tasks)

    def _task(self, task: Task | str) -> Task:
        name = task.name if isinstance(task, Task) else task
        if name not in self._tasks:
            raise UnknownNameError("unknown task of the stack", got=name, choices=list(self._tasks))
        return self._tasks[name]


def base_from_joints(
    contact_jacobian: Float64[np.ndarray, "6 nv"],
) -> Float64[np.ndarray, "6 nj"]:
    """Return X in v_base = X u, for a contact frame that stands still: (11) of Zhang and Kikuuwe.

    From J_b v_base + J_j u = 0 follows X = -J_b^-1 J_j, for any frame, in any axes. J_b only moves
    a velocity from the base to the contact: it is [A B; 0 A] with a rotation A.
    """
    A, B = contact_jacobian[:3, :3], contact_jacobian[:3, 3:BASE]
    angular = A.T @ contact_jacobian[3:, BASE:]
    linear = A.T @ (contact_jacobian[:3, BASE:] - B @ angular)
    return -np.concatenate((linear, angular))


def constrained(
    jacobian: Float64[np.ndarray, "m nv"], base_map: Float64[np.ndarray, "6 nj"]
) -> Float64[np.ndarray, "m nj"]:
    """Return J_j + J_b X, which maps joint velocities under the stance constraint, as in (13)."""
    return jacobian[:, BASE:] + jacobian[:, :BASE] @ base_map


class HomeJacobians:
    """Jacobians of a stack in the home posture, against which loss of rank is measured."""

    def __init__(self, robot: Robot, stack: Stack) -> None:
        owners = [*stack.contacts, *(task for _, task in stack.tasks())]
        self._jacobians = home_jacobians(Dynamics(robot), owners)

    def scale(
        self, owner: Contact | Task, stance: Contact | None, joints: Int64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " m"]:
        """Return one over the size of an owner's rows; rows of a block share the largest."""
        jacobian = self._jacobians[owner]
        if stance is not None:
            jacobian = constrained(jacobian, base_from_joints(self._jacobians[stance]))
        return block_scales(np.linalg.norm(jacobian[:, joints], axis=1), owner.blocks)


class VelocityRows:
    """Rows J u = v for one stance and one set of contacts that are held.

    The stance contact does not move, which gives the base's velocity and takes the base out of
    every row. The contacts that are held beside it come first, with velocity zero; the levels of
    the stack follow, with the velocities of `StackRows.update_velocities`. Joints of `led` have
    known velocities, and their effect on a row is taken off its velocity; their own rows are in no
    level.

    Attributes:
        stance: the contact that stands.
        stack_rows: the rows of the stack, on the whole velocity.
        jacobian: all rows, on the velocities of the joints that are solved for.
        velocity: their velocities; lower bounds of those of the self-collision limit.
        served: held contacts and levels, and the self-collision limit, for the closed form.
        joined: room for the same with rows of that limit in a level.
        levels: held contacts, then the user's levels, in views.
        led_velocity: velocities of the joints that are led [rad/s].
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        stance: Contact | None,
        held: Sequence[Contact],
        joints: Int64[np.ndarray, " n"],
        led: LedJoints,
        *,
        home: HomeJacobians,
    ) -> None:
        self.stance = stance
        moving = None
        if len(joints) < robot.nj:
            moving = [robot.joint_names[joint] for joint in joints]
        self.stack_rows = rows = StackRows(
            robot, stack, held, stance=stance, collisions="behind", joints=moving
        )
        weight = np.ones(len(rows.target))
        self.jacobian: Float64[np.ndarray, "m n"] = np.zeros((len(weight), len(joints)))
        self.velocity: Float64[np.ndarray, " m"] = rows.target
        # The rows of the self-collision limit stand behind all levels, those of led joints last.
        ends = np.append(0, rows.ends[: len(rows.ends) - led.levels])
        limits, last = rows.collision_rows, int(ends[-1])
        self._led, self._led_rows = led, slice(last, int(rows.ends[-1]))
        self._led_columns = led.index + robot.base_dofs
        self._constrained = ConstrainedRows(
            J=rows.J,
            joints=joints,
            base_map=np.zeros((0 if stance is None else BASE, len(joints))),
            jacobian=self.jacobian,
        )
        self.led_velocity: Float64[np.ndarray, " k"] = np.zeros(len(led.index))
        self._known = np.zeros(robot.nv)
        scale = np.ones(len(weight))
        contact_rows = zip(rows.contacts, rows.wrench_slices, strict=True)
        for owner, place in (*contact_rows, *rows.task_rows):
            scale[place] = home.scale(owner, stance, joints)
        self.served = VelocityLevels(
            jacobian=self.jacobian,
            velocity=self.velocity,
            weight=weight,
            scale=scale,
            rows=np.arange(last),
            ends=ends,
            limits=np.arange(limits.start, limits.stop),
            exact=EXACT,
        )
        self.joined = self.served.with_limits()
        places = [slice(a, b) for a, b in pairwise(ends.tolist())]
        self.levels = [
            PriorityRows(self.jacobian[a], self.velocity[a], weight[a], scale[a]) for a in places
        ]

    def fill(self, dynamics: Dynamics) -> None:
        """Write one state's rows."""
        rows, weight = self.stack_rows, self.served.weight
        rows.update_velocities(dynamics)
        np.multiply(rows.weight, rows.weight, out=weight)
        weight *= ROW_WEIGHT
        if self._led.levels:
            asked = self.velocity[self._led_rows]
            self.led_velocity = self._led.within_limits(asked, dynamics.state.q)
            self._known[self._led_columns] = self.led_velocity
        stance = rows.J[:0] if self.stance is None else self.stance.jacobian
        constrain(self._constrained.address, stance)
        if self._led.levels:
            if self.stance is not None:
                # Zero, but for a joint of `led` between the base and the stance.
                base_map = base_from_joints(stance)
                self._known[:BASE] = base_map[:, self._led.index] @ self.led_velocity
            self.velocity -= rows.J @ self._known
