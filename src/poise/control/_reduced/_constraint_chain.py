"""`ConstraintChainProblem`: LQP 1, contacts and balance on the reduced robot."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.control._formulation import WRENCH_COST
from poise.control._reduced._eliminate import Eliminated
from poise.control._reduced._elimination import ChainElimination
from poise.control._reduced._task_rows import TaskRows
from poise.control._resolver import PHYSICS_LEVELS
from poise.dynamics import Dynamics, ReducedDynamics
from poise.hqp import HierarchicalProblem, LevelView
from poise.robots import Robot
from poise.stack import Contact, Stack


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
        tasks: the rows of the tasks that act.
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
        tasks: TaskRows,
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
                for level, k in zip(tasks.levels, left, strict=True)
            ],
            names=[
                "dynamics",
                "contacts",
                *(", ".join(a.task.name for a in level) for level in tasks.levels),
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
                    for level, k in zip(tasks.levels, left, strict=True)
                ),
            ],
            bounds_level=1,
        )
        bounds = [("acceleration of the base", base), *((f"joint limit of {j}", 1) for j in names)]
        bounds += [("acceleration of the unconstrained chain", part.nz + kept)]
        bounds += [(f"normal force of contact {c.name}", c.dim) for c in contacts]
        problem.labels[:1] = [(name, count) for name, count in bounds if count]
        self._wrench_dim = wrench_dim = n - motion.stop
        problem.H[motion.stop :, motion.stop :] = WRENCH_COST * np.eye(wrench_dim)
        self._fill_cones(problem.level(1), wrench_dim)
        self._jacobian = np.zeros((wrench_dim, robot.nv))
        self._contact_rows = [
            (c, self._jacobian[rows := slice(w.start - motion.stop, w.stop - motion.stop)], rows, w)
            for c, w in zip(contacts, self._wrenches, strict=True)
        ]
        self._tasks = tasks
        self._index = part.a.index, tasks.first, self._places(tasks, left), self._centroid(tasks)

    def fill(self, dynamics: Dynamics, chain: ChainElimination) -> None:
        """Writes one state's rows into the problem.

        Args:
            dynamics: the state; the reduced dynamics, the tasks and the joint limit are up to date.
            chain: the unconstrained chain, up to date, with as many rows left as told.
        """
        problem, tasks = self.problem, self._tasks
        touch = problem.level(1)
        for contact, jacobian, rows, variables in self._contact_rows:
            contact.evaluate(dynamics)
            jacobian[:] = contact.jacobian
            np.subtract(contact.reference, contact.drift, out=touch.lower[rows])
            problem.x_lower[variables] = contact.wrench_lower
            problem.x_upper[variables] = contact.wrench_upper
        touch.upper[: self._wrench_dim] = touch.lower[: self._wrench_dim]
        torque, joint = self._stack.torque_limit, self._stack.joint_limit
        _fill(
            self._index,
            (self._reduced.M, self._reduced.h_a, self._jacobian),
            (tasks.J, tasks.target),
            (chain.out, chain.used, chain.kept, chain.centroid_rows),
            (torque.lower, torque.upper, joint.lower, joint.upper),
            self._base,
            (problem.A, problem.lower, problem.upper, problem.H, problem.g),
        )

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

    def _fill_cones(self, touch: LevelView, row: int) -> None:
        # Constant: the cones stand in the contacts' own frames.
        for contact, variables in zip(self._contacts, self._wrenches, strict=True):
            rows = slice(row, row + len(contact.cone))
            touch.A[rows, variables] = contact.cone
            touch.lower[rows], touch.upper[rows] = -np.inf, 0.0
            row = rows.stop

    def _places(self, tasks: TaskRows, left: Sequence[int]) -> Int64[np.ndarray, " k"]:
        """Rows of the problem for the tasks' first rows, then those for what the levels leave."""
        firsts: list[int] = []
        leftovers: list[int] = []
        for view, level, k in zip(
            self.problem.levels[PHYSICS_LEVELS:], tasks.levels, left, strict=True
        ):
            row = view.slice.start
            for assignment in level:
                count = len(assignment.first)
                firsts += range(row, row + count)
                self.problem.weights[self.problem.n + row : self.problem.n + row + count] = (
                    assignment.task.weight[assignment.first]
                )
                row += count
            leftovers += range(row, row + k)
        return np.array(firsts + leftovers, dtype=np.int64)

    def _centroid(self, tasks: TaskRows) -> Int64[np.ndarray, " first"]:
        """For each of the tasks' first rows, its place among those of the centroids, or -1."""
        places = np.full(len(tasks.first), -1, dtype=np.int64)
        places[np.isin(tasks.first, tasks.centroid)] = np.arange(len(tasks.centroid))
        return places


