"""`VelocityFormulation`: contacts and the user's levels as rows on joint velocities.

`RowWeights`: W_A, what each row counts in its level; may change every tick.
The floating base under a stance contact: its velocity follows from the joints'.
`HomeJacobians`: how far joints move contacts and tasks in the home posture.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate, pairwise

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import Numbers
from poise.control._differential_ik._closed_form import VelocityLevel
from poise.dynamics import Dynamics, saturate
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import Contact, Stack, Task, checked_gain, is_held

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

    Args:
        stack: whose tasks have rows; bound to the robot.
    """

    def __init__(self, stack: Stack) -> None:
        self._tasks = {task.name: task for _, task in stack.tasks()}

    def __getitem__(self, task: Task | str) -> Float64[np.ndarray, " m"]:
        """Weights of a task's rows, a copy.

        Raises:
            ConfigurationError: no such task.
        """
        return _row_weight(self._task(task))

    def __setitem__(self, task: Task | str, weight: Numbers) -> None:
        """Sets the weights of a task's rows, one number or one a row.

        Raises:
            ConfigurationError: no such task, a wrong length, or weights that are not positive.
        """
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
            raise ConfigurationError(
                "unknown task of the stack", got=name, choices=list(self._tasks)
            )
        return self._tasks[name]


def _row_weight(task: Task) -> Float64[np.ndarray, " m"]:
    return ROW_WEIGHT * task.weight * task.weight


BASE = 6
"""Velocities of a floating base."""


def base_from_joints(
    contact_jacobian: Float64[np.ndarray, "6 nv"],
) -> Float64[np.ndarray, "6 nj"]:
    """X in v_base = X u, for a contact frame that stands still.

    From J_b v_base + J_j u = 0 follows X = -J_b^-1 J_j: equation (11) of Zhang and Kikuuwe for any
    frame, in any axes. J_b only moves a velocity from the base to the contact and can always be
    inverted.

    Args:
        contact_jacobian: Jacobian of the contact frame, six rows.
    """
    return np.linalg.solve(contact_jacobian[:, :BASE], -contact_jacobian[:, BASE:])


def constrained(
    jacobian: Float64[np.ndarray, "m nv"], base_map: Float64[np.ndarray, "6 nj"]
) -> Float64[np.ndarray, "m nj"]:
    """A Jacobian under the stance constraint, J_j + J_b X, which maps joint velocities alone.

    For the COM and the centroidal momentum this is (13) of Zhang and Kikuuwe.

    Args:
        jacobian: maps the whole velocity v = [v_base; u].
        base_map: X.
    """
    return jacobian[:, :BASE] @ base_map + jacobian[:, BASE:]


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


