"""`OperationalRows`: the physics and the user's levels as rows on accelerations.

`LevelRows`: the rows of all levels of one state, for the recursion.
`RowScales`: one over the mobility of each row, by which loss of rank is measured.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock
from poise.control._rank import block_scales
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.stack import Contact, Stack, StackRows, Task, home_jacobians

_RANGE_TOLERANCE = 1e-6
"""Singular value, relative to the largest, below which contacts do not carry a base wrench."""


class LevelRows(MemoryBlock):
    """Rows J_i dv = xdd_i,ref - Jdot_i v, the physics first, then level by level.

    The mobility of a row is the largest sqrt(J M^-1 J^T) of its block in the home posture.
    """

    jacobian: Float64[np.ndarray, "t nv"]
    target: Float64[np.ndarray, " t"]  # xdd_i,ref - Jdot_i v
    scale: Float64[np.ndarray, " t"]  # weight of each row over its mobility
    mobility: Float64[np.ndarray, " t"]
    ends: Int64[np.ndarray, " ends"]  # of each level; the first entry is zero
    softening: Float64[np.ndarray, " levels"]  # weight mu of each level's term; 0 for none
    may_soften: Int64[np.ndarray, " levels"]  # 1 for the levels of `Softening.levels`
    softened: Float64[np.ndarray, " levels"]  # receives mu of each level that is softened, else 0
    reference: Float64[np.ndarray, " nj"]  # joint accelerations d of the softening terms

    @property
    def slices(self) -> list[slice]:
        """Rows of each level."""
        return [slice(a, b) for a, b in pairwise(self.ends.tolist())]


class BoundRows(MemoryBlock):
    """Bounds on accelerations: of joints [rad/s^2], and of rows of limits [m/s^2]."""

    lower: Float64[np.ndarray, " nj"]
    upper: Float64[np.ndarray, " nj"]
    rows: Float64[np.ndarray, "m nv"]  # of the balance and self-collision limit
    least: Float64[np.ndarray, " m"]
    most: Float64[np.ndarray, " m"]


class RowScales:
    """One over the mobility sqrt(J M^-1 J^T) of rows in the home posture.

    Rows that share a unit and turn into one another as axes turn share the largest mobility among
    them, so that the scale does not depend on the axes: a stretched arm, which has no mobility
    along itself, is singular. Metres, radians and momenta become comparable, and so do a wrist and
    a hip.
    """

    def __init__(self, robot: Robot) -> None:
        self._home = Dynamics(robot)
        self._home.update(RobotState(robot.q_home, np.zeros(robot.nv)))
        self._mobility = np.linalg.inv(self._home.M)
        self._scales: dict[Contact | Task, Float64[np.ndarray, " m"]] = {}
        base = robot.base_dofs
        self.base = self._blocks(self._home.M[:base], (3, 3) if base else ())

    def measure(self, stack: Stack) -> None:
        """Measure contacts and tasks that are new, before they serve in a tick."""
        owners = [*stack.contacts, *(task for _, task in stack.tasks())]
        new = [owner for owner in owners if owner not in self._scales]
        for owner, jacobian in home_jacobians(self._home, new).items():
            self._scales[owner] = self._blocks(jacobian, owner.blocks)

    def of(self, owner: Contact | Task) -> Float64[np.ndarray, " m"]:
        """Return the scales of the rows of a contact or a task that was measured."""
        return self._scales[owner]

    def _blocks(
        self, jacobian: Float64[np.ndarray, "m nv"], blocks: Sequence[int]
    ) -> Float64[np.ndarray, " m"]:
        squares = np.einsum("ij,jk,ik->i", jacobian, self._mobility, jacobian)
        return block_scales(np.sqrt(squares), blocks)


class OperationalRows:
    """`LevelRows` of a stack for one set of active contacts.

    The first level is the physics of the floating base (Park and Khatib 2006; Sentis, Park and
    Khatib 2010): contacts do not accelerate, J_c dv = reference - drift; and where contacts cannot
    carry every wrench of the base, as in flight or on points alone, the base obeys its own
    equation of motion, W (M_u dv + h_u) = 0 with W the projector on the wrenches that no contact
    carries. A fixed base has an empty first level. The levels of the stack follow.

    Attributes:
        stack_rows: the rows of the stack.
        levels: all rows of the last state.
        bounds: bounds on accelerations at the last state.
        contact_jacobian: J_c, of all contacts.
    """

    def __init__(
        self, robot: Robot, stack: Stack, contacts: Sequence[Contact], scales: RowScales
    ) -> None:
        # A surface carries any wrench; so does a fixed base.
        self._base = 0 if any(c.dim == 6 for c in contacts) else robot.base_dofs
        self.stack_rows = rows = StackRows(
            robot,
            stack,
            contacts,
            own_rows=self._base,
            balance="behind",
            collisions="behind",
        )
        # The limits' rows stand behind all levels.
        self._count = count = int(rows.ends[-1])
        self._scale = scale = np.ones(count)
        contact_rows = zip(rows.contacts, rows.wrench_slices, strict=True)
        for owner, place in (*contact_rows, *rows.task_rows):
            scale[place] = scales.of(owner)
        scale[rows.own_rows] = scales.base[: self._base]
        ends = np.append(0, rows.ends)
        self._first_joint = robot.base_dofs
        self._softening, self._soft = rows.softening, [1 + i for i in rows.softening.levels]
        may_soften = np.zeros(len(ends) - 1, dtype=np.int64)
        may_soften[self._soft] = 1
        self.levels = LevelRows(
            jacobian=rows.J[:count],
            target=rows.target[:count],
            scale=scale.copy(),
            mobility=1.0 / scale,
            ends=ends,
            softening=np.zeros(len(may_soften)),
            may_soften=may_soften,
            softened=np.zeros(len(may_soften)),
            reference=rows.softening.terms.reference,
        )
        limit, own = stack.joint_limit, rows.limit_rows
        self.bounds = BoundRows(
            lower=limit.lower,
            upper=limit.upper,
            rows=rows.J[own],
            least=rows.target[own],
            most=rows.upper[own],
        )
        self.contact_jacobian: Float64[np.ndarray, "c nv"] = rows.J[rows.contact_rows]

    def fill(self, dynamics: Dynamics) -> None:
        """Write one state's rows."""
        self.stack_rows.update(dynamics)
        np.multiply(self._scale, self.stack_rows.weight[: self._count], out=self.levels.scale)
        if self._soft:
            self._softening.find(dynamics.v, dynamics.v, self._first_joint)
            self.levels.softening[self._soft] = self._softening.terms.weights
        if self._base:
            self._fill_base(dynamics)

    def _fill_base(self, dynamics: Dynamics) -> None:
        base, rows = self._base, self.stack_rows
        unheld = np.eye(base)
        if rows.contacts:
            _, singular, V = np.linalg.svd(self.contact_jacobian[:, :base])
            V = V[: len(singular)][singular > _RANGE_TOLERANCE * singular[0]]
            unheld -= V.T @ V
        np.matmul(unheld, dynamics.M[:base], out=rows.J[rows.own_rows])
        np.matmul(unheld, -dynamics.h[:base], out=rows.target[rows.own_rows])
