"""`ContactForces`: which wrenches and torques bring an acceleration about."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from poise.control._osf._balance import Balance, measure, solve_nearest, weigh_base
from poise.control._osf._bounded import BoundedAcceleration
from poise.control._osf._kernels import is_inside
from poise.control._osf._rows import OperationalRows
from poise.dynamics import Dynamics
from poise.robots import Robot
from poise.stack import Stack, stacked_cones

TOLERANCE = 1e-6
"""Violation of a cone or limit, relative to the weight or the limit, that counts as none."""

_LEAST_LOAD = 1e-3
"""Fraction of the weight below which a contact that is being unloaded weighs no less."""

_RANGE_TOLERANCE = 1e-10
"""Eigenvalue, relative to the largest, below which points do not carry a wrench of the base."""


class ContactForces:
    """Splits M dv + h = S^T tau + J_c^T F into joint torques and contact wrenches.

    The base rows say what the wrenches must add up to, J_c,u^T F = M_u dv + h_u; what they leave
    open are internal forces, which press contacts against each other and move nothing. Those are
    chosen nearest to a reference, in the metric W = sum C^T C with the rows C of each contact's
    cone over their bound at unit normal force: a wrench is far from zero when it is far out in its
    cone, and a contact that is being unloaded carries less. Where that leaves a cone or a torque
    limit, or the acceleration its own bounds, `BoundedAcceleration` finds other wrenches, and
    another acceleration where it has to.

    Attributes:
        contacts: active contacts.
        slices: where each contact's wrench stands in `wrench`.
        torque: joint torques, within their limits or not [N m].
        wrench: wrenches of all contacts behind one another [N, N m].
        reference: wrenches that the internal forces should come near [N, N m].
        bounded: whether the last acceleration, or its nearest wrenches, left a limit, so that
            others were looked for.
        base_error: largest base force that the contacts do not carry, over the weight.
        cone_error: largest violation of a cone or normal force bound, over the weight.
        torque_error: largest violation of a torque limit, over the limit.
    """

    def __init__(self, robot: Robot, stack: Stack, rows: OperationalRows) -> None:
        contacts = rows.stack_rows.contacts
        self.contacts, self._rows, self._limit = contacts, rows, stack.torque_limit
        self._base, self._weight = robot.base_dofs, robot.weight
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
        self._within = BoundedAcceleration(robot, rows, self._cone, self._limit)
        self._compile(robot.nv)

    def solve(
        self, acceleration: Float64[np.ndarray, " nv"], dynamics: Dynamics
    ) -> Float64[np.ndarray, " nv"]:
        """Wrenches and torques of one acceleration, or of the next best within cones and limits."""
        jacobian = self._rows.contact_jacobian
        if self.contacts:
            self._read_bounds()
        if self._carried:
            solve_nearest(dynamics.M, dynamics.h, acceleration, jacobian, self._balance)
        else:
            self._solve_by_range(dynamics, acceleration, jacobian)
        self._read_errors()
        self.bounded = not (self.ok and is_inside(acceleration, self._rows.bounds))
        if not self.bounded:
            return acceleration
        found = self._within.solve(acceleration, dynamics, self._cost, self.reference)
        if found is not None:
            acceleration, self.wrench[:] = found
            weigh_base(dynamics.M, dynamics.h, acceleration, jacobian, self._balance)
            measure(jacobian, self._balance)
            self._read_errors()
        return acceleration

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
        is_inside(np.zeros(nv), self._rows.bounds)