class VelocityFormulation:
    """Rows J u = v for one stance and one set of contacts that are held.

    The stance contact does not move, which gives the base's velocity and takes the base out of
    every row. The contacts that are held beside it come first, with velocity zero; the levels of
    the stack follow. A task asks for its target's velocity plus its error fed back,

        v = target velocity + (kp / kd) error

    with the norm of each block of rows bounded where a bound was given, or for the velocity that
    it was given. Frame tasks on frames in contact are suspended.

    Args:
        stack: contacts and tasks, bound to the robot.
        stance: the contact that stands; None for a fixed base.
        held: other contacts that are active.
        joints: indices of the joints that may move.
        speeds: largest norm of the velocity that each block of a task's rows asks for, by name.
        home: Jacobians in the home posture, by which ranks are decided.

    Attributes:
        stance: the contact that stands.
        levels: held contacts, then the user's levels; views that `fill` writes into.
        suspended: tasks that a contact stands in for; they have no rows.
        held: contacts that are held, in the order of the first level.
        task_rows: tasks that act, with their rows.
        level_tasks: tasks that act, level by level.
        jacobian: rows of all levels.
        velocity: their velocities.
        base_map: base velocity by joint velocities, for the joints that may move; None for a fixed
            base.
    """

    def __init__(
        self,
        stack: Stack,
        stance: Contact | None,
        held: Sequence[Contact],
        joints: Int64[np.ndarray, " n"],
        *,
        speeds: Mapping[str, Float64[np.ndarray, " b"]],
        home: HomeJacobians,
    ) -> None:
        self.stance, self.held, self._joints = stance, tuple(held), joints
        holding = self.held if stance is None else (*self.held, stance)
        self.suspended = tuple(t for _, t in stack.tasks() if is_held(t, holding))
        self.level_tasks = [[t for t in level if t not in self.suspended] for level in stack.levels]
        tasks = [task for level in self.level_tasks for task in level]
        spans = _spans([*(c.dim for c in held), *(t.dim for t in tasks)])
        self._contact_rows = list(zip(self.held, spans, strict=False))
        self.task_rows = list(zip(tasks, spans[len(held) :], strict=True))
        self._gains = [(rows, velocity_gain(task)) for task, rows in self.task_rows]
        self._blocks = [
            (task, rows, _bounded_blocks(task, rows, speeds)) for task, rows in self.task_rows
        ]
        self._allocate(home)
        self._everything = len(joints) == len(home.joints)

    def fill(self, dynamics: Dynamics) -> None:
        """Writes one state's rows.

        Args:
            dynamics: the state, up to date.
        """
        for contact, rows in self._contact_rows:
            contact.evaluate(dynamics)
            self._full[rows] = contact.jacobian
        self._wanted[:] = 0.0
        for (task, rows), (_, gain) in zip(self.task_rows, self._gains, strict=True):
            task.evaluate(dynamics)
            self._full[rows] = task.jacobian
            wanted = gain * task.error
            wanted += task.error_rate
            self._wanted[rows] = wanted
        # The rate of an error is the target's velocity less that of the robot, J v.
        np.matmul(self._full, dynamics.state.v, out=self.velocity)
        self.velocity += self._wanted
        self.velocity[: self.levels[0].velocity.size] = 0.0
        self._bound_velocities()
        for task, rows in self.task_rows:
            self._weight[rows] = task.weight
        self._weight *= self._weight
        self._weight *= ROW_WEIGHT
        self._reduce(dynamics)

    def _bound_velocities(self) -> None:
        for task, rows, blocks in self._blocks:
            if task.given_velocity is not None:
                self.velocity[rows] = task.given_velocity
                continue
            for block, largest in blocks:
                self.velocity[block] = saturate(largest, self.velocity[block])

    def _reduce(self, dynamics: Dynamics) -> None:
        reduced = self._full
        if self.stance is not None:
            self.stance.evaluate(dynamics)
            base_map = base_from_joints(self.stance.jacobian)
            reduced = constrained(reduced, base_map)
            self.base_map = base_map if self._everything else base_map[:, self._joints]
        self.jacobian[:] = reduced if self._everything else reduced[:, self._joints]

    def _allocate(self, home: HomeJacobians) -> None:
        total = self.task_rows[-1][1].stop if self.task_rows else sum(c.dim for c in self.held)
        n = len(self._joints)
        self._full = np.zeros((total, home.nv))
        self._wanted = np.zeros(total)
        self._weight = np.ones(total)
        self.jacobian: Float64[np.ndarray, "m n"] = np.zeros((total, n))
        self.velocity: Float64[np.ndarray, " m"] = np.zeros(total)
        self.base_map: Float64[np.ndarray, "6 n"] | None = None
        scale = np.ones(total)
        for owner, rows in (*self._contact_rows, *self.task_rows):
            scale[rows] = home.scale(owner, self.stance, self._joints)
        sizes = [sum(c.dim for c in self.held)]
        sizes += [sum(t.dim for t in level) for level in self.level_tasks]
        self.levels = [
            VelocityLevel(self.jacobian[s], self.velocity[s], self._weight[s], scale[s])
            for s in _spans(sizes)
        ]


def velocity_gain(task: Task) -> Float64[np.ndarray, " m"]:
    """Gain of a task's error in its velocity, kp / kd [1/s]; zero where there is no stiffness.

    A PD controller with these gains lets a slow error die out at this rate.

    Args:
        task: the task, bound to a robot.
    """
    return np.divide(task.kp, task.kd, out=np.zeros(task.dim), where=task.kp > 0.0)


def _bounded_blocks(
    task: Task, rows: slice, speeds: Mapping[str, Float64[np.ndarray, " b"]]
) -> list[tuple[slice, float]]:
    if task.name not in speeds:
        return []
    ends = accumulate(task.blocks, initial=rows.start)
    blocks = [slice(a, b) for a, b in pairwise(ends)]
    return list(zip(blocks, speeds[task.name].tolist(), strict=True))


def _spans(sizes: Sequence[int]) -> list[slice]:
    return [slice(a, b) for a, b in pairwise(accumulate(sizes, initial=0))]
