"""Exact derivatives, along the motion, of the matrices that the paper's formulas differentiate.

A controller that knows the drift `Jdot v` of its tasks needs none of them. They serve the formulas
of (Park, Jin, Kang 2022) that differentiate projected Jacobians.
"""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import ComTask, Contact, FrameTask, JointTask, MomentumTask, Task


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


def task_jacobian_rate(
    task: Task, dynamics: Dynamics, rates: MatrixRates
) -> Float64[np.ndarray, "m nv"]:
    """Exact time derivative of a task's Jacobian.

    Args:
        task: of a kind that Poise has, evaluated for the state; not relative to a moving frame.
        dynamics: the state.
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

    Args:
        M_inverse: M^-1.
        M_rate: dM/dt.
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
        """Jdot_i|p of the next task.

        Args:
            J: J_i.
            J_rate: Jdot_i.
            N: N_i.
        """
        return J_rate @ N + J @ self._N_rate

    def pass_by(
        self,
        J_p: Float64[np.ndarray, "m n"],
        Lambda: Float64[np.ndarray, "m m"],
        Jbar: Float64[np.ndarray, "n m"],
        J_p_rate: Float64[np.ndarray, "m n"],
    ) -> None:
        """Propagates Ndot past a task.

        Args:
            J_p: J_i|p.
            Lambda: Lambda_i|p.
            Jbar: Jbar_i|p.
            J_p_rate: Jdot_i|p.
        """
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
