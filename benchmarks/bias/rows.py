"""`PaperFormulation`: contacts and tasks of a stack as the rows that the paper's equations take.

`MatrixRates`, `ExactRates`: exact derivatives, along the motion, of the matrices that the paper
differentiates. A controller that knows the drift `Jdot v` of its tasks needs none of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import ComTask, Contact, FrameTask, JointTask, MomentumTask, Stack, Task


class MatrixRates:
    """Exact time derivatives of the mass matrix and of Jacobians along the motion of one state.

    Args:
        robot: whose matrices.

    Attributes:
        mass_matrix: dM/dt, both triangles [kg/s, kg m/s, kg m^2/s].
        momentum_matrix: derivative of the centroidal momentum matrix A_G.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        # Its own workspace: that of `Dynamics` holds what must not be overwritten.
        self._data = robot.model.createData()
        self._frames: dict[int, Float64[np.ndarray, "6 nv"]] = {}
        self.update(RobotState(robot.q_home, np.zeros(robot.nv)))

    def update(self, state: RobotState) -> None:
        """Computes the derivatives for a state.

        Args:
            state: configuration and velocity, finite and of the robot's size.
        """
        model, data = self.robot.model, self._data
        self._frames.clear()
        # In this order: the first leaves other derivatives than its own in the same workspace, and
        # dA_G comes out right only where the COM and its velocity are known.
        coriolis = pin.computeCoriolisMatrix(model, data, state.q, state.v)
        pin.computeAllTerms(model, data, state.q, state.v)
        pin.computeJointJacobiansTimeVariation(model, data, state.q, state.v)
        # Pinocchio factors the Coriolis forces so that Mdot - 2 C is skew.
        self.mass_matrix: Float64[np.ndarray, "nv nv"] = coriolis + coriolis.T
        self.momentum_matrix: Float64[np.ndarray, "6 nv"] = data.dAg

    def frame(self, frame_id: int) -> Float64[np.ndarray, "6 nv"]:
        """Derivative of a frame's `LOCAL_WORLD_ALIGNED` Jacobian.

        Args:
            frame_id: index from `Robot.frame_id`.
        """
        rate = self._frames.get(frame_id)
        if rate is None:
            model, data = self.robot.model, self._data
            pin.updateFramePlacement(model, data, frame_id)
            rate = pin.getFrameJacobianTimeVariation(model, data, frame_id, pin.LOCAL_WORLD_ALIGNED)
            self._frames[frame_id] = rate
        return rate


def task_jacobian_rate(task: Task, rates: MatrixRates) -> Float64[np.ndarray, "m nv"]:
    """Exact time derivative of a task's Jacobian.

    Args:
        task: of a kind that Poise has, evaluated for the state; not relative to a moving frame.
        rates: derivatives of the robot's matrices for the same state.

    Raises:
        ConfigurationError: another kind of task.
    """
    match task:
        case JointTask():
            return np.zeros_like(task.jacobian)
        case FrameTask():
            rate = rates.frame(rates.robot.frame_id(task.frame))
        case ComTask():
            rate = rates.momentum_matrix[:3] / rates.robot.mass
        case MomentumTask():
            rate = rates.momentum_matrix[3:]
        case _:
            raise ConfigurationError(
                f"task {task.name!r} has no exact derivative of its Jacobian",
                got=type(task).__name__,
                wanted="a JointTask, FrameTask, ComTask or MomentumTask, or numerical derivatives",
            )
    return rate[task.chosen]


def contact_jacobian_rate(
    contact: Contact, dynamics: Dynamics, rates: MatrixRates
) -> Float64[np.ndarray, "dim nv"]:
    """Derivative of a contact's Jacobian along axes that stay as they are, as its drift has it.

    Args:
        contact: the contact.
        dynamics: the state.
        rates: derivatives of the robot's matrices for the same state.
    """
    frame = rates.robot.frame_id(contact.frame)
    rate, R = rates.frame(frame), dynamics.frame(frame).rotation.T
    return np.concatenate((R @ rate[:3], R @ rate[3:]))[: contact.dim]


