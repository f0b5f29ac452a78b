"""`ContactForces`: wrenches and torques of an acceleration."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from poise._compiled import allocate
from poise.control._osf._balance import Balance, measure, solve_nearest, weigh_base
from poise.control._osf._bounded import BoundedAcceleration
from poise.control._osf._kernels import is_inside
from poise.control._osf._rows import OperationalRows
from poise.dynamics import Dynamics
from poise.robots import Robot
from poise.stack import Stack, any_dynamics, stacked_cones

TOLERANCE = 1e-6
"""Violation of a cone or limit, relative to the weight or the limit, that counts as none."""

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

    def _solve_by_range(self) -> None:
        """Find the nearest wrenches of points, without parts that they cannot carry."""
        balance = self._balance
        system, missing = balance.system, balance.multiplier
        multiplier = np.linalg.lstsq(system, missing, rcond=_RANGE_TOLERANCE)[0]
        np.matmul(multiplier, balance.weighted, out=self.wrench)
        self.wrench += self.reference

    def _read_errors(self) -> None:
        self.base_error, self.cone_error, self.torque_error = self._balance.errors.tolist()
