"""`Dynamics`: everything about one state of a robot, computed once a tick."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics.frames import FrameKinematics
from poise.dynamics.state import RobotState
from poise.robots.robot import Robot


class Dynamics:
    """Mass matrix, nonlinear effects, frames, COM and centroidal momentum of one state.

    `update` runs Pinocchio's recursions once; frames are evaluated when first asked for and kept
    until the next `update`, so that two tasks on one frame cost one evaluation. The next `update`
    overwrites the matrices and `h` in place; other vectors and frames keep their numbers.

    The equation of motion is

        M dv + h = S^T tau + sum_i J_i^T F_i

    with `F_i` the wrench on the robot at contact i.

    Args:
        robot: whose dynamics; its Pinocchio model is shared and not changed.

    Attributes:
        robot: whose dynamics.
        state: the state of the last `update`.
        M: mass matrix, both triangles, rotor inertias included [kg, kg m, kg m^2].
        h: nonlinear effects: Coriolis, centrifugal and gravity forces [N, N m].
        com: centre of mass in the world [m].
        com_velocity: its velocity [m/s].
        com_jacobian: maps `v` to the COM's velocity.
        com_bias: acceleration of the COM at zero `dv` [m/s^2].
        momentum: centroidal momentum, linear [kg m/s] then angular about the COM [kg m^2/s].
        momentum_matrix: centroidal momentum matrix A_G, maps `v` to `momentum`.
        momentum_bias: rate of `momentum` at zero `dv` [N, N m].
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.state: RobotState = RobotState(robot.q_home, np.zeros(robot.nv))
        self._data = robot.model.createData()
        self._no_acceleration = np.zeros(robot.nv)
        self._frames: dict[int, FrameKinematics] = {}
        self._mass = robot.mass
        self.update(self.state)

    def update(self, state: RobotState) -> None:
        """Computes everything for a state.

        Args:
            state: configuration and velocity; must be finite and of the robot's size, which the
                controllers check.
        """
        model, data = self.robot.model, self._data
        self.state = state
        self._frames.clear()
        pin.computeAllTerms(model, data, state.q, state.v)
        # At zero acceleration this yields the drift of the momentum, and of every frame with it.
        pin.computeCentroidalMomentumTimeVariation(
            model, data, state.q, state.v, self._no_acceleration
        )
        # Pinocchio's own array, both triangles filled, turned from column-major to row-major.
        self.M: Float64[np.ndarray, "nv nv"] = data.M.T
        self.h: Float64[np.ndarray, " nv"] = data.nle
        # Copied: elements of Pinocchio's vectors do not keep alive what they are views into, and a
        # user may keep what was measured.
        self.com: Float64[np.ndarray, "3"] = data.com[0].copy()
        self.com_velocity: Float64[np.ndarray, "3"] = data.vcom[0].copy()
        self.com_jacobian: Float64[np.ndarray, "3 nv"] = data.Jcom
        self.momentum: Float64[np.ndarray, "6"] = data.hg.vector.copy()
        self.momentum_matrix: Float64[np.ndarray, "6 nv"] = data.Ag
        self.momentum_bias: Float64[np.ndarray, "6"] = data.dhg.vector.copy()
        self.com_bias: Float64[np.ndarray, "3"] = self.momentum_bias[:3] / self._mass

    def frame(self, frame_id: int) -> FrameKinematics:
        """Kinematics of a frame, evaluated once a tick.

        Args:
            frame_id: index from `Robot.frame_id`.

        Returns:
            The frame's kinematics; valid until the next `update`.
        """
        kinematics = self._frames.get(frame_id)
        if kinematics is None:
            kinematics = self._evaluate_frame(frame_id)
            self._frames[frame_id] = kinematics
        return kinematics

    def joint_position(self, joint_id: int) -> Float64[np.ndarray, "3"]:
        """Origin of a joint in the world [m].

        Args:
            joint_id: Pinocchio's index of the joint.
        """
        return self._data.oMi[joint_id].translation.copy()

    def _evaluate_frame(self, frame_id: int) -> FrameKinematics:
        model, data, aligned = self.robot.model, self._data, pin.LOCAL_WORLD_ALIGNED
        placement = pin.updateFramePlacement(model, data, frame_id)
        return FrameKinematics(
            position=placement.translation,
            rotation=placement.rotation,
            jacobian=pin.getFrameJacobian(model, data, frame_id, aligned),
            velocity=pin.getFrameVelocity(model, data, frame_id, aligned).vector,
            bias=pin.getFrameClassicalAcceleration(model, data, frame_id, aligned).vector,
        )
