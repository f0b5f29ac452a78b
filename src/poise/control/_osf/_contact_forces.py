"""`ContactForces`: which wrenches and torques bring an acceleration about."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from poise.control._osf._balance import Balance, measure, solve_nearest, weigh_base
from poise.dynamics import Dynamics
from poise.hqp import HierarchicalProblem, LexicographicSolver
from poise.robots import Robot
from poise.stack import Contact, Stack, stacked_cones

TOLERANCE = 1e-6
"""Violation of a cone or limit, relative to the weight or the limit, that counts as none."""

_LEAST_LOAD = 1e-3
"""Fraction of the weight below which a contact that is being unloaded weighs no less."""

_RANGE_TOLERANCE = 1e-10
"""Eigenvalue, relative to the largest, below which points do not carry a wrench of the base."""

_MOST_CHANGES = 100
"""Cap of the changes of the active set where cones and limits conflict: several times what robots
that fall take, a third of a millisecond. No time caps it, so that a run is the same on a busy
machine."""


class ContactForces:
    """Splits M dv + h = S^T tau + J_c^T F into joint torques and contact wrenches.

    The base rows say what the wrenches must add up to, J_c,u^T F = M_u dv + h_u; what they leave
    open are internal forces, which press contacts against each other and move nothing. Those are
    chosen nearest to a reference, in the metric W = sum C^T C with the rows C of each contact's
    cone over their bound at unit normal force: a wrench is far from zero when it is far out in its
    cone, and a contact that is being unloaded carries less. Where that leaves a cone or a torque
    limit, a small hierarchical problem takes its place: base dynamics, then cones, then torque
    limits, then the same metric.

    Args:
        robot: the robot.
        stack: whose torque limits hold.
        contacts: active contacts, evaluated before each solve.

    Attributes:
        contacts: active contacts.
        slices: where each contact's wrench stands in `wrench`.
        torque: joint torques, within their limits or not [N m].
        wrench: wrenches of all contacts behind one another [N, N m].
        reference: wrenches that the internal forces should come near [N, N m].
        base_error: largest base force that the contacts do not carry, over the weight.
        cone_error: largest violation of a cone or normal force bound, over the weight.
        torque_error: largest violation of a torque limit, over the limit.
    """

    def __init__(self, robot: Robot, stack: Stack, contacts: Sequence[Contact]) -> None:
        self.contacts, self._limit = tuple(contacts), stack.torque_limit
        self._base, self._weight = robot.base_dofs, robot.weight
        ends = np.cumsum([0, *(c.dim for c in contacts)]).tolist()
        self.slices = [slice(a, b) for a, b in pairwise(ends)]
        self.base_error = self.cone_error = self.torque_error = 0.0
        # A surface carries any wrench of the base, so that its equations have full rank.
        self._carried = not contacts or any(c.dim == 6 for c in contacts)
        self._cone: Float64[np.ndarray, "rows c"] = stacked_cones(contacts)
        normals = np.eye(ends[-1])[[rows.start + 2 for rows in self.slices]]
        bounded_rows = np.concatenate((self._cone, normals, -normals))
        self._metrics = [len(c.cone) * c.metric for c in self.contacts]
        self._cost = np.zeros((ends[-1], ends[-1]))
        self._loads: tuple[float, ...] = ()
        self._balance = Balance(
            cost_inverse=np.zeros_like(self._cost),
            reference=np.zeros(ends[-1]),
            rows=bounded_rows,
            limits=np.zeros(len(bounded_rows)),
            per_torque=1.0 / self._limit.upper,
            weight=float(robot.weight),
            force=np.zeros(robot.nv),
            wrench=np.zeros(ends[-1]),
            torque=np.zeros(robot.nj),
            errors=np.zeros(3),
            weighted=np.zeros((self._base, ends[-1])),
            system=np.zeros((self._base, self._base)),
            multiplier=np.zeros(self._base),
        )
        self.torque: Float64[np.ndarray, " nj"] = self._balance.torque
        self.wrench: Float64[np.ndarray, " c"] = self._balance.wrench
        self.reference: Float64[np.ndarray, " c"] = self._balance.reference
        self._problem = _make_problem(self._base, self._cone, robot.nj) if contacts else None
        self._solver = LexicographicSolver(max_changes=_MOST_CHANGES)
        self._compile(robot.nv)

    def solve(
        self,
        acceleration: Float64[np.ndarray, " nv"],
        dynamics: Dynamics,
        jacobian: Float64[np.ndarray, "c nv"],
    ) -> bool:
        """Wrenches and torques of one acceleration.

        Args:
            acceleration: dv, which the contacts must allow.
            dynamics: the state.
            jacobian: of all contacts, J_c.

        Returns:
            Whether all cones and limits hold.
        """
        if self.contacts:
            self._read_bounds()
        if self._carried:
            solve_nearest(dynamics.M, dynamics.h, acceleration, jacobian, self._balance)
        else:
            self._solve_by_range(dynamics, acceleration, jacobian)
        self._read_errors()
        if self._problem is not None and not self.ok:
            self._solve_bounded(self._problem, jacobian)
            measure(jacobian, self._balance)
            self._read_errors()
        return self.ok

    def set_references(self, wrenches: Mapping[str, Float64[np.ndarray, " c"]]) -> None:
        """Fills `reference` from wrenches by the names of contacts; zero for those without."""
        for contact, rows in zip(self.contacts, self.slices, strict=True):
            self.reference[rows] = wrenches.get(contact.name, 0.0)

    @property
    def ok(self) -> bool:
        """Whether all cones and limits hold at the last solve."""
        return max(self.base_error, self.cone_error, self.torque_error) <= TOLERANCE

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

    def _solve_by_range(
        self,
        dynamics: Dynamics,
        acceleration: Float64[np.ndarray, " nv"],
        jacobian: Float64[np.ndarray, "c nv"],
    ) -> None:
        """Nearest wrenches of points, asked for none that they cannot carry."""
        balance = self._balance
        weigh_base(dynamics.M, dynamics.h, acceleration, jacobian, balance)
        system, missing = balance.system, balance.multiplier
        multiplier = np.linalg.lstsq(system, missing, rcond=_RANGE_TOLERANCE)[0]
        np.matmul(multiplier, balance.weighted, out=self.wrench)
        self.wrench += self.reference
        measure(jacobian, balance)

    def _read_errors(self) -> None:
        self.base_error, self.cone_error, self.torque_error = self._balance.errors.tolist()

    def _compile(self, nv: int) -> None:
        """Solves for nothing once, so that nothing is compiled in a tick."""
        jacobian, M = np.zeros((len(self.wrench), nv)), np.eye(nv)
        weigh_base(M, np.zeros(nv), np.zeros(nv), jacobian, self._balance)
        solve_nearest(M, np.zeros(nv), np.zeros(nv), jacobian, self._balance)
        measure(jacobian, self._balance)

    def _solve_bounded(
        self, problem: HierarchicalProblem, jacobian: Float64[np.ndarray, "c nv"]
    ) -> None:
        """Wrenches nearest to the reference within cones and torque limits."""
        base, force = self._base, self._balance.force
        dynamics, torque = problem.level(0), problem.level(2)
        dynamics.A[:] = jacobian[:, :base].T
        dynamics.lower[:] = dynamics.upper[:] = force[:base]
        torque.A[:] = jacobian[:, base:].T
        np.subtract(force[base:], self._limit.upper, out=torque.lower)
        np.subtract(force[base:], self._limit.lower, out=torque.upper)
        for contact, rows in zip(self.contacts, self.slices, strict=True):
            problem.x_lower[rows] = contact.wrench_lower
            problem.x_upper[rows] = contact.wrench_upper
        problem.H[:] = self._cost
        np.matmul(self._cost, -self.reference, out=problem.g)
        solution = self._solver.solve(problem)
        if np.isfinite(np.add.reduce(solution.x)):
            self.wrench[:] = solution.x


def _make_problem(base: int, cone: Float64[np.ndarray, "rows c"], nj: int) -> HierarchicalProblem:
    rows, size = cone.shape
    problem = HierarchicalProblem.allocate(
        size,
        [base, rows, nj],
        names=["base dynamics", "contacts", "torque limits"],
        labels=[[("base", base)], [("cones", rows)], [("torques", nj)]],
        bounds_level=1,
    )
    cones = problem.level(1)
    cones.A[:], cones.lower[:], cones.upper[:] = cone, -np.inf, 0.0
    return problem
