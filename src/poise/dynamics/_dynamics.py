"""`Dynamics`: everything about one state of a robot, computed once a tick.

`RobotState`: the one thing a controller is told each tick.
`FrameKinematics`: where one frame is, how it moves, and how it answers to joint acceleration.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.robots import Robot


@dataclass(frozen=True, slots=True)
class RobotState:
    """Where the robot is and how fast, as measured or estimated.

    Not validated when made, because it is made every tick: a controller checks it for NaN and
    answers with a status.

    Attributes:
        q: configuration as Pinocchio orders it: base position in the world [m], base quaternion
            (x, y, z, w), joints [rad]; joints alone for a fixed base.
        v: velocity: base linear [m/s] and angular [rad/s] in the base frame, joints [rad/s].
        contacts: measured wrench [force; moment] on the robot by sole name, in the sole's frame at
            the sole's centre [N, N m]; empty where nothing is measured.
        time: time of the measurement [s].
    """

    q: Float64[np.ndarray, " nq"]
    v: Float64[np.ndarray, " nv"]
    contacts: Mapping[str, Float64[np.ndarray, "6"]] = field(default_factory=dict)
    time: float = 0.0


class FrameKinematics(NamedTuple):
    """Kinematics of one frame at one state.

    Spatial vectors put the linear part first and are expressed along the world's axes at the
    frame's origin (`LOCAL_WORLD_ALIGNED`). The bias is classical, so that
    `acceleration = jacobian @ dv + bias`.

    Attributes:
        position: origin of the frame in the world [m].
        rotation: world_R_frame.
        jacobian: maps `v` to the frame's velocity.
        velocity: linear [m/s] and angular [rad/s] velocity.
        bias: classical acceleration at zero `dv` [m/s^2, rad/s^2].
    """

    position: Float64[np.ndarray, "3"]
    rotation: Float64[np.ndarray, "3 3"]
    jacobian: Float64[np.ndarray, "6 nv"]
    velocity: Float64[np.ndarray, "6"]
    bias: Float64[np.ndarray, "6"]


class Dynamics:
    """Mass matrix, nonlinear effects, frames, COM and centroidal momentum of one state.

    `update` runs Pinocchio's recursions once; frames and momentum are evaluated when first asked
    for and kept until the next `update`, so that two tasks on one frame cost one evaluation. The
    next `update` overwrites the matrices and `h` in place; other vectors and frames keep their
    numbers.

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
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.state: RobotState = RobotState(robot.q_home, np.zeros(robot.nv))
        self._data = data = robot.model.createData()
        self._no_acceleration = np.zeros(robot.nv)
        self._frames: dict[int, FrameKinematics] = {}
        # Pinocchio's own arrays; M has both triangles filled and is turned to row-major.
        self.M: Float64[np.ndarray, "nv nv"] = data.M.T
        self.h: Float64[np.ndarray, " nv"] = data.nle
        self.com_jacobian: Float64[np.ndarray, "3 nv"] = data.Jcom
        self._com, self._com_velocity, self._com_bias = data.com[0], data.vcom[0], data.acom[0]
        self.update(self.state)

    def update(self, state: RobotState) -> None:
        """Computes everything for a state.

        Args:
            state: configuration and velocity; must be finite and of the robot's size, which the
                controllers check.
        """
        model, data, q, v = self.robot.model, self._data, state.q, state.v
        self.state = state
        self._frames.clear()
        self._momentum_is_known = self._momentum_map_is_known = False
        # Quicker than Pinocchio's computeAllTerms, which has energies and momentum in it.
        pin.crba(model, data, q)
        pin.nonLinearEffects(model, data, q, v)
        # At zero acceleration the accelerations of frames and COM are their drift.
        pin.forwardKinematics(model, data, q, v, self._no_acceleration)
        pin.computeJointJacobians(model, data)
        pin.centerOfMass(model, data, pin.ACCELERATION, False)
        pin.jacobianCenterOfMass(model, data, False)
        # Copied, because a user may keep what was measured.
        self.com: Float64[np.ndarray, "3"] = self._com.copy()
        self.com_velocity: Float64[np.ndarray, "3"] = self._com_velocity.copy()
        self.com_bias: Float64[np.ndarray, "3"] = self._com_bias.copy()

    @property
    def momentum(self) -> Float64[np.ndarray, "6"]:
        """Centroidal momentum, linear [kg m/s] then angular about the COM [kg m^2/s]."""
        return self._with_momentum().hg.vector.copy()

    @property
    def momentum_matrix(self) -> Float64[np.ndarray, "6 nv"]:
        """Centroidal momentum matrix A_G, maps `v` to `momentum`."""
        if not self._momentum_map_is_known:
            pin.computeCentroidalMap(self.robot.model, self._data, self.state.q)
            self._momentum_map_is_known = True
        return self._data.Ag

    @property
    def momentum_bias(self) -> Float64[np.ndarray, "6"]:
        """Rate of `momentum` at zero `dv` [N, N m]."""
        return self._with_momentum().dhg.vector.copy()

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

    def motion_in_own_axes(
        self, frame_id: int
    ) -> tuple[Float64[np.ndarray, "6 nv"], Float64[np.ndarray, "6"], Float64[np.ndarray, "6"]]:
        """Jacobian, velocity and bias of a frame as in `frame`, but along the frame's own axes.

        Args:
            frame_id: index from `Robot.frame_id`.
        """
        model, data = self.robot.model, self._data
        pin.updateFramePlacement(model, data, frame_id)
        return (
            pin.getFrameJacobian(model, data, frame_id, pin.LOCAL),
            pin.getFrameVelocity(model, data, frame_id, pin.LOCAL).vector,
            pin.getFrameClassicalAcceleration(model, data, frame_id, pin.LOCAL).vector,
        )

    def joint_position(self, joint_id: int) -> Float64[np.ndarray, "3"]:
        """Origin of a joint in the world [m].

        Args:
            joint_id: Pinocchio's index of the joint.
        """
        return self._data.oMi[joint_id].translation.copy()

    def _with_momentum(self) -> pin.Data:
        if not self._momentum_is_known:
            model, data, state = self.robot.model, self._data, self.state
            pin.computeCentroidalMomentumTimeVariation(
                model, data, state.q, state.v, self._no_acceleration
            )
            self._momentum_is_known = True
        return self._data

    def _evaluate_frame(self, frame_id: int) -> FrameKinematics:
        model, data, axes = self.robot.model, self._data, pin.LOCAL_WORLD_ALIGNED
        placement = pin.updateFramePlacement(model, data, frame_id)
        return FrameKinematics(
            placement.translation,
            placement.rotation,
            pin.getFrameJacobian(model, data, frame_id, axes),
            pin.getFrameVelocity(model, data, frame_id, axes).vector,
            pin.getFrameClassicalAcceleration(model, data, frame_id, axes).vector,
        )
