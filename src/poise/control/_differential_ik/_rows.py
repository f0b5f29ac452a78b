"""`VelocityRows`: contacts and the user's levels as rows on joint velocities.

`RowWeights`: W_A, what each row counts in its level; may change every tick.
The floating base under a stance contact: its velocity follows from the joints'.
`HomeJacobians`: how far joints move contacts and tasks in the home posture.
"""

from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import Numbers
from poise.control._differential_ik._base import BASE, constrain, map_base
from poise.control._differential_ik._kernels import VelocityLevel, VelocityLevels
from poise.control._differential_ik._led import LedJoints
from poise.control._differential_ik._limited import LimitedLevels
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import Robot
from poise.stack import Contact, Stack, StackRows, Task, checked_gain, home_jacobians

ROW_WEIGHT = 1e4
"""W_A of a row whose task has weight one.

The SR-inverse weighs rows against the joint velocities themselves: a row that moves a radian a unit
then misses a ten-thousandth of what it is asked for."""


class RowWeights:
    """Diagonal of W_A in (20) of Zhang and Kikuuwe, by task: `weights[task] = 100.0`.

    It is `ROW_WEIGHT` times the task's own weight squared, because a level's slack is measured as
    |W w|; whoever leads the stack may as well say `Task.set_weight`. Weights count within a level,
    and in the closed form against the joint velocities; the exact levels of the closed form have
    none.
    """

    def __init__(self, stack: Stack) -> None:
        self._tasks = {task.name: task for _, task in stack.tasks()}

    def __getitem__(self, task: Task | str) -> Float64[np.ndarray, " m"]:
        """Weights of a task's rows, a copy."""
        weight = self._task(task).weight
        return ROW_WEIGHT * weight * weight

    def __setitem__(self, task: Task | str, weight: Numbers) -> None:
        """Sets the weights of a task's rows, one number or one a row."""
        found = self._task(task)
        what = f"row weight of task {found.name!r}"
        rows = checked_gain(weight, found.dim, what)
        if rows.min() <= 0.0:
            raise ConfigurationError(f"{what} must be positive", got=weight, wanted="> 0")
        found.set_weight(np.sqrt(rows / ROW_WEIGHT))

    def __iter__(self) -> Iterator[str]:
        """Names of the tasks, most important first."""
        return iter(self._tasks)

    def __len__(self) -> int:
        """Number of tasks."""
        return len(self._tasks)

    def _task(self, task: Task | str) -> Task:
        name = task.name if isinstance(task, Task) else task
        if name not in self._tasks:
            raise UnknownNameError("unknown task of the stack", got=name, choices=list(self._tasks))
        return self._tasks[name]


def base_from_joints(
    contact_jacobian: Float64[np.ndarray, "6 nv"],
) -> Float64[np.ndarray, "6 nj"]:
    """X in v_base = X u, for a contact frame that stands still.

    From J_b v_base + J_j u = 0 follows X = -J_b^-1 J_j: equation (11) of Zhang and Kikuuwe for any
    frame, in any axes. J_b only moves a velocity from the base to the contact and can always be
    inverted.
    """
    jacobian = np.array(contact_jacobian, order="C")
    joints = np.arange(jacobian.shape[1] - BASE)
    base_map = np.zeros((BASE, len(joints)))
    map_base(jacobian, joints, base_map, np.zeros((BASE, BASE)))
    return base_map


def constrained(
    jacobian: Float64[np.ndarray, "m nv"], base_map: Float64[np.ndarray, "6 nj"]
) -> Float64[np.ndarray, "m nj"]:
    """A Jacobian under the stance constraint, J_j + J_b X, which maps joint velocities alone.

    For the COM and the centroidal momentum this is (13) of Zhang and Kikuuwe.
    """
    found = np.zeros((len(jacobian), base_map.shape[1]))
    constrain(np.array(jacobian, order="C"), np.arange(base_map.shape[1]), base_map, found)
    return found


class HomeJacobians:
    """Jacobians of a stack in the home posture, taken before the first tick.

    Loss of rank is measured against them, so that metres, radians and momenta, wrists and hips can
    be compared.
    """

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
        sizes = np.linalg.norm(jacobian[:, joints], axis=1)
        scale = np.ones(len(sizes))
        for start, stop in pairwise(accumulate(owner.blocks, initial=0)):
            largest = float(sizes[start:stop].max())
            # A block that nothing moves has no rank to lose.
            if largest > 0.0:
                scale[start:stop] = 1.0 / largest
        return scale


