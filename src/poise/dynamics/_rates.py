"""`MatrixRates`: how the matrices of `Dynamics` change with time."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics._dynamics import RobotState
from poise.robots import Robot


class MatrixRates:
    """Exact time derivatives of the mass matrix and of Jacobians along the motion of one state.

    Apart from `Dynamics`, because hardly anyone needs them: a controller that knows the drift
    `Jdot v` of its tasks needs no derivative of a matrix. They serve the formulas of
    (Park, Jin, Kang 2022) that differentiate projected Jacobians.

    Args:
        robot: whose matrices.

    Attributes:
        mass_matrix: dM/dt, both triangles [kg/s, kg m/s, kg m^2/s].
        momentum_matrix: derivative of the centroidal momentum matrix A_G.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        # Its own workspace: that of `Dynamics` holds what must not be overwritten.
        self._data = robot.model.createData()
        self._frames: dict[int, Float64[np.ndarray, "6 nv"]] = {}
        self.update(RobotState(robot.q_home, np.zeros(robot.nv)))

    def update(self, state: RobotState) -> None:
        """Computes the derivatives for a state.

        Args:
            state: configuration and velocity, finite and of the robot's size.
        """
        model, data = self._robot.model, self._data
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
            model, data = self._robot.model, self._data
            pin.updateFramePlacement(model, data, frame_id)
            rate = pin.getFrameJacobianTimeVariation(model, data, frame_id, pin.LOCAL_WORLD_ALIGNED)
            self._frames[frame_id] = rate
        return rate
