"""`ContactForces`: wrenches and torques of an acceleration, the nearest or those within bounds.

`BoundedAcceleration`: as much of an acceleration as bounds, cones and torque limits allow.
"""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from poise._compiled import (
    MemoryBlock,
    allocate,
    compiled,
    factor_leading,
    part,
    solve_leading,
    view,
)
from poise.control._osf._recursion import is_inside
from poise.control._osf._rows import OperationalRows
from poise.control._strategy import PHYSICS_TOLERANCE
from poise.dynamics import Dynamics, StateNumbers
from poise.hqp import HierarchicalProblem, LexicographicSolver, SoftenedLevel
from poise.robots import Robot
from poise.stack import Stack, TorqueLimit, any_dynamics, stacked_cones


class Balance(MemoryBlock):
    """The wrenches' metric and bounds, and the solution."""

    jacobian: Float64[np.ndarray, "c nv"]  # J_c of all contacts
    cost_inverse: Float64[np.ndarray, "c c"]  # inverse of the metric W of all wrenches
    reference: Float64[np.ndarray, " c"]  # of the internal forces [N, N m]
    rows: Float64[np.ndarray, "rows c"]  # of cones, then of bounds on normal forces: F <= limits
    limits: Float64[np.ndarray, " rows"]  # [N, N m]
    per_torque: Float64[np.ndarray, " nj"]  # one over the torque limits [1/(N m)]
    weight: Float64[np.ndarray, "1"]  # of the robot [N]
    force: Float64[np.ndarray, " nv"]  # M dv + h [N, N m]
    wrench: Float64[np.ndarray, " c"]  # [N, N m]
    torque: Float64[np.ndarray, " nj"]  # [N m]
    errors: Float64[np.ndarray, "3"]  # of base, cones and torque limits, over weight and limits
    weighted: Float64[np.ndarray, "base c"]  # scratch: J_c,u W^-1
    system: Float64[np.ndarray, "base base"]  # scratch
    multiplier: Float64[np.ndarray, " base"]  # scratch


@compiled
def solve_nearest(balance_at: int, state_at: int, dv: Float64[np.ndarray, " nv"]) -> None:
    """Find force, nearest wrenches, torques and errors of contacts that carry any base wrench."""
    weigh_base(balance_at, state_at, dv)
    balance = view(Balance, balance_at)
    if len(balance.wrench) > 0:
        # Positive definite, or NaN, which stays.
        factor_leading(balance.system, len(balance.system))
        solve_leading(balance.system, len(balance.system), balance.multiplier)
        for r in range(len(balance.wrench)):
            total = balance.reference[r]
            for i in range(len(balance.multiplier)):
                total += balance.weighted[i, r] * balance.multiplier[i]
            balance.wrench[r] = total
    measure(balance_at)


@compiled
def weigh_base(balance_at: int, state_at: int, dv: Float64[np.ndarray, " nv"]) -> None:
    """Find force_u = J_c,u^T F as equations of the multiplier, F = reference + W^-1 J_c,u x."""
    balance, state = view(Balance, balance_at), view(StateNumbers, state_at)
    M, h, J = state.M, state.h, balance.jacobian
    for i in range(len(h)):
        row, total = M[i], h[i]
        for j in range(len(dv)):
            total += row[j] * dv[j]
        balance.force[i] = total
    weighted, system, missing = balance.weighted, balance.system, balance.multiplier
    for i in range(len(system)):
        own = weighted[i]
        for r in range(len(own)):
            row, own[r] = balance.cost_inverse[r], 0.0
            for s in range(len(own)):
                own[r] += row[s] * J[s, i]
        missing[i] = balance.force[i]
        for r in range(len(own)):
            missing[i] -= balance.reference[r] * J[r, i]
        for j in range(len(system)):
            system[i, j] = 0.0
            for r in range(len(own)):
                system[i, j] += own[r] * J[r, j]


@compiled
def measure(balance_at: int) -> None:
    """Find torques of the wrenches, and errors of base, cones and torque limits; NaN stays NaN."""
    balance = view(Balance, balance_at)
    J, weight = balance.jacobian, balance.weight[0]
    base, errors, force = len(balance.system), balance.errors, balance.force
    errors[0] = errors[1] = errors[2] = 0.0
    for i in range(len(force)):
        rest = force[i]
        for r in range(len(balance.wrench)):
            rest -= balance.wrench[r] * J[r, i]
        if i < base:
            errors[0] = _larger(errors[0], abs(rest) / weight)
        else:
            balance.torque[i - base] = rest
            errors[2] = _larger(errors[2], abs(rest) * balance.per_torque[i - base] - 1.0)
    for k in range(len(balance.limits)):
        row, outside = balance.rows[k], -balance.limits[k]
        for r in range(len(balance.wrench)):
            outside += row[r] * balance.wrench[r]
        errors[1] = _larger(errors[1], outside / weight)


@part
def _larger(largest: float, value: float) -> float:
    """Return the larger of two, or NaN where either is."""
    return value if value > largest or np.isnan(value) else largest


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


_LEAST_LOAD = 1e-3
"""Fraction of the weight below which a contact that is being unloaded weighs no less."""

_RANGE_TOLERANCE = 1e-10
"""Eigenvalue, relative to the largest, below which points do not carry a wrench of the base."""