class VelocityRows:
    """Rows J u = v for one stance and one set of contacts that are held.

    The stance contact does not move, which gives the base's velocity and takes the base out of
    every row. The contacts that are held beside it come first, with velocity zero; the levels of
    the stack follow, with the velocities of `StackRows.update_velocities`. Joints of `led` have
    known velocities, and what these do to a row is taken off its velocity; their own rows are in no
    level.

    Attributes:
        stance: the contact that stands.
        stack_rows: the rows of the stack, on the whole velocity.
        stacked: the rows of held contacts, then of the user's levels, that `fill` writes.
        levels: the same level by level, in views.
        jacobian: all rows, on the velocities of the joints that are solved for.
        velocity: their velocities; lower bounds of those of the self-collision limit.
        led_velocity: velocities of the joints that are led [rad/s].
        limited: levels and the rows of the self-collision limit, where there are any.
        base_map: base velocity by velocities of the joints that are solved for; None for a fixed
            base.
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
        self.stance, self._joints = stance, joints
        moving = None
        if len(joints) < robot.nj:
            moving = [robot.joint_names[joint] for joint in joints]
        self.stack_rows = rows = StackRows(
            robot, stack, held, stance=stance, collisions="behind", joints=moving
        )
        self._weight = np.ones(len(rows.target))
        self.jacobian: Float64[np.ndarray, "m n"] = np.zeros((len(rows.target), len(joints)))
        self.velocity: Float64[np.ndarray, " m"] = rows.target
        # The rows of the self-collision limit stand behind all levels, those of led joints last.
        ends = np.append(0, rows.ends[: len(rows.ends) - led.levels])
        limit_rows, last = rows.collision_rows, int(ends[-1])
        self._led, self._led_rows = led, slice(last, int(rows.ends[-1]))
        self._led_columns = led.index + robot.base_dofs
        self.led_velocity: Float64[np.ndarray, " k"] = np.zeros(len(led.index))
        self._known = np.zeros(robot.nv)
        # A fixed base has no velocity to be mapped.
        base = 0 if stance is None else BASE
        self._base_map, self._scratch = np.zeros((base, len(joints))), np.zeros((base, base))
        self._led_map = np.zeros((base, len(led.index)))
        self.base_map = None if stance is None else self._base_map
        scale = np.ones(len(rows.target))
        contact_rows = zip(rows.contacts, rows.wrench_slices, strict=True)
        for owner, place in (*contact_rows, *rows.task_rows):
            scale[place] = home.scale(owner, stance, joints)
        self.stacked = VelocityLevels(
            self.jacobian[:last], self.velocity[:last], self._weight[:last], scale[:last], ends
        )
        limits = VelocityLevel(
            self.jacobian[limit_rows],
            self.velocity[limit_rows],
            self._weight[limit_rows],
            scale[limit_rows],
        )
        self.limited = LimitedLevels(self.stacked, limits)
        self.levels = [self.stacked.level(i) for i in range(len(ends) - 1)]
        self._compile(robot.nv)

    def fill(self, dynamics: Dynamics) -> None:
        """Writes one state's rows."""
        self.stack_rows.update_velocities(dynamics)
        np.multiply(self.stack_rows.weight, self.stack_rows.weight, out=self._weight)
        self._weight *= ROW_WEIGHT
        if self.stance is not None:
            map_base(self.stance.jacobian, self._joints, self._base_map, self._scratch)
        constrain(self.stack_rows.J, self._joints, self._base_map, self.jacobian)
        if self._led.levels:
            self._lead(dynamics.state.q)

    def _lead(self, q: Float64[np.ndarray, " nq"]) -> None:
        """Takes what led joints do off the velocities of all rows, their own included."""
        self.led_velocity = self._led.within_limits(self.velocity[self._led_rows], q)
        self._known[self._led_columns] = self.led_velocity
        if self.stance is not None:
            # Zero, but for a led joint between the base and the stance.
            map_base(self.stance.jacobian, self._led.index, self._led_map, self._scratch)
            self._known[:BASE] = self._led_map @ self.led_velocity
        self.velocity -= self.stack_rows.J @ self._known

    def _compile(self, nv: int) -> None:
        """Eliminates nothing once, so that nothing is compiled in a tick."""
        none = self._joints[:0]
        map_base(np.zeros((0, nv)), none, np.zeros((0, 0)), np.zeros((0, 0)))
        constrain(self.stack_rows.J[:0], none, self._base_map, self.jacobian)
