"""`BoundedAcceleration`: as much of an acceleration as bounds, cones and torque limits allow."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise.control._osf._rows import OperationalRows
from poise.dynamics import Dynamics
from poise.hqp import HierarchicalProblem, LexicographicSolver
from poise.robots import Robot
from poise.stack import TorqueLimit

_WRENCH_COST = 1e-6
"""Weight of the wrenches' metric in the final cost, so small that they move nothing."""


class _Wrenches(NamedTuple):
    cost: Float64[np.ndarray, "c c"]
    reference: Float64[np.ndarray, " c"]


class _Stage:
    """The hierarchy down to some level of tasks, with the reference's rows in that if softened."""

    def __init__(
        self,
        robot: Robot,
        rows: OperationalRows,
        cone: Float64[np.ndarray, "cone c"],
        levels: int,
        *,
        softened: bool,
    ) -> None:
        self._base, self._nv, self._levels, self._rows = robot.base_dofs, robot.nv, levels, rows
        self.level = levels - 1
        physics, *tasks = np.diff(rows.levels.ends).tolist()
        limits = [len(rows.bounds.rows)] if len(rows.bounds.rows) else []
        self._first = 2 + len(limits)
        sizes = [robot.nv, physics + len(cone), *limits, *tasks[:levels]]
        sizes[-1] += robot.nj if softened else 0
        self.problem = HierarchicalProblem.allocate(robot.nv + cone.shape[1], sizes, bounds_level=1)
        contacts = self.problem.level(1)
        contacts.A[physics:, robot.nv :] = cone
        contacts.lower[physics:], contacts.upper[physics:] = -np.inf, 0.0
        if softened:
            last = self.problem.level(len(sizes) - 1)
            last.A[-robot.nj :, robot.base_dofs : robot.nv] = np.eye(robot.nj)
        self._solver = LexicographicSolver()
        self._solver.prepare(self.problem)

    def run(
        self,
        acceleration: Float64[np.ndarray, " nv"],
        targets: Float64[np.ndarray, " rows"],
        dynamics: Dynamics,
        wrenches: _Wrenches,
    ) -> Float64[np.ndarray, " n"]:
        """The answer: [dv; F]."""
        nv, problem = self._nv, self.problem
        self._fill_levels(targets)
        self._fill_bounds()
        problem.H[:nv, :nv], problem.H[nv:, nv:] = dynamics.M, _WRENCH_COST * wrenches.cost
        problem.g[:nv] = -dynamics.M @ acceleration
        problem.g[nv:] = -_WRENCH_COST * wrenches.cost @ wrenches.reference
        return self._solver.solve(problem).x

    def fill_dynamics(self, dynamics: Dynamics, limit: TorqueLimit) -> None:
        """Writes base dynamics and torque limits."""
        base, level, h = self._base, self.problem.level(0), dynamics.h
        level.A[:, : self._nv] = dynamics.M
        level.A[:, self._nv :] = -self._rows.contact_jacobian.T
        level.lower[:base] = level.upper[:base] = -h[:base]
        level.lower[base:], level.upper[base:] = limit.lower - h[base:], limit.upper - h[base:]

    def soften(self, weight: float, reference: Float64[np.ndarray, " nj"]) -> None:
        """Sets weight and target of the reference's rows in the last level."""
        last, nj = self.problem.level(len(self.problem.levels) - 1), len(reference)
        last.weights[-nj:], last.lower[-nj:], last.upper[-nj:] = weight, reference, reference

    def _fill_bounds(self) -> None:
        rows, problem, nv = self._rows, self.problem, self._nv
        bounds, wrenches = rows.bounds, rows.stack_rows
        problem.x_lower[self._base : nv], problem.x_upper[self._base : nv] = bounds[:2]
        problem.x_lower[nv:], problem.x_upper[nv:] = wrenches.wrench_lower, wrenches.wrench_upper
        if self._first > 2:
            limits = problem.level(2)
            limits.A[:, :nv] = bounds.rows
            limits.lower[:], limits.upper[:] = bounds.least, bounds.most

    def _fill_levels(self, targets: Float64[np.ndarray, " rows"]) -> None:
        levels = self._rows.levels
        for i, rows in enumerate(levels.slices[: self._levels + 1]):
            view = self.problem.level(1 if i == 0 else self._first + i - 1)
            count = rows.stop - rows.start
            view.A[:count, : self._nv] = levels.jacobian[rows]
            view.lower[:count] = view.upper[:count] = targets[rows]
            view.weights[:count] = levels.scale[rows] * levels.mobility[rows]


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

    so that levels lose from the bottom up what the bounds do not allow, and none loses anything to
    those below it. A level that may be softened keeps J_i x_i in place of J_i a, with x_i the best
    within the bounds and the levels above of

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
        self._rows, self._limit, self._nv = rows, limit, robot.nv
        count = len(rows.levels.ends) - 2
        self._soft = [
            _Stage(robot, rows, cone, level + 1, softened=True)
            for level in rows.stack_rows.softening.levels
        ]
        self._whole = _Stage(robot, rows, cone, count, softened=False)

    def solve(
        self,
        acceleration: Float64[np.ndarray, " nv"],
        dynamics: Dynamics,
        cost: Float64[np.ndarray, "c c"],
        reference: Float64[np.ndarray, " c"],
    ) -> tuple[Float64[np.ndarray, " nv"], Float64[np.ndarray, " c"]] | None:
        """The acceleration, and wrenches; None where nothing finite was found."""
        nv, levels, wrenches = self._nv, self._rows.levels, _Wrenches(cost, reference)
        targets = levels.jacobian @ acceleration
        softening = self._rows.stack_rows.softening
        for stage in self._soft:
            level = stage.level + 1
            weight = max(float(levels.softening[level]), float(levels.softened[level]))
            if weight == 0.0:
                continue
            own = levels.slices[level]
            targets[own] = levels.target[own]
            stage.fill_dynamics(dynamics, self._limit)
            stage.soften(weight, softening.terms.reference)
            x = stage.run(acceleration, targets, dynamics, wrenches)
            targets[own] = levels.jacobian[own] @ x[:nv]
            levels.softened[level] = weight
        self._whole.fill_dynamics(dynamics, self._limit)
        x = self._whole.run(acceleration, targets, dynamics, wrenches)
        return (x[:nv], x[nv:]) if np.isfinite(np.add.reduce(x)) else None
