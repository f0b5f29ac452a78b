"""`OperationalFormulation`: the physics and the user's levels as rows on accelerations."""

from collections.abc import Sequence
from itertools import accumulate, pairwise

import numpy as np

from poise.control._osf._levels import LevelRows
from poise.control._osf._scales import RowScales
from poise.dynamics import Dynamics
from poise.robots import Robot
from poise.stack import Contact, Stack, is_held

_RANGE_TOLERANCE = 1e-6
"""Singular value, relative to the largest, below which contacts do not carry a base wrench."""


class OperationalFormulation:
    """Writes `LevelRows` for one set of active contacts.

    The first level is the physics of the floating base (Park and Khatib 2006; Sentis, Park and
    Khatib 2010): contacts do not accelerate, J_c dv = reference - drift; and where contacts cannot
    carry every wrench of the base, as in flight or on points alone, the base obeys its own
    equation of motion, W (M_u dv + h_u) = 0 with W the projector on the wrenches that nobody
    carries. A fixed base has an empty first level. The levels of the stack follow.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks, bound to the robot.
        contacts: those contacts of the stack that are active.
        scales: what rows are measured against.

    Attributes:
        rows: the rows of the last state.
        suspended: tasks that a contact stands in for; they have no rows.
        contact_dim: number of contact rows; they come first.
        task_rows: tasks that act, with their rows.
    """

    def __init__(
        self, robot: Robot, stack: Stack, contacts: Sequence[Contact], scales: RowScales
    ) -> None:
        self.suspended = tuple(t for _, t in stack.tasks() if is_held(t, contacts))
        acting = [[t for t in level if t not in self.suspended] for level in stack.levels]
        self.contact_dim = sum(c.dim for c in contacts)
        # A surface carries any wrench; so does a fixed base.
        self._base = 0 if any(c.dim == 6 for c in contacts) else robot.base_dofs
        physics = self.contact_dim + self._base
        self.rows = LevelRows.allocate(
            [physics, *(sum(t.dim for t in level) for level in acting)], robot.nv
        )
        self._contact_rows = list(zip(contacts, _spans([c.dim for c in contacts], 0), strict=True))
        tasks = [task for level in acting for task in level]
        self.task_rows = list(zip(tasks, _spans([t.dim for t in tasks], physics), strict=True))
        for owner, rows in (*self._contact_rows, *self.task_rows):
            self.rows.scale[rows] = scales.of(owner)
        self.rows.scale[self.contact_dim : physics] = scales.base[: self._base]

    def fill(self, dynamics: Dynamics) -> None:
        """Writes one state's rows.

        Args:
            dynamics: the state, up to date.
        """
        jacobian, drift, reference = self.rows.jacobian, self.rows.drift, self.rows.reference
        for contact, rows in self._contact_rows:
            contact.evaluate(dynamics)
            jacobian[rows], drift[rows] = contact.jacobian, contact.drift
            reference[rows] = contact.reference
        if self._base:
            self._fill_base(dynamics)
        for task, rows in self.task_rows:
            task.evaluate(dynamics)
            jacobian[rows], drift[rows] = task.jacobian, task.drift
            reference[rows] = task.reference

    def _fill_base(self, dynamics: Dynamics) -> None:
        base = self._base
        rows = slice(self.contact_dim, self.contact_dim + base)
        unheld = np.eye(base)
        if self.contact_dim:
            _, singular, V = np.linalg.svd(self.rows.jacobian[: self.contact_dim, :base])
            V = V[: len(singular)][singular > _RANGE_TOLERANCE * singular[0]]
            unheld -= V.T @ V
        np.matmul(unheld, dynamics.M[:base], out=self.rows.jacobian[rows])
        np.matmul(unheld, -dynamics.h[:base], out=self.rows.reference[rows])


def _spans(sizes: Sequence[int], start: int) -> list[slice]:
    ends = list(accumulate(sizes, initial=start))
    return [slice(a, b) for a, b in pairwise(ends)]