class ExactRates:
    """Exact Jdot_i|p of one state, task by task in the order of priority.

    From N_1 = I on, with d(M^-1) = -M^-1 Mdot M^-1 and d(Lambda) = -Lambda d(Lambda^-1) Lambda,

        Jdot_i|p = Jdot_i N_i + J_i Ndot_i
        Ndot_i+1 = Ndot_i - d(Jbar_i|p) J_i|p - Jbar_i|p Jdot_i|p
    """

    def __init__(
        self, M_inverse: Float64[np.ndarray, "n n"], M_rate: Float64[np.ndarray, "n n"]
    ) -> None:
        self._M_inverse = M_inverse
        self._M_inverse_rate = -M_inverse @ M_rate @ M_inverse
        self._N_rate = np.zeros_like(M_inverse)

    def of(
        self,
        J: Float64[np.ndarray, "m n"],
        J_rate: Float64[np.ndarray, "m n"],
        N: Float64[np.ndarray, "n n"],
    ) -> Float64[np.ndarray, "m n"]:
        """Jdot_i|p of the next task."""
        return J_rate @ N + J @ self._N_rate

    def pass_by(
        self,
        J_p: Float64[np.ndarray, "m n"],
        Lambda: Float64[np.ndarray, "m m"],
        Jbar: Float64[np.ndarray, "n m"],
        J_p_rate: Float64[np.ndarray, "m n"],
    ) -> None:
        """Propagates Ndot past a task."""
        M_inverse = self._M_inverse
        half = J_p_rate @ M_inverse @ J_p.T
        rate = half + half.T + J_p @ self._M_inverse_rate @ J_p.T
        Lambda_rate = -Lambda @ rate @ Lambda
        Jbar_rate = self._M_inverse_rate @ J_p.T @ Lambda + M_inverse @ (
            J_p_rate.T @ Lambda + J_p.T @ Lambda_rate
        )
        self._N_rate = self._N_rate - Jbar_rate @ J_p - Jbar @ J_p_rate


class BackwardDifferences:
    """Backward differences over a tick, level by level; zero where there is no past."""

    def __init__(self) -> None:
        self._time: float | None = None
        self._before: list[np.ndarray] = []
        self._now: list[np.ndarray] = []
        self._dt = 0.0

    def begin(self, time: float) -> None:
        """Starts a new state at a time [s]."""
        self._before, self._now = self._now, []
        self._dt = 0.0 if self._time is None else time - self._time
        self._time = time

    def of(self, value: np.ndarray) -> np.ndarray:
        """Derivative of the next quantity; they must come in the same order every tick."""
        index = len(self._now)
        self._now.append(value)
        if self._dt <= 0.0 or index >= len(self._before):
            return np.zeros_like(value)
        return (value - self._before[index]) / self._dt


@dataclass(slots=True, eq=False)
class PaperRows:
    """Rows J_i dv + Jdot_i v = xdd_i,ref, the contacts first, then level by level.

    Attributes:
        jacobian: J_i, stacked.
        drift: Jdot_i v, stacked.
        reference: xdd_i,ref, stacked.
        scale: what a row is multiplied by where ranks are decided: its weight over the mobility
            sqrt(J M^-1 J^T) that its block of rows has in the home posture.
        slices: rows of each level; a robot on a fixed base has an empty first one.
        jacobian_rate: Jdot_i, stacked; None where projected Jacobians are differentiated
            numerically.
        mass_matrix_rate: dM/dt, likewise.
    """

    jacobian: Float64[np.ndarray, "t nv"]
    drift: Float64[np.ndarray, " t"]
    reference: Float64[np.ndarray, " t"]
    scale: Float64[np.ndarray, " t"]
    slices: list[slice]
    jacobian_rate: Float64[np.ndarray, "t nv"] | None = None
    mass_matrix_rate: Float64[np.ndarray, "nv nv"] | None = None

    @property
    def target(self) -> Float64[np.ndarray, " t"]:
        """J_i dv as it should be: xdd_i,ref - Jdot_i v, stacked."""
        return self.reference - self.drift

    @staticmethod
    def allocate(sizes: Sequence[int], nv: int) -> "PaperRows":
        """Zero rows.

        Args:
            sizes: number of rows of each level.
            nv: number of generalized coordinates.
        """
        slices = spans(sizes)
        total = slices[-1].stop
        return PaperRows(
            jacobian=np.zeros((total, nv)),
            drift=np.zeros(total),
            reference=np.zeros(total),
            scale=np.ones(total),
            slices=slices,
        )


