"""LQP 1 and LQP 2 of Ahn et al. 2024, the two problems of the reduced controller."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, compiled, part, view
from poise.control._full_problem import wrench_cost
from poise.control._reduced._assignment import AssignedRows
from poise.control._reduced._elimination import (
    ChainElimination,
    Elimination,
    eliminate_chain,
    recover,
)
from poise.control._row_factor import SLOP
from poise.control._strategy import PHYSICS_LEVELS
from poise.dynamics import Dynamics, Partition, ReducedDynamics, StateNumbers
from poise.hqp import HierarchicalProblem
from poise.robots import Robot
from poise.stack import Stack


class ConstraintChain(MemoryBlock):
    """A `ConstraintChainProblem` for compiled code."""

    chain: Elimination  # the unconstrained chain, eliminated
    J_c: Float64[np.ndarray, "w nv"]  # coefficients of dv of the contacts' rows
    contact_target: Float64[np.ndarray, " w"]  # their right-hand sides
    wrench_lower: Float64[np.ndarray, " w"]  # bounds of all wrenches [N, N m]
    wrench_upper: Float64[np.ndarray, " w"]
    tau_min: Float64[np.ndarray, " nj"]  # torque limits [N m]
    tau_max: Float64[np.ndarray, " nj"]
    dv_min: Float64[np.ndarray, " nj"]  # bounds of joint accelerations [rad/s^2]
    dv_max: Float64[np.ndarray, " nj"]
    task_upper: Float64[np.ndarray, " t"]  # upper bounds of the tasks' rows
    first: Int64[np.ndarray, " first"]  # rows of the tasks that LQP 1 decides
    places: Int64[np.ndarray, " places"]  # rows of the problem: for them, then for the chain
    centroid: Int64[np.ndarray, " first"]  # place among rows that move with the centroids, or -1
    A: Float64[np.ndarray, "m n"]  # rows, bounds, weights and cost of the problem
    lower: Float64[np.ndarray, " nm"]
    upper: Float64[np.ndarray, " nm"]
    weights: Float64[np.ndarray, " nm"]
    H: Float64[np.ndarray, "n n"]
    g: Float64[np.ndarray, " n"]
    shape: Int64[np.ndarray, " shape"]  # room for unknowns s, and for rows in each level
    torque_u: Float64[np.ndarray, " nu"]  # scratch: torques of the unconstrained chain [N m]
    base: int  # coordinates of the base


class Joined(NamedTuple):
    """Motion of both chains."""

    acceleration: Float64[np.ndarray, " nv"]  # generalized
    torque: Float64[np.ndarray, " nj"]  # of the joints [N m]
    within: bool  # the unconstrained chain keeps its limits of torque and acceleration


class ConstraintChainProblem:
    """LQP 1 of Ahn et al. 2024, (28), for one set of active contacts.

    Variables are x = [dv_a; z; s; F]: base, constraint chain and kept joints, the centroids of the
    unconstrained chain, the part of it that is not eliminated, and the wrenches. With M_r, C and
    h_a of `ReducedDynamics`:

        level 1   [M_aa C] [dv_a; z] - J_c,a^T F = S_a tau - h_a      base rows: tau = 0
                  torque limits of the constraint chain and of kept joints, exact
        level 2   J_c,a dv_a = reference - drift, C F <= 0
                  bounds on the accelerations of these joints and on normal forces
        level     balance limit, where there is one
        levels    [J_a J_u Jbar_z] [dv_a; z] = reference - drift      rows assigned to LQP 1
                  the rest of tasks of the unconstrained chain        `ChainElimination`
        cost      [dv_a; z]^T M_r [dv_a; z] / 2, the acceleration energy (27), with that of the
                  motion inside the unconstrained chain, |c - G [dv_a; z; s]|^2 / 2

    Levels are those of the stack; one whose tasks all need LQP 2 may be empty here.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        tasks: AssignedRows,
        partition: Partition,
        chain: ChainElimination,
    ) -> None:
        self._tasks, self._rows = tasks, (rows := tasks.stack_rows)
        self._base = base = robot.base_dofs
        self._nv, self._nj = robot.nv, robot.nj
        kept, *left = chain.shape
        self._motion = motion = slice(0, partition.nr + kept)
        joints = [robot.joint_names[i] for i in partition.a[base:] - base]
        self.problem = problem = self._allocate(joints, left)
        self._label_bounds(joints, partition.nz + kept)
        wrench_dim, touch = rows.contact_rows.stop, problem.level(1)
        problem.H[motion.stop :, motion.stop :] = wrench_cost(rows.contacts)
        rows.write_cones_into(touch.A[wrench_dim:, motion.stop :])
        touch.lower[wrench_dim:], touch.upper[wrench_dim:] = -np.inf, 0.0
        torque, joint = stack.torque_limit, stack.joint_limit
        self.block = ConstraintChain(
            chain=chain.block,
            J_c=rows.J[rows.contact_rows],
            contact_target=rows.target[rows.contact_rows],
            wrench_lower=rows.wrench_lower,
            wrench_upper=rows.wrench_upper,
            tau_min=torque.tick_lower,
            tau_max=torque.tick_upper,
            dv_min=joint.lower,
            dv_max=joint.upper,
            task_upper=tasks.upper,
            first=tasks.first,
            places=self._places(tasks, left),
            centroid=self._centroid(tasks),
            A=problem.A,
            lower=problem.lower,
            upper=problem.upper,
            weights=problem.weights,
            H=problem.H,
            g=problem.g,
            shape=np.array(chain.shape),
            torque_u=np.zeros(partition.nu),
            base=base,
        )

    def assemble(self, dynamics: Dynamics) -> bool:
        """Reduce the dynamics, eliminate the unconstrained chain, and fill the problem."""
        return _assemble(self.block.address, dynamics.numbers.address)

    def fill(self) -> None:
        """Write one state's rows into the problem; the dynamics are reduced already."""
        _fill(self.block.address)

    def follow(self, x: Float64[np.ndarray, " n"]) -> Joined:
        """Find the motion of a solution; the unconstrained chain follows in closed form."""
        dv, torque = np.empty(self._nv), np.empty(self._nj)
        return Joined(dv, torque, _join(self.block.address, x, True, dv, torque))

    def join(self, x: Float64[np.ndarray, " n"], dv_u: Float64[np.ndarray, " nu"]) -> Joined:
        """Find the motion of a solution and one of LQP 2."""
        dv, torque = np.empty(self._nv), np.empty(self._nj)
        self.block.chain.dv_u[:] = dv_u
        return Joined(dv, torque, _join(self.block.address, x, False, dv, torque))

    def wrenches(self, x: Float64[np.ndarray, " n"]) -> dict[str, Float64[np.ndarray, " m"]]:
        """Return the wrench of a solution at each contact, by the contact's name [N, N m]."""
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
            names=[
                "dynamics",
                "contacts",
                *(", ".join(a.task.name for a in level) for level in levels),
            ],
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
        """Find rows of the problem for the tasks' first rows, then for the levels' rest."""
        firsts: list[int] = []
        leftovers: list[int] = []
        for of_level, level, k in zip(
            self.problem.levels[PHYSICS_LEVELS:], tasks.levels, left, strict=True
        ):
            row = of_level.slice.start
            for assignment in level:
                count = len(assignment.first)
                firsts += range(row, row + count)
                row += count
            leftovers += range(row, row + k)
        return np.array(firsts + leftovers, dtype=np.int64)

    def _centroid(self, tasks: AssignedRows) -> Int64[np.ndarray, " first"]:
        """Find the place of each of the tasks' first rows among the centroids', or -1."""
        places = np.full(len(tasks.first), -1, dtype=np.int64)
        places[np.isin(tasks.first, tasks.centroid)] = np.arange(len(tasks.centroid))
        return places


