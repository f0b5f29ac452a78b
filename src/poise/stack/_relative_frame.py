"""`RelativeFrameTask`: a frame relative to another frame of the robot."""

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, checked_kind
from poise._compiled import part
from poise.dynamics import (
    BIAS,
    KINEMATICS,
    ROTATION,
    VELOCITY,
    Dynamics,
    StateNumbers,
    column_at,
    place_frame,
    turn_between,
    turn_to_world,
)
from poise.robots import Robot
from poise.stack._axes import ANGULAR_SPEED, Pose, usual_speeds
from poise.stack._frame import GainArguments, PoseTask, fade_of
from poise.stack._points import (
    Vector,
    acceleration_of,
    between,
    cross,
    plus,
    vector,
    velocity_of,
)
from poise.stack._tables import GAINS, TARGET_ROTATION, Line, StackNumbers
from poise.stack._task import write_measured


class RelativeFrameTask(PoseTask):
    """A frame follows a target pose given in a second, moving frame of the robot.

    With root frame r and frame f, all along the root's axes,

        p = r_R_w (p_f - p_r)
        pdot = r_R_w (v_f - v_r - omega_r x (p_f - p_r))
        omega = r_R_w (omega_f - omega_r)

    and the drift carries the centripetal and Coriolis terms of the turning root. Near half a turn
    the feedback of the orientation error fades, as that of `FrameTask`.

    Args:
        frame: the frame that should move.
        root: the frame in which the target is given.
        axes: "pose", "position", "orientation", with letters, or joined by "+"; axes of the root.
        kp: stiffness, one number or one a row [1/s^2].
        kd: damping [1/s]; critical when None.
        weight: weight of its rows in their level.
        speed: largest speeds that feedback asks for, one number or one for each of `blocks`:
            position [m/s], then orientation [rad/s]; 2.5 m/s and pi rad/s when None.
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
        speed: Numbers | None = None,
        name: str | None = None,
    ) -> None:
        gains: GainArguments = {"kp": kp, "kd": kd, "weight": weight, "speed": speed}
        super().__init__(name or f"{frame} in {root} {axes}", frame, axes, gains)
        self.root = checked_kind(root, str, f"root of task {self.name!r}")

    def set_target(self, position: Pose | None = None, rotation: Numbers | None = None) -> None:
        """Set where the frame should be in the root; what is not given stays as it is.

        Args:
            position: root_p_frame [m]; or position and orientation in one, as `pinocchio.SE3`, a
                4 x 4 matrix, or a pair of a position and what `rotation` may be.
            rotation: root_R_frame, a matrix or a quaternion (x, y, z, w).

        Raises:
            TargetError: wrong shape, NaN, not a rotation, or a rotation beside a pose.
        """
        self._target.set(position, rotation)

    def hold(self, dynamics: Dynamics) -> None:
        """Set the parts of the target that were never set from the robot's state.

        Args:
            dynamics: the state, up to date.
        """
        frame, root = (dynamics.frame(i) for i in self.frame_ids)
        root_R_world = root.rotation.T
        rotation = root_R_world @ frame.rotation if self.turns else None
        self._target.hold(root_R_world @ (frame.position - root.position), rotation)

    def _resolve(self, robot: Robot) -> int:
        self.frame_ids = (robot.frame_id(self.frame), robot.frame_id(self.root))
        return len(self.chosen)

    def _usual_speed(self, robot: Robot) -> Numbers:  # noqa: ARG002
        return usual_speeds(self.chosen, ANGULAR_SPEED)


@part
def relative_frame_rows(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """A frame's pose relative to another, along the other's axes; targets are at rest."""
    motion, owners, work = state.motion, assembly.owners, assembly.work
    m, other, error = line.dim, KINEMATICS, 2 * KINEMATICS
    parameters, target = owners.parameters, line.start + GAINS * m
    place_frame(motion, owners.frames, line.frame, work, 0)
    turn_to_world(work, 0)
    place_frame(motion, owners.frames, line.root, work, other)
    turn_to_world(work, other)
    _relative_columns(state, assembly, line)
    _see_from(work, other)
    for i in range(3):
        work[error + i] = parameters[target + i] - work[i]
    fade = 1.0
    if line.turns:
        turn_between(parameters, target + TARGET_ROTATION, work, ROTATION, work, error + 3)
        fade = fade_of(work, error + 3)
    for i in range(m):
        c = int(owners.chosen[line.chosen + i])
        actual, drift = work[VELOCITY + c], work[BIAS + c]
        fed_back = 1.0 if c < 3 else fade
        write_measured(assembly, line, i, work[error + c], fed_back, 0.0, actual, 0.0, drift)


@part
def _relative_columns(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """Jacobian of a frame's motion relative to a root: of the joints between the two alone."""
    motion, owners, rows, work = state.motion, assembly.owners, assembly.rows, assembly.work
    frames, R, m = owners.frames, KINEMATICS + ROTATION, line.dim
    one, one_end, other, other_end = between(frames, line.frame, line.root)
    for side in range(2):
        begin, end = (one, one_end) if side == 0 else (other, other_end)
        for k in range(begin, end):
            column = int(frames.columns[k])
            # A root that turns carries the point where the frame is with it.
            x = column_at(motion, column, work[0], work[1], work[2])
            for i in range(m):
                component = int(owners.chosen[line.chosen + i])
                o, axis = 3 * (component // 3), R + component % 3
                seen = work[axis] * x[o] + work[axis + 3] * x[o + 1] + work[axis + 6] * x[o + 2]
                rows.matrix[rows.first + line.first + i, column] = (1.0 - 2.0 * side) * seen


@part
def _see_from(work: Float64[np.ndarray, " work"], root: int) -> None:
    """Transform a frame's pose and motion from the world to a root's axes.

    The drift has the centripetal and Coriolis terms of the turning root.
    """
    p, w = vector(work, 0), vector(work, root + VELOCITY + 3)
    slip = plus(vector(work, VELOCITY), velocity_of(work, root, p), -1.0)
    turning = plus(vector(work, VELOCITY + 3), w, -1.0)
    bias = plus(vector(work, BIAS), acceleration_of(work, root, p), -1.0)
    bent = plus(vector(work, BIAS + 3), vector(work, root + BIAS + 3), -1.0)
    _write_seen(work, root, plus(p, vector(work, root), -1.0), 0, 1)
    _write_seen(work, root, slip, VELOCITY, 1)
    _write_seen(work, root, turning, VELOCITY + 3, 1)
    _write_seen(work, root, plus(bias, cross(w, slip), -2.0), BIAS, 1)
    _write_seen(work, root, plus(bent, cross(w, turning), -1.0), BIAS + 3, 1)
    for k in range(ROTATION, ROTATION + 3):
        _write_seen(work, root, (work[k], work[k + 3], work[k + 6]), k, 3)


@part
def _write_seen(
    work: Float64[np.ndarray, " work"], root: int, seen: Vector, at: int, step: int
) -> None:
    """R^T times a vector, for the root's R; its components stand a step apart."""
    for i in range(3):
        R = root + ROTATION + i
        work[at + i * step] = work[R] * seen[0] + work[R + 3] * seen[1] + work[R + 6] * seen[2]
