"""`FullFormulation`: the conventional whole-body problem over accelerations and wrenches."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from poise.control._resolver import PHYSICS_LEVELS
from poise.dynamics import Dynamics
from poise.hqp import HierarchicalProblem
from poise.robots import Robot
from poise.stack import Contact, Stack, Task, is_held

WRENCH_COST = 1e-4
"""Final cost of a wrench component against the acceleration energy.

It only chooses among the internal forces that every level leaves free; it stands in the final
cost, below all levels, so it takes nothing from a task."""

_TaskRows = tuple[
    Task, Float64[np.ndarray, "m nv"], Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]
]
"""A task with the views of its rows: Jacobian, lower and upper bounds."""

_ContactRows = tuple[
    Contact,
    Float64[np.ndarray, "dim nv"],
    Float64[np.ndarray, " dim"],
    Float64[np.ndarray, "nv dim"],
    Float64[np.ndarray, " dim"],
    Float64[np.ndarray, " dim"],
]
"""A contact with the views of its rows, Jacobian and reference, of its wrench's columns in the
dynamics, and of its wrench's bounds."""


class FullFormulation:
    """Rows of section 2 and Table 1 of Ahn et al. 2024 for one set of active contacts.

    Variables are x = [dv; F], torques follow from the actuated rows (7):

        level 1   M_u dv - J_c,u^T F = -h_u                    base dynamics (6)
                  tau_min - h_l <= M_l dv - J_c,l^T F <= tau_max - h_l
        level 2   J_c dv = reference - drift                   stationary contacts (2)
                  C F <= 0                                     contact wrench cones (3)
                  bounds on joint accelerations and normal forces
        level 3.. J dv = reference - drift                     the user's tasks (4)
        cost      dv^T M dv / 2, the acceleration energy (27)

    Wrenches act on the robot, which turns the sign of the paper's F_c. A frame task on a frame in
    contact is suspended and has no rows: the contact already decides how that frame moves. A point
    contact leaves its frame free to turn and suspends position tasks only.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks, bound to the robot.
        contacts: those contacts of the stack that are active.

    Attributes:
        problem: the hierarchical problem, filled by `fill`.
        levels: the tasks that act, level by level; a level may be empty.
        suspended: tasks that a contact stands in for.
    """

    def __init__(self, robot: Robot, stack: Stack, contacts: Sequence[Contact]) -> None:
        self._robot, self._stack, self._contacts = robot, stack, tuple(contacts)
        self.suspended = tuple(t for _, t in stack.tasks() if is_held(t, contacts))
        self.levels = tuple(
            tuple(t for t in level if t not in self.suspended) for level in stack.levels
        )
        nv, base = robot.nv, robot.base_dofs
        starts = nv + np.concatenate(([0], np.cumsum([c.dim for c in contacts]))).astype(int)
        self._wrench_slices = [slice(int(a), int(b)) for a, b in pairwise(starts)]
        n = int(starts[-1])
        wrench_dim = n - nv
        self.problem = HierarchicalProblem.allocate(
            n,
            [nv, wrench_dim + sum(len(c.cone) for c in contacts)]
            + [sum(t.dim for t in level) for level in self.levels],
            names=["dynamics", "contacts", *(_level_name(level) for level in self.levels)],
            labels=[
                [
                    ("base dynamics", base),
                    *((f"torque limit of {j}", 1) for j in robot.joint_names),
                ],
                [(f"motion of contact {c.name}", c.dim) for c in contacts]
                + [(f"wrench cone of contact {c.name}", len(c.cone)) for c in contacts],
                *([(f"task {t.name}", t.dim) for t in level] for level in self.levels),
            ],
            bounds_level=1,
        )
        self._label_bounds()
        self._base, self._nv = base, nv
        problem = self.problem
        problem.H[nv:, nv:] = WRENCH_COST * np.eye(wrench_dim)
        physics, touch = problem.level(0), problem.level(1)
        self._mass_rows, self._actuated_rows = physics.A[:, :nv], physics.A[base:]
        self._cost_mass = problem.H[:nv, :nv]
        self._contact_motion = touch.A[:wrench_dim, :nv]
        self._contact_lower = touch.lower[:wrench_dim]
        self._contact_upper = touch.upper[:wrench_dim]
        joints = slice(base, nv)
        self._joint_lower, self._joint_upper = problem.x_lower[joints], problem.x_upper[joints]
        self._fill_cones(touch.A, touch.lower, touch.upper, wrench_dim)
        self._contact_rows = self._locate_contacts()
        self._task_rows = self._locate_tasks()

    def fill(self, dynamics: Dynamics) -> None:
        """Writes one state's rows into the problem.

        Args:
            dynamics: the state, up to date.
        """
        self._fill_limits(dynamics)
        self._fill_contacts(dynamics)
        self._fill_dynamics(dynamics)
        for task, jacobian, lower, upper in self._task_rows:
            task.evaluate(dynamics)
            jacobian[:] = task.jacobian
            np.subtract(task.reference, task.drift, out=lower)
            upper[:] = lower

    def torque(
        self, x: Float64[np.ndarray, " n"], dynamics: Dynamics
    ) -> Float64[np.ndarray, " nj"]:
        """Joint torques of a solution: the actuated rows (7), M_l dv + h_l - J_c,l^T F [N m]."""
        torque = np.dot(self._actuated_rows, x)
        torque += dynamics.h[self._base :]
        return torque

    def acceleration(self, x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " nv"]:
        """Generalized acceleration of a solution."""
        return x[: self._nv]

    def wrenches(self, x: Float64[np.ndarray, " n"]) -> dict[str, Float64[np.ndarray, " m"]]:
        """Wrench at each active contact of a solution, by the contact's name."""
        return {c.name: x[s] for c, s in zip(self._contacts, self._wrench_slices, strict=True)}

    def _fill_dynamics(self, dynamics: Dynamics) -> None:
        base, physics = self._base, self.problem.level(0)
        limit = self._stack.torque_limit
        h = dynamics.h
        self._mass_rows[:] = dynamics.M
        self._cost_mass[:] = dynamics.M
        np.negative(h[:base], out=physics.lower[:base])
        physics.upper[:base] = physics.lower[:base]
        np.subtract(limit.lower, h[base:], out=physics.lower[base:])
        np.subtract(limit.upper, h[base:], out=physics.upper[base:])

    def _fill_contacts(self, dynamics: Dynamics) -> None:
        for contact, jacobian, lower, columns, wrench_lower, wrench_upper in self._contact_rows:
            contact.evaluate(dynamics)
            jacobian[:] = contact.jacobian
            np.negative(contact.jacobian.T, out=columns)
            np.subtract(contact.reference, contact.drift, out=lower)
            wrench_lower[:] = contact.wrench_lower
            wrench_upper[:] = contact.wrench_upper
        self._contact_upper[:] = self._contact_lower

    def _fill_limits(self, dynamics: Dynamics) -> None:
        limit = self._stack.joint_limit
        limit.evaluate(dynamics)
        self._joint_lower[:] = limit.lower
        self._joint_upper[:] = limit.upper

    def _fill_cones(
        self,
        A: Float64[np.ndarray, "m n"],
        lower: Float64[np.ndarray, " m"],
        upper: Float64[np.ndarray, " m"],
        row: int,
    ) -> None:
        # Constant: the cones stand in the contacts' own frames.
        for contact, variables in zip(self._contacts, self._wrench_slices, strict=True):
            rows = slice(row, row + len(contact.cone))
            A[rows, variables] = contact.cone
            lower[rows], upper[rows] = -np.inf, 0.0
            row = rows.stop

    def _locate_contacts(self) -> list[_ContactRows]:
        problem, nv = self.problem, self._nv
        located: list[_ContactRows] = []
        for contact, variables in zip(self._contacts, self._wrench_slices, strict=True):
            rows = slice(variables.start - nv, variables.stop - nv)
            located.append(
                (
                    contact,
                    self._contact_motion[rows],
                    self._contact_lower[rows],
                    problem.level(0).A[:, variables],
                    problem.x_lower[variables],
                    problem.x_upper[variables],
                )
            )
        return located

    def _locate_tasks(self) -> list[_TaskRows]:
        located: list[_TaskRows] = []
        for i, tasks in enumerate(self.levels):
            view, row = self.problem.level(PHYSICS_LEVELS + i), 0
            for task in tasks:
                rows = slice(row, row + task.dim)
                row = rows.stop
                view.weights[rows] = task.weight
                located.append((task, view.A[rows, : self._nv], view.lower[rows], view.upper[rows]))
        return located

    def _label_bounds(self) -> None:
        robot = self._robot
        names = [("acceleration of the base", robot.base_dofs)]
        names += [(f"joint limit of {j}", 1) for j in robot.joint_names]
        names += [(f"normal force of contact {c.name}", c.dim) for c in self._contacts]
        self.problem.labels[:1] = [(name, count) for name, count in names if count]


def _level_name(level: Sequence[Task]) -> str:
    return ", ".join(task.name for task in level)
