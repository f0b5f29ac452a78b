"""`UnconstrainedChainProblem`: LQP 2, the unconstrained chain under a known reduced motion."""

import numpy as np
from jaxtyping import Float64

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