@compiled
def _assemble(address: int, state_at: int) -> bool:
    problem = view(ConstraintChain, address)
    chain = problem.chain
    eliminate_chain(chain, view(StateNumbers, state_at))
    room = problem.shape[0] == chain.rows.kept
    for level in range(len(chain.rows.left)):
        room = room and problem.shape[1 + level] == chain.rows.left[level]
    if room:
        _fill_all(problem)
    return room


@compiled
def _fill(address: int) -> None:
    _fill_all(view(ConstraintChain, address))


@part
def _fill_all(problem: ConstraintChain) -> None:
    _fill_physics(problem)
    _fill_tasks(problem)
    _fill_cost(problem)


@part
def _fill_physics(problem: ConstraintChain) -> None:
    """Fill levels 1 and 2, and bounds."""
    reduced, J_c, base = problem.chain.reduced, problem.J_c, problem.base
    a, M, h_a, A = reduced.a, reduced.M, reduced.h_a, problem.A
    na, n, contacts = len(a), len(problem.g), len(J_c)
    motion = n - contacts
    lower, upper = problem.lower, problem.upper
    for i in range(na):
        own, row = M[i], A[i]
        for j in range(len(own)):
            row[j] = own[j]
        for j in range(contacts):
            A[na + j, i] = J_c[j, a[i]]
            row[motion + j] = -J_c[j, a[i]]
        joint = a[i] - base
        if joint < 0:
            lower[n + i] = upper[n + i] = -h_a[i]
        else:
            lower[n + i] = problem.tau_min[joint] - h_a[i]
            upper[n + i] = problem.tau_max[joint] - h_a[i]
            lower[i], upper[i] = problem.dv_min[joint], problem.dv_max[joint]
    for j in range(contacts):
        lower[n + na + j] = upper[n + na + j] = problem.contact_target[j]
        lower[motion + j] = problem.wrench_lower[j]
        upper[motion + j] = problem.wrench_upper[j]


