"""`VelocityFormulation`: contacts and the user's levels as rows on joint velocities."""

from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise

import numpy as np
from jaxtyping import Float64, Int64

from poise.balance import saturate
from poise.contacts.contact import Contact
from poise.control.differential_ik.closed_form import VelocityLevel
from poise.control.differential_ik.home import HomeJacobians
from poise.control.differential_ik.row_weights import RowWeights
from poise.control.differential_ik.stance import base_from_joints, constrained
from poise.control.held import is_held
from poise.control.stack import Stack
from poise.dynamics.dynamics import Dynamics
from poise.tasks import Task


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
        weights: W_A of the stack's tasks.
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
        weights: RowWeights,
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
        self._weight_rows = [(rows, weights.live(task)) for task, rows in self.task_rows]
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
        for rows, weight in self._weight_rows:
            self._weight[rows] = weight
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