class ContactForces:
    """Splits M dv + h = S^T tau + J_c^T F into joint torques and contact wrenches.

    The base rows give the sum of the wrenches, J_c,u^T F = M_u dv + h_u, and leave internal forces
    open, which press contacts against each other and move nothing. Those are chosen nearest to a
    reference, in the metric W = sum C^T C with the rows C of each contact's
    cone over their bound at unit normal force: a wrench is far from zero when it is far out in its
    cone, and a contact that is being unloaded carries less. Where that leaves a cone or a torque
    limit, or the acceleration its own bounds, `BoundedAcceleration` finds other wrenches, and
    another acceleration where it has to.

    Attributes:
        contacts: active contacts.
        slices: place of each contact's wrench in `wrench`.
        torque: joint torques, within their limits or not [N m].
        wrench: wrenches of all contacts behind one another [N, N m].
        reference: reference of the internal forces [N, N m].
        bounded: True where the last acceleration, or its nearest wrenches, left a limit, so that
            others were looked for.
        base_error: largest base force that the contacts do not carry, over the weight.
        cone_error: largest violation of a cone or normal force bound, over the weight.
        torque_error: largest violation of a torque limit, over the limit.
    """

    def __init__(self, robot: Robot, stack: Stack, rows: OperationalRows) -> None:
        contacts = rows.stack_rows.contacts
        self.contacts, self._rows, self._limit = contacts, rows, stack.torque_limit
        self._weight = robot.weight
        ends = np.cumsum([0, *(c.dim for c in contacts)]).tolist()
        self.slices = [slice(a, b) for a, b in pairwise(ends)]
        self.bounded, self.base_error = False, 0.0
        self.cone_error = self.torque_error = 0.0
        # A surface carries any wrench of the base, so that its equations have full rank.
        self._carried = not contacts or any(c.dim == 6 for c in contacts)
        self._cone: Float64[np.ndarray, "rows c"] = stacked_cones(contacts)
        normals = np.eye(ends[-1])[[rows.start + 2 for rows in self.slices]]
        bounded_rows = np.concatenate((self._cone, normals, -normals))
        self._metrics = [len(c.cone) * c.metric for c in self.contacts]
        self._cost = np.zeros((ends[-1], ends[-1]))
        self._loads: tuple[float, ...] = ()
        sizes = {"c": ends[-1], "rows": len(bounded_rows), "nv": robot.nv, "nj": robot.nj}
        self._balance = allocate(
            Balance,
            sizes | {"base": robot.base_dofs, "3": 3},
            jacobian=rows.contact_jacobian,
            rows=bounded_rows,
            per_torque=1.0 / self._limit.upper,
            weight=np.array([float(robot.weight)]),
        )
        self.torque: Float64[np.ndarray, " nj"] = self._balance.torque
        self.wrench: Float64[np.ndarray, " c"] = self._balance.wrench
        self.reference: Float64[np.ndarray, " c"] = self._balance.reference
        self._within = BoundedAcceleration(robot, rows, self._cone, self._limit)
        # What is compiled is compiled now, not in the tick that needs it.
        weigh_base(self._balance.address, any_dynamics(robot).numbers.address, np.zeros(robot.nv))
        measure(self._balance.address)

    def solve(
        self, acceleration: Float64[np.ndarray, " nv"], dynamics: Dynamics
    ) -> Float64[np.ndarray, " nv"]:
        """Find wrenches and torques of one acceleration, or of the next best within all bounds."""
        places = self._balance.address, dynamics.numbers.address
        if self.contacts:
            self._read_bounds()
        if self._carried:
            solve_nearest(*places, acceleration)
        else:
            weigh_base(*places, acceleration)
            self._solve_by_range()
            measure(self._balance.address)
        self._read_errors()
        self.bounded = not (self.ok and is_inside(acceleration, self._rows.bounds.address))
        if not self.bounded:
            return acceleration
        found = self._within.solve(acceleration, dynamics, self._cost, self.reference)
        if found is not None:
            acceleration, self.wrench[:] = found
            weigh_base(*places, acceleration)
            measure(self._balance.address)
            self._read_errors()
        return acceleration

    def set_references(self, wrenches: Mapping[str, Float64[np.ndarray, " c"]]) -> None:
        """Fill `reference` from wrenches by the names of contacts; zero for those without."""
        for contact, rows in zip(self.contacts, self.slices, strict=True):
            self.reference[rows] = wrenches.get(contact.name, 0.0)

    @property
    def ok(self) -> bool:
        """True where all cones and limits hold at the last solve."""
        return max(self.base_error, self.cone_error, self.torque_error) <= PHYSICS_TOLERANCE

    def _read_bounds(self) -> None:
        # Bounds of the normal forces move during a ramp only.
        upper = [float(c.wrench_upper[2]) for c in self.contacts]
        lower = [float(c.wrench_lower[2]) for c in self.contacts]
        loads = (*upper, *lower)
        if loads == self._loads:
            return
        self._loads = loads
        self._balance.limits[len(self._cone) :] = *upper, *(-value for value in lower)
        for rows, metric, most in zip(self.slices, self._metrics, upper, strict=True):
            load = min(1.0, max(_LEAST_LOAD, most / self._weight))
            self._cost[rows, rows] = metric / (load * load)
        self._balance.cost_inverse[:] = np.linalg.inv(self._cost)

    def _solve_by_range(self) -> None:
        """Find the nearest wrenches of points, without parts that they cannot carry."""
        balance = self._balance
        system, missing = balance.system, balance.multiplier
        multiplier = np.linalg.lstsq(system, missing, rcond=_RANGE_TOLERANCE)[0]
        np.matmul(multiplier, balance.weighted, out=self.wrench)
        self.wrench += self.reference

    def _read_errors(self) -> None:
        self.base_error, self.cone_error, self.torque_error = self._balance.errors.tolist()