_Index = tuple[
    Int64[np.ndarray, " na"],
    Int64[np.ndarray, " first"],
    Int64[np.ndarray, " places"],
    Int64[np.ndarray, " first"],
]
_Robot = tuple[
    Float64[np.ndarray, "nr nr"], Float64[np.ndarray, " na"], Float64[np.ndarray, "w nv"]
]
_Chain = tuple[Eliminated, int, int, Float64[np.ndarray, "centroid nu"]]
_Limits = tuple[
    Float64[np.ndarray, " nj"],
    Float64[np.ndarray, " nj"],
    Float64[np.ndarray, " nj"],
    Float64[np.ndarray, " nj"],
]
_Problem = tuple[
    Float64[np.ndarray, "m n"],
    Float64[np.ndarray, " nm"],
    Float64[np.ndarray, " nm"],
    Float64[np.ndarray, "n n"],
    Float64[np.ndarray, " n"],
]


@compiled
def _fill(
    index: _Index,
    robot: _Robot,
    tasks: tuple[Float64[np.ndarray, "t nv"], Float64[np.ndarray, " t"]],
    chain: _Chain,
    limits: _Limits,
    base: int,
    problem: _Problem,
) -> None:
    a, first, places, centroid = index
    M_r, h_a, J_c = robot
    J, target = tasks
    eliminated, used, kept, centroid_rows = chain
    tau_min, tau_max, dv_min, dv_max = limits
    A, lower, upper, H, g = problem
    na, nr, n = len(a), len(M_r), len(g)
    motion, nz = nr + kept, nr - na
    # Level 1: [M_aa C] [dv_a; z] - J_c,a^T F.
    for i in range(na):
        for j in range(nr):
            A[i, j] = M_r[i, j]
        for j in range(len(J_c)):
            A[i, motion + j] = -J_c[j, a[i]]
            A[na + j, i] = J_c[j, a[i]]
        joint = a[i] - base
        if joint < 0:
            lower[n + i] = upper[n + i] = -h_a[i]
        else:
            lower[n + i] = tau_min[joint] - h_a[i]
            upper[n + i] = tau_max[joint] - h_a[i]
            lower[i], upper[i] = dv_min[joint], dv_max[joint]
    # Tasks of the reduced robot.
    for k in range(len(first)):
        row, place = first[k], places[k]
        for i in range(na):
            A[place, i] = J[row, a[i]]
        if centroid[k] >= 0:
            for i in range(nz):
                A[place, na + i] = centroid_rows[centroid[k], i]
        lower[n + place] = upper[n + place] = target[row]
    # What tasks of the unconstrained chain leave.
    for k in range(len(places) - len(first)):
        place = places[len(first) + k]
        for i in range(motion):
            A[place, i] = eliminated.rows[k, i]
        lower[n + place] = upper[n + place] = eliminated.values[k]
    # The energy of the reduced robot, and |c - G x|^2 / 2 of the motion inside the chain.
    G, c = eliminated.G, eliminated.c
    for i in range(motion):
        g[i] = 0.0
        for j in range(motion):
            H[i, j] = M_r[i, j] if i < nr and j < nr else 0.0
    for k in range(used):
        for i in range(motion):
            share = G[k, i]
            if share != 0.0:
                g[i] -= share * c[k]
                for j in range(motion):
                    H[i, j] += share * G[k, j]