class PaperFormulation:
    """Writes `PaperRows` for a stack whose contacts, if any, carry every wrench of the base.

    Args:
        robot: on a fixed base, or standing on surfaces.
        stack: contacts and tasks; bound to the robot here, and evaluated once in its home posture.

    Attributes:
        rows: the rows of the last state.
    """

    def __init__(self, robot: Robot, stack: Stack) -> None:
        stack.bind(robot)
        self._contacts, tasks = stack.contacts, [task for _, task in stack.tasks()]
        sizes = [sum(c.dim for c in self._contacts)]
        sizes += [sum(task.dim for task in level) for level in stack.levels]
        self.rows = PaperRows.allocate(sizes, robot.nv)
        owners = [*self._contacts, *tasks]
        self._owners = list(zip(owners, spans([o.dim for o in owners]), strict=True))
        home = Dynamics(robot)
        home.update(RobotState(robot.q_home, np.zeros(robot.nv)))
        mobility = np.linalg.inv(home.M)
        for owner, rows in self._owners:
            self.rows.scale[rows] = _scale(owner, home, mobility)

    def fill(self, dynamics: Dynamics, rates: MatrixRates | None = None) -> None:
        """Writes one state's rows.

        Args:
            dynamics: the state, up to date.
            rates: derivatives of the robot's matrices for the same state, where the rows' exact
                derivatives are wanted.
        """
        filled = self.rows
        for owner, rows in self._owners:
            owner.evaluate(dynamics)
            filled.jacobian[rows], filled.drift[rows] = owner.jacobian, owner.drift
            filled.reference[rows] = owner.reference
        filled.jacobian_rate = filled.mass_matrix_rate = None
        if rates is not None:
            filled.jacobian_rate = np.concatenate(
                [_rate(owner, dynamics, rates) for owner, _ in self._owners]
            )
            filled.mass_matrix_rate = rates.mass_matrix


def spans(sizes: Sequence[int]) -> list[slice]:
    """Slices of these sizes behind one another."""
    return [slice(a, b) for a, b in pairwise(accumulate(sizes, initial=0))]


def _rate(
    owner: Contact | Task, dynamics: Dynamics, rates: MatrixRates
) -> Float64[np.ndarray, "m nv"]:
    if isinstance(owner, Task):
        return task_jacobian_rate(owner, rates)
    return contact_jacobian_rate(owner, dynamics, rates)


def _scale(
    owner: Contact | Task, home: Dynamics, mobility: Float64[np.ndarray, "nv nv"]
) -> Float64[np.ndarray, " m"]:
    """Weight over the largest mobility among rows that turn into one another as axes turn."""
    owner.evaluate(home)
    squares = np.einsum("ij,jk,ik->i", owner.jacobian, mobility, owner.jacobian)
    if isinstance(owner, Task):
        # What it took from the home posture as its target it forgets again.
        owner.reset()
        blocks, weight = owner.blocks, owner.weight
    else:
        blocks, weight = (3,) * (owner.dim // 3), 1.0
    largest = [np.full(len(squares[rows]), squares[rows].max()) for rows in spans(blocks)]
    return weight / np.sqrt(np.concatenate(largest))
