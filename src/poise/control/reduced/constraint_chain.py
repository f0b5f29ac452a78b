"""`ConstraintChainProblem`: LQP 1, contacts and balance on the reduced robot."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from poise.contacts.contact import Contact
from poise.control.formulation import WRENCH_COST
from poise.control.reduced.assignment import Assignment
from poise.control.reduced.elimination import ChainElimination
from poise.control.reduced.rows import locate_rows
from poise.control.stack import Stack
from poise.dynamics import Dynamics, ReducedDynamics
from poise.hqp import HierarchicalProblem, LevelView
from poise.robots.robot import Robot


class ConstraintChainProblem:
    """LQP 1 of Ahn et al. 2024, (28), for one set of active contacts.

    Variables are x = [dv_a; z; s; F]: base, constraint chain and kept joints, the centroids of the
    unconstrained chain, what else of it is not eliminated, and the wrenches. With M_r, C and
    h_a of `ReducedDynamics`:

        level 1   [M_aa C] [dv_a; z] - J_c,a^T F = S_a tau - h_a      base rows: tau = 0
                  torque limits of the constraint chain and of kept joints, exact
        level 2   J_c,a dv_a = reference - drift, C F <= 0
                  bounds on the accelerations of these joints and on normal forces
        level 3.. [J_a J_u Jbar_z] [dv_a; z] = reference - drift      rows assigned to LQP 1
                  what tasks of the unconstrained chain leave over    `ChainElimination`
        cost      [dv_a; z]^T M_r [dv_a; z] / 2, the acceleration energy (27), with that of the
                  motion inside the unconstrained chain, |c - G [dv_a; z; s]|^2 / 2

    Levels are those of the stack; one whose tasks all need LQP 2 may be empty here.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks, bound to the robot.
        contacts: those contacts of the stack that are active.
        assignments: of the tasks that act, level by level.
        reduced: the reduced dynamics for these contacts, updated by the caller.
        shape: how many unknowns s and how many rows in each level the unconstrained chain leaves
            over, `ChainElimination.shape`.

    Attributes:
        problem: the hierarchical problem, filled by `fill`.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        contacts: Sequence[Contact],
        assignments: Sequence[Sequence[Assignment]],
        reduced: ReducedDynamics,
        shape: Sequence[int],
    ) -> None:
        self._stack, self._contacts, self._reduced = stack, tuple(contacts), reduced
        part = reduced.partition
        self._base = base = robot.base_dofs
        self._na, self._nr = na, nr = part.na, part.nr
        kept, *left = shape
        self._motion = motion = slice(0, nr + kept)
        self._joints = part.a.index[base:] - base
        ends = motion.stop + np.concatenate(([0], np.cumsum([c.dim for c in contacts]))).astype(int)
        self._wrenches = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        n = int(ends[-1])
        names = [robot.joint_names[i] for i in self._joints]
        self.problem = problem = HierarchicalProblem.allocate(
            n,
            [na, n - motion.stop + sum(len(c.cone) for c in contacts)]
            + [
                sum(len(a.first) for a in level) + k
                for level, k in zip(assignments, left, strict=True)
            ],
            names=[
                "dynamics",
                "contacts",
                *(", ".join(a.task.name for a in level) for level in assignments),
            ],
            labels=[
                [("base dynamics", base), *((f"torque limit of {j}", 1) for j in names)],
                [(f"motion of contact {c.name}", c.dim) for c in contacts]
                + [(f"wrench cone of contact {c.name}", len(c.cone)) for c in contacts],
                *(
                    [
                        *((f"task {a.task.name}", len(a.first)) for a in level),
                        ("unconstrained chain", k),
                    ]
                    for level, k in zip(assignments, left, strict=True)
                ),
            ],
            bounds_level=1,
        )
        bounds = [("acceleration of the base", base), *((f"joint limit of {j}", 1) for j in names)]
        bounds += [("acceleration of the unconstrained chain", part.nz + kept)]
        bounds += [(f"normal force of contact {c.name}", c.dim) for c in contacts]
        problem.labels[:1] = [(name, count) for name, count in bounds if count]
        self._chain_energy = np.zeros((motion.stop, motion.stop))
        wrench_dim = n - motion.stop
        problem.H[motion.stop :, motion.stop :] = WRENCH_COST * np.eye(wrench_dim)
        self._fill_cones(problem.level(1), wrench_dim)
        self._task_rows = locate_rows(
            problem.levels[2:], [[(a, a.first) for a in level] for level in assignments]
        )

    def fill(self, dynamics: Dynamics, chain: ChainElimination) -> None:
        """Writes one state's rows into the problem.

        Args:
            dynamics: the state; the reduced dynamics, the tasks and the joint limit are up to date.
            chain: the unconstrained chain, up to date, with as many rows left as told.
        """
        self._fill_dynamics(chain)
        for view, (rows, values) in zip(self.problem.levels[2:], chain.demands, strict=True):
            if len(values):
                view.A[-len(values) :, : rows.shape[1]] = rows
                view.lower[-len(values) :] = view.upper[-len(values) :] = values
        self._fill_contacts(dynamics)
        na, nr, a = self._na, self._nr, self._reduced.partition.a
        for assignment, rows, A, lower, upper in self._task_rows:
            task = assignment.task
            if assignment.through_centroids:
                self._reduced.reduced_jacobian(task.jacobian[rows], A[:, :nr])
            else:
                a.columns(task.jacobian[rows], A[:, :na])
            np.subtract(task.reference[rows], task.drift[rows], out=lower)
            upper[:] = lower

    def acceleration(self, x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " k"]:
        """What a solution decides of the accelerations: (dv_a, z, s)."""
        return x[self._motion]

    def torque(self, x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " k"]:
        """Torques of the joints of `a` in a solution [N m]; the base's rows, near zero, first."""
        torque = self.problem.level(0).A.dot(x)
        torque += self._reduced.h_a
        return torque

    def wrenches(self, x: Float64[np.ndarray, " n"]) -> dict[str, Float64[np.ndarray, " m"]]:
        """Wrench at each active contact in a solution, by the contact's name [N, N m]."""
        return {c.name: x[s] for c, s in zip(self._contacts, self._wrenches, strict=True)}

    def _fill_dynamics(self, chain: ChainElimination) -> None:
        base, na, nr = self._base, self._na, self._nr
        reduced, physics = self._reduced, self.problem.level(0)
        torque, joint = self._stack.torque_limit, self._stack.joint_limit
        physics.A[:, :nr] = reduced.M[:na]
        energy = self.problem.H[self._motion, self._motion]
        np.dot(chain.G.T, chain.G, out=self._chain_energy)
        energy[:] = self._chain_energy
        energy[:nr, :nr] += reduced.M
        np.negative(chain.c.dot(chain.G), out=self.problem.g[self._motion])
        h = reduced.h_a
        np.negative(h[:base], out=physics.lower[:base])
        physics.upper[:base] = physics.lower[:base]
        np.subtract(torque.lower[self._joints], h[base:], out=physics.lower[base:])
        np.subtract(torque.upper[self._joints], h[base:], out=physics.upper[base:])
        self.problem.x_lower[base:na] = joint.lower[self._joints]
        self.problem.x_upper[base:na] = joint.upper[self._joints]

    def _fill_contacts(self, dynamics: Dynamics) -> None:
        problem, na, first = self.problem, self._na, self._motion.stop
        physics, touch, a = problem.level(0), problem.level(1), self._reduced.partition.a
        for contact, variables in zip(self._contacts, self._wrenches, strict=True):
            contact.evaluate(dynamics)
            rows = slice(variables.start - first, variables.stop - first)
            jacobian = touch.A[rows, :na]
            a.columns(contact.jacobian, jacobian)
            np.negative(jacobian.T, out=physics.A[:, variables])
            np.subtract(contact.reference, contact.drift, out=touch.lower[rows])
            touch.upper[rows] = touch.lower[rows]
            problem.x_lower[variables] = contact.wrench_lower
            problem.x_upper[variables] = contact.wrench_upper

    def _fill_cones(self, touch: LevelView, row: int) -> None:
        # Constant: the cones stand in the contacts' own frames.
        for contact, variables in zip(self._contacts, self._wrenches, strict=True):
            rows = slice(row, row + len(contact.cone))
            touch.A[rows, variables] = contact.cone
            touch.lower[rows], touch.upper[rows] = -np.inf, 0.0
            row = rows.stop