@part
def _fill_tasks(problem: ConstraintChain) -> None:
    """Fill tasks of the reduced robot, then the rest of those of the unconstrained chain."""
    chain, first, places, A = problem.chain, problem.first, problem.places, problem.A
    rows, a, n = chain.rows, chain.reduced.a, len(problem.g)
    nr = len(chain.reduced.M)
    lower, upper = problem.lower, problem.upper
    for k in range(len(first)):
        own, row, place = chain.J[first[k]], A[places[k]], n + places[k]
        for i in range(len(a)):
            row[i] = own[a[i]]
        if problem.centroid[k] >= 0:
            for i in range(len(chain.centroid)):
                row[len(a) + i] = chain.centroid[i, problem.centroid[k]]
        lower[place], upper[place] = chain.target[first[k]], problem.task_upper[first[k]]
        problem.weights[place] = chain.weight[first[k]]
    for k in range(len(places) - len(first)):
        place, own = places[len(first) + k], rows.kept_rows[k]
        row = A[place]
        for i in range(len(chain.variables)):
            row[chain.variables[i]] = rows.E[i, own]
        for i in range(rows.kept):
            row[nr + i] = rows.P[rows.weak[i], own]
        lower[n + place] = upper[n + place] = -rows.E[len(chain.variables), own]


@part
def _fill_cost(problem: ConstraintChain) -> None:
    """Fill the energy of the reduced robot, and |c - G x|^2 / 2 of that inside the chain."""
    chain, H, g = problem.chain, problem.H, problem.g
    rows, M = chain.rows, chain.reduced.M
    nr, fixed = len(M), len(chain.variables)
    for i in range(nr + rows.kept):
        row = H[i]
        for j in range(nr + rows.kept):
            row[j] = M[i, j] if i < nr and j < nr else 0.0
        g[i] = 0.0
    for i in range(fixed + rows.kept):
        one = rows.G[_row_of(chain, i)]
        at = chain.variables[i] if i < fixed else nr + i - fixed
        for j in range(i + 1):
            other, total = rows.G[_row_of(chain, j)], 0.0
            to = chain.variables[j] if j < fixed else nr + j - fixed
            for k in range(rows.used):
                total += one[k] * other[k]
            H[at, to] += total
            H[to, at] = H[at, to]
        # Where x ends there is -c.
        for k in range(rows.used):
            g[at] += one[k] * rows.G[fixed, k]


@part
def _row_of(chain: Elimination, i: int) -> int:
    """Find the row of G for one of (x, s)."""
    fixed = len(chain.variables)
    return i if i < fixed else fixed + 1 + chain.rows.weak[i - fixed]


