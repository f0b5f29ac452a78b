"""`BoundedAcceleration`: as much of an acceleration as bounds, cones and torque limits allow."""

import numpy as np
from jaxtyping import Float64

from poise.control._osf._rows import OperationalRows
from poise.dynamics import Dynamics
from poise.hqp import HierarchicalProblem, LexicographicSolver, SoftenedLevel
from poise.robots import Robot
from poise.stack import TorqueLimit

_WRENCH_COST = 1e-6
"""Weight of the wrenches' metric in the final cost, so small that they move nothing."""


class BoundedAcceleration:
    """The best acceleration and wrenches within all bounds, where the closed form leaves some.

    With a the acceleration of the closed form, the strict order over (dv, F) is

        level 1   M_u dv - J_c,u^T F = -h_u                base dynamics
                  tau_min <= M_l dv + h_l - J_c,l^T F <= tau_max
        level 2   J_1 dv = J_1 a                            the physics
                  C F <= 0, bounds on wrenches and joints
        level 3   balance and self-collision limit, where there are any
        then      J_i dv = J_i a                            the tasks, level by level
        cost      |dv - a|^2 in the mass metric, and a little of the wrenches' own metric

    so that levels lose from the bottom up, and none loses anything to those below it. A level that
    may be softened keeps J_i x_i in place of J_i a, with x_i the best within the bounds and the
    levels above of

        |W_i (J_i x - target_i)|^2 + mu_i^2 |x_J - d|^2,

    of which the closed form is the answer without bounds. So motion does not jump where a bound
    becomes active, and comes to rest at it.
    """

    def __init__(
        self,
        robot: Robot,
        rows: OperationalRows,
        cone: Float64[np.ndarray, "cone c"],
        limit: TorqueLimit,
    ) -> None:
        self._rows, self._limit, self._base, self._nv = rows, limit, robot.base_dofs, robot.nv
        physics, *tasks = np.diff(rows.levels.ends).tolist()
        limits = [len(rows.bounds.rows)] if len(rows.bounds.rows) else []
        sizes = [robot.nv, physics + len(cone), *limits, *tasks]
        self._problem = HierarchicalProblem.allocate(
            robot.nv + cone.shape[1], sizes, bounds_level=1
        )
        first = 2 + len(limits)
        self._levels = [1, *range(first, first + len(tasks))]
        contacts = self._problem.level(1)
        contacts.A[physics:, robot.nv :] = cone
        contacts.lower[physics:], contacts.upper[physics:] = -np.inf, 0.0
        joints = range(robot.base_dofs, robot.nv)
        self._stages = [
            SoftenedLevel(self._problem, 1 + level, first + level, joints, LexicographicSolver())
            for level in rows.stack_rows.softening.levels
        ]
        self._solver = LexicographicSolver()
        self._solver.prepare(self._problem)

    def solve(
        self,
        acceleration: Float64[np.ndarray, " nv"],
        dynamics: Dynamics,
        cost: Float64[np.ndarray, "c c"],
        reference: Float64[np.ndarray, " c"],
    ) -> tuple[Float64[np.ndarray, " nv"], Float64[np.ndarray, " c"]] | None:
        """Return acceleration and wrenches; None where nothing finite was found."""
        nv, levels, problem = self._nv, self._rows.levels, self._problem
        self._fill(acceleration, dynamics)
        problem.H[nv:, nv:], problem.g[nv:] = _WRENCH_COST * cost, -_WRENCH_COST * cost @ reference
        for stage in self._stages:
            level = stage.key
            weight = max(float(levels.softening[level]), float(levels.softened[level]))
            if weight == 0.0:
                continue
            own, view = levels.slices[level], problem.level(self._levels[level])
            view.lower[:] = view.upper[:] = levels.target[own]
            stage.fill(weight, levels.reference)
            stage.solver.run(stage.problem)
            view.lower[:] = view.upper[:] = levels.jacobian[own] @ stage.solver.x[:nv]
            levels.softened[level] = weight
        self._solver.run(problem)
        x = self._solver.x.copy()
        return (x[:nv], x[nv:]) if np.isfinite(np.add.reduce(x)) else None

    def _fill(self, acceleration: Float64[np.ndarray, " nv"], dynamics: Dynamics) -> None:
        """Write one state's rows, without softening, and the cost of accelerations."""
        rows, problem, limit, nv, base = (
            self._rows,
            self._problem,
            self._limit,
            self._nv,
            self._base,
        )
        h, level = dynamics.h, problem.level(0)
        level.A[:, :nv], level.A[:, nv:] = dynamics.M, -rows.contact_jacobian.T
        level.lower[:base] = level.upper[:base] = -h[:base]
        level.lower[base:], level.upper[base:] = limit.lower - h[base:], limit.upper - h[base:]
        bounds, wrenches = rows.bounds, rows.stack_rows
        problem.x_lower[base:nv], problem.x_upper[base:nv] = bounds.lower, bounds.upper
        problem.x_lower[nv:], problem.x_upper[nv:] = wrenches.wrench_lower, wrenches.wrench_upper
        if len(bounds.rows):
            limits = problem.level(2)
            limits.A[:, :nv] = bounds.rows
            limits.lower[:], limits.upper[:] = bounds.least, bounds.most
        levels = rows.levels
        targets, weights = levels.jacobian @ acceleration, levels.scale * levels.mobility
        for place, own in zip(self._levels, levels.slices, strict=True):
            level, count = problem.level(place), own.stop - own.start
            level.A[:count, :nv] = levels.jacobian[own]
            level.lower[:count] = level.upper[:count] = targets[own]
            level.weights[:count] = weights[own]
        problem.H[:nv, :nv], problem.g[:nv] = dynamics.M, -dynamics.M @ acceleration
