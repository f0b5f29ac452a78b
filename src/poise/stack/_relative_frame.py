"""`RelativeFrameTask`: a frame as seen from another frame of the robot."""

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
from poise.stack._axes import ANGULAR_SPEED, Pose, parse_axes, split_rows, usual_speeds
from poise.stack._frame import fade_of
from poise.stack._shipped import PoseTarget, ShippedTask
from poise.stack._tables import (
    CHOSEN,
    COUNT,
    FIRST,
    FRAME_INDEX,
    GAINS,
    ROOT_INDEX,
    START,
    TARGET_ROTATION,
    TURNS,
    Kind,
    Line,
    StackNumbers,
)
from poise.stack._task import ask, write_measured


class RelativeFrameTask(ShippedTask[PoseTarget]):
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

    kind = Kind.RELATIVE_FRAME

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
        super().__init__(
            name or f"{frame} in {root} {axes}", kp=kp, kd=kd, weight=weight, speed=speed
        )
        self.frame = checked_kind(frame, str, f"frame of task {self.name!r}")
        self.root = checked_kind(root, str, f"root of task {self.name!r}")
        mask = "position+orientation" if axes == "pose" else axes
        self.chosen = index = parse_axes(mask, {"position": 0, "orientation": 3})
        self._blocks = split_rows(index)
        self.turns = bool(index[-1] >= 3)
        self.unit = ("m, rad" if index[0] < 3 else "rad") if self.turns else "m"
        self._target = PoseTarget(f"task {self.name!r}")

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

    @property
    def blocks(self) -> tuple[int, ...]:
        """Position rows, then orientation rows."""
        return self._blocks

    def hold(self, dynamics: Dynamics) -> None:
        """Take what was never set of its target from the robot.

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
    """A frame's pose as seen from another, along the other's axes; targets are at rest."""
    motion, owners, work = state.motion, assembly.owners, assembly.work
    m, other, error = line[COUNT], KINEMATICS, 2 * KINEMATICS
    parameters, target = owners.parameters, int(line[START] + GAINS * m)
    place_frame(motion, owners.frames, line[FRAME_INDEX], work, 0)
    turn_to_world(work, 0)
    place_frame(motion, owners.frames, line[ROOT_INDEX], work, other)
    turn_to_world(work, other)
    _relative_columns(state, assembly, line)
    _see_from(work, other)
    for i in range(3):
        work[error + i] = parameters[target + i] - work[i]
    fade = 1.0
    if line[TURNS]:
        turn_between(parameters, target + TARGET_ROTATION, work, ROTATION, work, error + 3)
        fade = fade_of(work, error + 3)
    linear = 0
    for i in range(m):
        component = int(owners.chosen[line[CHOSEN] + i])
        linear += component < 3
        write_measured(
            assembly,
            line,
            i,
            work[error + component],
            1.0 if component < 3 else fade,
            0.0,
            work[VELOCITY + component],
            0.0,
            work[BIAS + component],
        )
    ask(assembly, line, 0, linear)
    ask(assembly, line, linear, m)


@part
def _relative_columns(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """Coefficients of a frame's motion seen from a root: of the joints between the two alone."""
    motion, owners, rows, work = state.motion, assembly.owners, assembly.rows, assembly.work
    frames, R, m = owners.frames, KINEMATICS + ROTATION, line[COUNT]
    starts, columns = frames.starts, frames.columns
    one, other = starts[line[FRAME_INDEX]], starts[line[ROOT_INDEX]]
    one_end, other_end = starts[line[FRAME_INDEX] + 1], starts[line[ROOT_INDEX] + 1]
    # What moves both stands first in either list, and moves neither against the other.
    while one < one_end and other < other_end and columns[one] == columns[other]:
        one, other = one + 1, other + 1
    for k in range(one_end - one + other_end - other):
        ahead = k < one_end - one
        column = int(columns[one + k] if ahead else columns[other + k - (one_end - one)])
        # A root that turns carries the point where the frame is with it.
        x = column_at(motion, column, work[0], work[1], work[2])
        sign = 1.0 if ahead else -1.0
        for i in range(m):
            component = int(owners.chosen[line[CHOSEN] + i])
            o, axis = 3 * (component // 3), R + component % 3
            seen = work[axis] * x[o] + work[axis + 3] * x[o + 1] + work[axis + 6] * x[o + 2]
            rows.matrix[rows.first + line[FIRST] + i, column] = sign * seen


@part
def _see_from(work: Float64[np.ndarray, " work"], root: int) -> None:
    """Turn a frame's place and motion in the world into those seen from a root, in its axes.

    With offset p_f - p_r and slip v_f - v_r, the velocity seen is slip - omega_r x offset, and the
    drift carries the centripetal and Coriolis terms of the turning root.
    """
    w = root + VELOCITY + 3
    for i in range(3):
        work[i] -= work[root + i]
    for i in range(6):
        work[VELOCITY + i] -= work[root + VELOCITY + i]
        work[BIAS + i] -= work[root + BIAS + i]
    _subtract_cross(work, root + BIAS + 3, 0, BIAS)
    _subtract_cross(work, w, VELOCITY, BIAS)
    _subtract_cross(work, w, 0, VELOCITY)
    _subtract_cross(work, w, VELOCITY, BIAS)
    _subtract_cross(work, w, VELOCITY + 3, BIAS + 3)
    R = root + ROTATION
    for first in (0, VELOCITY, VELOCITY + 3, BIAS, BIAS + 3):
        _turn_back(work, R, first, 1)
    for column in range(3):
        _turn_back(work, R, ROTATION + column, 3)


@part
def _subtract_cross(work: Float64[np.ndarray, " work"], a: int, b: int, out: int) -> None:
    """Out -= a x b."""
    ax, ay, az, bx, by, bz = (
        work[a],
        work[a + 1],
        work[a + 2],
        work[b],
        work[b + 1],
        work[b + 2],
    )
    work[out] -= ay * bz - az * by
    work[out + 1] -= az * bx - ax * bz
    work[out + 2] -= ax * by - ay * bx


@part
def _turn_back(work: Float64[np.ndarray, " work"], R: int, at: int, step: int) -> None:
    """R^T times a vector, in place; its components stand a step apart."""
    x, y, z = work[at], work[at + step], work[at + 2 * step]
    for i in range(3):
        work[at + i * step] = work[R + i] * x + work[R + 3 + i] * y + work[R + 6 + i] * z
