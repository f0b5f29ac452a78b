"""`ConstraintChainProblem`: LQP 1, contacts and balance on the reduced robot."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.control._full_problem import WRENCH_COST
from poise.control._reduced._assignment import AssignedRows
from poise.control._reduced._eliminate import Eliminated
from poise.control._reduced._elimination import ChainElimination
from poise.control._strategy import PHYSICS_LEVELS
from poise.dynamics import ReducedDynamics
from poise.hqp import HierarchicalProblem
from poise.robots import Robot
from poise.stack import Stack


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
        tasks: the rows of the stack and which of them are for LQP 1.
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
        tasks: AssignedRows,
        reduced: ReducedDynamics,
        shape: Sequence[int],
    ) -> None:
        self._stack, self._rows, self._tasks = stack, tasks.stack_rows, tasks
        self._reduced = reduced
        part = reduced.partition
        self._base = base = robot.base_dofs
        kept, *left = shape
        self._motion = motion = slice(0, part.nr + kept)
        self._joints = part.a.index[base:] - base
        self.problem = problem = self._allocate([robot.joint_names[i] for i in self._joints], left)
        self._label_bounds([robot.joint_names[i] for i in self._joints], part.nz + kept)
        wrench_dim, touch = self._rows.contact_rows.stop, problem.level(1)
        problem.H[motion.stop :, motion.stop :] = WRENCH_COST * np.eye(wrench_dim)
        # Constant: the cones stand in the contacts' own frames.
        touch.A[wrench_dim:, motion.stop :] = self._rows.cone
        touch.lower[wrench_dim:], touch.upper[wrench_dim:] = -np.inf, 0.0
        self._contact_target = touch.lower[:wrench_dim], touch.upper[:wrench_dim]
        self._wrench_bounds = problem.x_lower[motion.stop :], problem.x_upper[motion.stop :]
        self._index = part.a.index, tasks.first, self._places(tasks, left), self._centroid(tasks)

    def fill(self, chain: ChainElimination) -> None:
        """Writes one state's rows into the problem.

        Args:
            chain: the unconstrained chain, with as many rows left as told; it, the reduced dynamics
                and the stack's rows are up to date.
        """
        problem, rows, tasks = self.problem, self._rows, self._tasks
        for bound in self._contact_target:
            bound[:] = rows.target[rows.contact_rows]
        lower, upper = self._wrench_bounds
        lower[:], upper[:] = rows.wrench_lower, rows.wrench_upper
        torque, joint = self._stack.torque_limit, self._stack.joint_limit
        _fill(
            self._index,
            (self._reduced.M, self._reduced.h_a, rows.J[rows.contact_rows]),
            (tasks.J, tasks.target, tasks.weight),
            (chain.out, chain.used, chain.kept, chain.centroid_rows),
            (torque.lower, torque.upper, joint.lower, joint.upper),
            self._base,
            (problem.A, problem.lower, problem.upper, problem.weights, problem.H, problem.g),
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
        return self._rows.wrenches(x[self._motion.stop :])

    def _allocate(self, joints: list[str], left: Sequence[int]) -> HierarchicalProblem:
        rows, levels = self._rows, self._tasks.levels
        wrench_dim = rows.contact_rows.stop
        return HierarchicalProblem.allocate(
            self._motion.stop + wrench_dim,
            [
                self._base + len(joints),
                wrench_dim + len(rows.cone),
                *(sum(len(a.first) for a in v) + k for v, k in zip(levels, left, strict=True)),
            ],
            names=["dynamics", "contacts", *rows.level_names],
            labels=[
                [("base dynamics", self._base), *((f"torque limit of {j}", 1) for j in joints)],
                rows.motion_labels + rows.cone_labels,
                *(
                    [
                        *((f"task {a.task.name}", len(a.first)) for a in level),
                        ("unconstrained chain", k),
                    ]
                    for level, k in zip(levels, left, strict=True)
                ),
            ],
            bounds_level=1,
        )

    def _label_bounds(self, joints: list[str], inside: int) -> None:
        bounds = [("acceleration of the base", self._base)]
        bounds += [(f"joint limit of {j}", 1) for j in joints]
        bounds += [("acceleration of the unconstrained chain", inside), *self._rows.force_labels]
        self.problem.labels[:1] = [(name, count) for name, count in bounds if count]

    def _places(self, tasks: AssignedRows, left: Sequence[int]) -> Int64[np.ndarray, " k"]:
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
                row += count
            leftovers += range(row, row + k)
        return np.array(firsts + leftovers, dtype=np.int64)

    def _centroid(self, tasks: AssignedRows) -> Int64[np.ndarray, " first"]:
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
    Float64[np.ndarray, " nm"],
    Float64[np.ndarray, "n n"],
    Float64[np.ndarray, " n"],
]


@compiled
def _fill(
    index: _Index,
    robot: _Robot,
    tasks: tuple[Float64[np.ndarray, "t nv"], Float64[np.ndarray, " t"], Float64[np.ndarray, " t"]],
    chain: _Chain,
    limits: _Limits,
    base: int,
    problem: _Problem,
) -> None:
    a, first, places, centroid = index
    M_r, h_a, J_c = robot
    J, target, weight = tasks
    eliminated, used, kept, centroid_rows = chain
    tau_min, tau_max, dv_min, dv_max = limits
    A, lower, upper, weights, H, g = problem
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
        weights[n + place] = weight[row]
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
            factor = G[k, i]
            if factor != 0.0:
                g[i] -= factor * c[k]
                for j in range(motion):
                    H[i, j] += factor * G[k, j]
