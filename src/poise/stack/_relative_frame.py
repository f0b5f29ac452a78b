"""`RelativeFrameTask`: a frame as seen from another frame of the robot."""

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, checked_kind
from poise.dynamics import Dynamics, FrameKinematics, rotation_vector
from poise.robots import Robot
from poise.stack._axes import checked_rotation, parse_axes, split_rows
from poise.stack._task import Task, VectorTarget


class RelativeFrameTask(Task):
    """A frame follows a target pose given in a second, moving frame of the robot.

    With root frame r and frame f, all along the root's axes,

        p = r_R_w (p_f - p_r)
        pdot = r_R_w (v_f - v_r - omega_r x (p_f - p_r))
        omega = r_R_w (omega_f - omega_r)

    and the drift carries the centripetal and Coriolis terms of the turning root.

    Args:
        frame: the frame that should move.
        root: the frame in which the target is given.
        axes: "pose", "position", "orientation", with letters, or joined by "+"; axes of the root.
        kp: stiffness, one number or one a row [1/s^2].
        kd: damping [1/s]; critical when None.
        weight: weight of its rows in their level.
        name: what reports call it.
    """

    def __init__(
        self,
        frame: str,
        root: str,
        axes: str = "pose",
        *,
        kp: Numbers = 100.0,
        kd: Numbers | None = None,
        weight: Numbers = 1.0,
        name: str | None = None,
    ) -> None:
        super().__init__(name or f"{frame} in {root} {axes}", kp=kp, kd=kd, weight=weight)
        self.frame = checked_kind(frame, str, f"frame of task {self.name!r}")
        self.root = checked_kind(root, str, f"root of task {self.name!r}")
        mask = "position+orientation" if axes == "pose" else axes
        self._rows = parse_axes(mask, {"position": 0, "orientation": 3})
        self._blocks = split_rows(self._rows)
        self._turns = bool(self._rows[-1] >= 3)
        self.unit = ("m, rad" if self._rows[0] < 3 else "rad") if self._turns else "m"
        self._target = VectorTarget(3, f"task {self.name!r}")
        self._orientation: Float64[np.ndarray, "3 3"] | None = None
        self._orientation_held = False
        self._ids = (-1, -1)

    def set_target(self, position: Numbers | None = None, rotation: Numbers | None = None) -> None:
        """Sets where the frame should be in the root; what is not given stays as it is.

        Args:
            position: root_p_frame [m].
            rotation: root_R_frame.

        Raises:
            TargetError: wrong shape, NaN, or not a rotation.
        """
        if rotation is not None:
            rotation = checked_rotation(rotation, f"target rotation of task {self.name!r}")
        if position is not None:
            self._target.set(position)
        if rotation is not None:
            self._orientation, self._orientation_held = rotation, False

    def reset(self) -> None:
        """Forgets a target that was taken from the robot."""
        self._target.release_hold()
        if self._orientation_held:
            self._orientation, self._orientation_held = None, False

    @property
    def blocks(self) -> tuple[int, ...]:
        """Position rows, then orientation rows."""
        return self._blocks

    def _resolve(self, robot: Robot) -> int:
        self._ids = (robot.frame_id(self.frame), robot.frame_id(self.root))
        return len(self._rows)

    def _evaluate(self, dynamics: Dynamics) -> Float64[np.ndarray, " m"]:
        frame, root = dynamics.frame(self._ids[0]), dynamics.frame(self._ids[1])
        jacobian, drift, velocity = relative_motion(frame, root)
        root_R_world = root.rotation.T
        rows = self._rows
        error = np.zeros(6)
        error[:3] = self._target.error(root_R_world @ (frame.position - root.position))
        if self._turns:
            actual = root_R_world @ frame.rotation
            if self._orientation is None:
                self._orientation, self._orientation_held = actual, True
            error[3:] = rotation_vector(self._orientation, actual)
        self.jacobian = jacobian[rows]
        self.drift = drift[rows]
        self.error = error[rows]
        self.error_rate = -velocity[rows]
        return np.zeros(len(rows))


def relative_motion(
    frame: FrameKinematics, root: FrameKinematics
) -> tuple[Float64[np.ndarray, "6 nv"], Float64[np.ndarray, "6"], Float64[np.ndarray, "6"]]:
    """Jacobian, drift and velocity of one frame as seen from another, along the root's axes.

    Args:
        frame: the frame that moves.
        root: the frame that looks.

    Returns:
        Jacobian, classical drift and velocity, linear part first.
    """
    offset = frame.position - root.position
    R = root.rotation.T
    w_root = root.velocity[3:]
    w_rel = frame.velocity[3:] - w_root
    slip = frame.velocity[:3] - root.velocity[:3]
    v_rel = slip - np.cross(w_root, offset)
    J = np.empty_like(frame.jacobian)
    # Minus omega x offset, as offset x omega, column by column.
    J[:3] = R @ (frame.jacobian[:3] - root.jacobian[:3] + _skew(offset) @ root.jacobian[3:])
    J[3:] = R @ (frame.jacobian[3:] - root.jacobian[3:])
    drift = np.empty(6)
    drift[:3] = R @ (
        frame.bias[:3]
        - root.bias[:3]
        - np.cross(root.bias[3:], offset)
        - np.cross(w_root, slip)
        - np.cross(w_root, v_rel)
    )
    drift[3:] = R @ (frame.bias[3:] - root.bias[3:] - np.cross(w_root, w_rel))
    return J, drift, np.concatenate((R @ v_rel, R @ w_rel))


def _skew(a: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