@compiled
def _join(
    address: int,
    x: Float64[np.ndarray, " n"],
    follows: bool,
    dv: Float64[np.ndarray, " nv"],
    torque: Float64[np.ndarray, " nj"],
) -> bool:
    """Write both chains' motion, with the exact form of (17) of Ahn et al. 2024 for torques."""
    first = view(ConstraintChain, address)
    if follows:
        recover(first.chain, x)
    reduced, base = first.chain.reduced, first.base
    a, u, dv_u, torque_u = reduced.a, reduced.u, first.chain.dv_u, first.torque_u
    for i in range(len(u)):
        own, total = reduced.M_uu[i], reduced.h_u[i]
        for j in range(len(u)):
            total += own[j] * dv_u[j]
        torque_u[i] = total
    for i in range(len(a)):
        dv[a[i]] = x[i]
        if a[i] >= base:
            row, total = first.A[i], reduced.h_a[i]
            for j in range(len(x)):
                total += row[j] * x[j]
            torque[a[i] - base] = total
    for i in reduced.carriers:
        own = reduced.M_au[i]
        for j in range(len(u)):
            torque_u[j] += own[j] * x[i]
    within = True
    for i in range(len(u)):
        joint = u[i] - base
        dv[u[i]], torque[joint] = dv_u[i], torque_u[i]
        # Written so that NaN is not within.
        if not (first.tau_min[joint] <= torque_u[i] <= first.tau_max[joint]):
            within = False
        if not (first.dv_min[joint] - SLOP <= dv_u[i] <= first.dv_max[joint] + SLOP):
            within = False
    return within


class UnconstrainedChainProblem:
    """LQP 2 of Ahn et al. 2024, (29) and (30), for a partition with an unconstrained chain.

    Variables are dv_u; dv_a and z are known from LQP 1:

        level 1   J_z dv_u = z                                       the centroids (30)
                  tau_min <= M_ua dv_a + M_uu dv_u + h_u <= tau_max  exact, unlike (17)
        level 2   bounds on the accelerations of these joints
        level 3.. J_u dv_u = reference - drift - J_a dv_a            rows assigned to LQP 2
        cost      dv_u^T M_uu dv_u / 2

    The motion of the rest of the robot is in the torques and in the tasks. The other term of the
    energy, dv_a^T M_au dv_u, is fixed by z, so the cost is the whole robot's. Where limits and
    centroids contradict each other, residuals of the first two levels are not zero and the answer
    must not be used: base dynamics need the z of LQP 1.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        tasks: AssignedRows,
        reduced: ReducedDynamics,
    ) -> None:
        self._stack, self._reduced = stack, reduced
        part = reduced.partition
        self._joints = part.u - robot.base_dofs
        self._nz = part.nz
        self._known = np.zeros(robot.nv)
        names = part.unconstrained
        self.problem = problem = HierarchicalProblem.allocate(
            part.nu,
            [part.nz + part.nu, 0] + np.diff(tasks.second_ends).tolist(),
            names=[
                "centroids",
                "joint limits",
                *(", ".join(a.task.name for a in level if len(a.second)) for level in tasks.levels),
            ],
            labels=[
                [("acceleration of a centroid", part.nz)]
                + [(f"torque limit of {j}", 1) for j in names],
                [],
                *(
                    [(f"task {a.task.name}", len(a.second)) for a in level]
                    for level in tasks.levels
                ),
            ],
            bounds_level=1,
        )
        problem.labels[:1] = [(f"joint limit of {j}", 1) for j in names]
        self._tasks = tasks
        self._rows = problem.A[part.nz + part.nu :]
        self._values = slice(part.nu + part.nz + part.nu, None)

    def fill(self, x: Float64[np.ndarray, " nr"]) -> None:
        """Write one state's rows into the problem."""
        reduced, problem = self._reduced, self.problem
        part, nz = reduced.partition, self._nz
        dv_a, z = x[: part.na], x[part.na :]
        physics, joints = problem.level(0), self._joints
        torque, joint = self._stack.torque_limit, self._stack.joint_limit
        physics.A[:nz] = reduced.J_z
        physics.lower[:nz] = physics.upper[:nz] = z
        physics.A[nz:] = problem.H[:] = reduced.M_uu
        carried = dv_a.dot(reduced.M_au)
        carried += reduced.h_u
        np.subtract(torque.tick_lower[joints], carried, out=physics.lower[nz:])
        np.subtract(torque.tick_upper[joints], carried, out=physics.upper[nz:])
        problem.x_lower[:] = joint.lower[joints]
        problem.x_upper[:] = joint.upper[joints]
        self._known[part.a] = dv_a
        J = self._tasks.J[self._tasks.second]
        self._rows[:] = J[:, part.u]
        problem.weights[self._values] = self._tasks.weight[self._tasks.second]
        values = self._tasks.target[self._tasks.second] - J.dot(self._known)
        problem.lower[self._values] = problem.upper[self._values] = values
