"""`UnconstrainedChainProblem`: LQP 2, the unconstrained chain under a known reduced motion.

`ChainJoining`: accelerations and torques of both chains put together.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.control._reduced._assignment import AssignedRows
from poise.dynamics import ReducedDynamics
from poise.hqp import HierarchicalProblem
from poise.robots import Robot
from poise.stack import Stack


class UnconstrainedChainProblem:
    """LQP 2 of Ahn et al. 2024, (29) and (30), for a partition with an unconstrained chain.

    Variables are dv_u; dv_a and z are known from LQP 1:

        level 1   J_z dv_u = z                                       the centroids (30)
                  tau_min <= M_ua dv_a + M_uu dv_u + h_u <= tau_max  exact, unlike (17)
        level 2   bounds on the accelerations of these joints
        level 3.. J_u dv_u = reference - drift - J_a dv_a            rows assigned to LQP 2
        cost      dv_u^T M_uu dv_u / 2

    What the rest of the robot does, the base first of all, is in the torques and in the tasks
    as it is. The other term of the energy, dv_a^T M_au dv_u, is fixed by z, so the cost is the
    whole robot's. Where limits and centroids contradict each other the residuals of the first two
    levels say so, and the answer must not be used: base dynamics need the z of LQP 1.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks, bound to the robot.
        tasks: the rows of the stack, updated by the caller, and which of them are for LQP 2.
        reduced: the reduced dynamics, updated by the caller; its partition must have a chain.

    Attributes:
        problem: the hierarchical problem, filled by `fill`.
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
        self._joints = part.u.index - robot.base_dofs
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
        """Writes one state's rows into the problem.

        Args:
            x: acceleration (dv_a, z) of the reduced robot, from LQP 1; the tasks, the joint limit
                and the reduced dynamics are up to date.
        """
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
        np.subtract(torque.lower[joints], carried, out=physics.lower[nz:])
        np.subtract(torque.upper[joints], carried, out=physics.upper[nz:])
        problem.x_lower[:] = joint.lower[joints]
        problem.x_upper[:] = joint.upper[joints]
        part.a.scatter(dv_a, self._known)
        J = self._tasks.J[self._tasks.second]
        part.u.columns(J, self._rows)
        problem.weights[self._values] = self._tasks.weight[self._tasks.second]
        values = self._tasks.target[self._tasks.second] - J.dot(self._known)
        problem.lower[self._values] = problem.upper[self._values] = values


_SLOP = 1e-9
"""Excess of an acceleration bound that is rounding, as a solver's own [rad/s^2]."""


class Joined(NamedTuple):
    """What both chains do.

    Attributes:
        acceleration: generalized acceleration.
        torque: joint torques [N m].
        within: whether the unconstrained chain keeps its limits of torque and acceleration.
    """

    acceleration: Float64[np.ndarray, " nv"]
    torque: Float64[np.ndarray, " nj"]
    within: bool


class ChainJoining:
    """Puts the answer of LQP 1 and the motion of the unconstrained chain together.

    The chain's torques are M_ua dv_a + M_uu dv_u + h_u, the exact form of (17) of Ahn et al. 2024.

    Args:
        base: number of base coordinates.
        reduced: the reduced dynamics, updated by the caller.
        stack: whose limits count.
    """

    def __init__(self, base: int, reduced: ReducedDynamics, stack: Stack) -> None:
        self._base, self._reduced, self._stack = base, reduced, stack
        self._index = reduced.partition.a.index, reduced.partition.u.index

    def join(
        self,
        x: Float64[np.ndarray, " n"],
        torque_a: Float64[np.ndarray, " na"],
        dv_u: Float64[np.ndarray, " nu"],
    ) -> Joined:
        """Both chains' accelerations and torques.

        Args:
            x: dv_a, and whatever follows it.
            torque_a: of the rows a; those of the base, near zero, first [N, N m].
            dv_u: acceleration of the unconstrained chain.
        """
        reduced, base = self._reduced, self._base
        nv = len(self._index[0]) + len(self._index[1])
        dv, torque = np.empty(nv), np.empty(nv - base)
        limit, joint = self._stack.torque_limit, self._stack.joint_limit
        within = _join(
            self._index,
            (x, torque_a, dv_u),
            (reduced.M_au, reduced.M_uu, reduced.h_u),
            (limit.lower, limit.upper, joint.lower, joint.upper),
            base,
            dv,
            torque,
        )
        return Joined(dv, torque, within)


_Motion = tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " na"], Float64[np.ndarray, " nu"]]
_Chain = tuple[
    Float64[np.ndarray, "na nu"], Float64[np.ndarray, "nu nu"], Float64[np.ndarray, " nu"]
]
_Limits = tuple[
    Float64[np.ndarray, " nj"],
    Float64[np.ndarray, " nj"],
    Float64[np.ndarray, " nj"],
    Float64[np.ndarray, " nj"],
]


@compiled
def _join(
    index: tuple[Int64[np.ndarray, " na"], Int64[np.ndarray, " nu"]],
    motion: _Motion,
    chain: _Chain,
    limits: _Limits,
    base: int,
    dv: Float64[np.ndarray, " nv"],
    torque: Float64[np.ndarray, " nj"],
) -> bool:
    a, u = index
    x, torque_a, dv_u = motion
    M_au, M_uu, h_u = chain
    tau_min, tau_max, dv_min, dv_max = limits
    for i in range(len(a)):
        dv[a[i]] = x[i]
        if a[i] >= base:
            torque[a[i] - base] = torque_a[i]
    within = True
    for i in range(len(u)):
        joint, total = u[i] - base, h_u[i]
        for j in range(len(u)):
            total += M_uu[i, j] * dv_u[j]
        for j in range(len(a)):
            total += M_au[j, i] * x[j]
        dv[u[i]], torque[joint] = dv_u[i], total
        # Written so that NaN is not within.
        if not (tau_min[joint] <= total <= tau_max[joint]):
            within = False
        if not (dv_min[joint] - _SLOP <= dv_u[i] <= dv_max[joint] + _SLOP):
            within = False
    return within
