"""`MomentumObserver`: forces of the ground from the motors' torques."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise.dynamics import RobotState
from poise.robots import Robot

_DAMPING = 1e-6
"""Damping of the least squares for the wrenches, by the largest entry of its matrix: a stretched
knee does not measure the force along the leg, the base then does."""

_TRUST = 5e-4
"""Damping towards measured wrenches: the square of 1 N m, the error of torques, over 45 N, the
largest error of a sound cell."""

_BASE_WEIGHT = 0.1
"""Weight of the base's rows, which contain pushes: with 0.01 to 0.1 the force of a swing foot of a
robot pushed by 0.4 m/s is off by 0.024 of the weight, with 0.3 and 1 by 0.028 and 0.056."""


class MomentumObserver:
    """Generalised force that a robot's motors do not explain, and the soles' part in it.

    With the generalised momentum p = M v, and Mdot = C + C^T,

        p' = S^T tau + C^T v - g + disturbance
        r = K (p - integral of (S^T tau + C^T v - g + r))

    so r follows the disturbance with a lag of 1 / K and without accelerations (De Luca and Mattone
    2003, "Actuator failure detection and isolation using generalized momenta"). The soles' wrenches
    solve the rows of base and legs, mostly those of the legs, by least squares: sum J_i^T F_i = r.

    Args:
        robot: with a floating base.
        gain: K [1/s].

    Attributes:
        disturbance: r [N, N m].
        wrenches: by sole, [force; moment] on the robot, in the sole's frame [N, N m].
    """

    def __init__(self, robot: Robot, gain: float = 150.0) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._gain, self._still = gain, np.zeros(robot.nv)
        self._soles = {name: robot.frame_id(name) for name in robot.soles}
        self._rows = _rows_of_legs(robot, list(self._soles.values()))
        self._legs = np.where(self._rows < 6, 0.0, 1.0)
        self._weights = np.where(self._rows < 6, _BASE_WEIGHT, 1.0)
        self._momentum: Float64[np.ndarray, " nv"] | None = None
        self.disturbance: Float64[np.ndarray, " nv"] = np.zeros(robot.nv)
        self.wrenches: dict[str, Float64[np.ndarray, "6"]] = {
            name: np.zeros(6) for name in self._soles
        }

    def reset(self) -> None:
        """Restart; at the next update the robot counts as at rest."""
        self._momentum = None

    def update(
        self,
        state: RobotState,
        torque: Float64[np.ndarray, " nj"],
        dt: float,
        measured: Mapping[str, Float64[np.ndarray, "6"]] = MappingProxyType({}),
    ) -> None:
        """Advance by a tick.

        Args:
            state: with the base as estimated.
            torque: of the motors in this tick [N m].
            dt: duration of the tick [s].
            measured: wrenches to check: estimates stay as near to them as the legs' torques allow,
                and the base's rows, which contain other forces on the robot, do not count [N, N m].
        """
        model, data, v = self._model, self._data, state.v
        gravity = pin.computeGeneralizedGravity(model, data, state.q)
        momentum = pin.rnea(model, data, state.q, self._still, v) - gravity
        coriolis = pin.computeCoriolisMatrix(model, data, state.q, v)
        drive = coriolis.T @ v - gravity
        drive[6:] += torque
        if self._momentum is None:
            self.disturbance = -drive
        else:
            # Implicit: no gain is too large for a period.
            gained = momentum - self._momentum - drive * dt
            self.disturbance = (self.disturbance + self._gain * gained) / (1.0 + self._gain * dt)
        self._momentum = momentum
        self.wrenches = self.share(state.q, {}, measured)

    def share(
        self,
        q: Float64[np.ndarray, " nq"],
        known: Mapping[str, Float64[np.ndarray, "6"]],
        measured: Mapping[str, Float64[np.ndarray, "6"]] = MappingProxyType({}),
    ) -> dict[str, Float64[np.ndarray, "6"]]:
        """Return the wrenches of all soles but known ones, by damped least squares [N, N m].

        Args:
            q: configuration.
            known: wrenches of other soles [N, N m].
            measured: wrenches towards which the least squares are damped, without the base's rows;
                zero by default [N, N m].
        """
        model, data = self._model, self._data
        pin.computeJointJacobians(model, data, q)
        jacobians: dict[str, Float64[np.ndarray, "6 rows"]] = {}
        # A hoist or a hand that holds the robot acts on the base.
        weights = self._legs if measured else self._weights
        force = weights * self.disturbance[self._rows]
        for name, frame_id in self._soles.items():
            pin.updateFramePlacement(model, data, frame_id)
            jacobian = pin.getFrameJacobian(model, data, frame_id, pin.LOCAL)[:, self._rows]
            jacobian *= weights
            if name in known or name in measured:
                force -= (known if name in known else measured)[name] @ jacobian
            if name not in known:
                jacobians[name] = jacobian
        if not jacobians:
            return {}
        J = np.vstack(list(jacobians.values()))
        A = J @ J.T
        A.flat[:: len(A) + 1] += (_TRUST if measured else _DAMPING) * A.max()
        wrenches = np.linalg.solve(A, J @ force).reshape(-1, 6)
        return {
            name: wrench + measured.get(name, 0.0)
            for name, wrench in zip(jacobians, wrenches, strict=True)
        }


def _rows_of_legs(robot: Robot, frame_ids: list[int]) -> Int64[np.ndarray, " rows"]:
    """List the velocities that move some frames, those of the base among them."""
    model = robot.model
    joints = {j for i in frame_ids for j in model.supports[model.frames[i].parentJoint] if j > 0}
    return np.array([model.idx_vs[j] + k for j in sorted(joints) for k in range(model.nvs[j])])
