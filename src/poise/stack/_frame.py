"""`FrameTask`: position and orientation of a frame in the world."""

import math
from typing import TypedDict

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
    sine_between,
    turn_between,
    turn_to_world,
)
from poise.errors import UnknownNameError
from poise.robots import Robot
from poise.stack._axes import (
    ANGULAR_SPEED,
    TRUNK_SPEED,
    Pose,
    parse_axes,
    split_rows,
    usual_speeds,
)
from poise.stack._tables import (
    GAINS,
    OWN_AXES,
    TARGET_ACCELERATION,
    TARGET_ROTATION,
    TARGET_VELOCITY,
    Line,
    StackNumbers,
)
from poise.stack._targets import PoseTarget
from poise.stack._task import ShippedTask, write_measured

ORIENTATION_ERRORS = ("logarithm", "sine")
"""Measures of the distance of two orientations."""

_STEEPNESS = 4.0
"""Slope at which feedback fades near half a turn, over that of the error: kd^2 / kp of critical
damping, with which the velocity asked for changes by kd a radian, as fast as damping follows."""

_FADING = math.pi * _STEEPNESS / (1.0 + _STEEPNESS)
"""Angle from which on the feedback of an orientation error fades [rad]."""

_ALL_TURNS = {3, 4, 5}
"""Components of a motion that turn a frame."""


class GainArguments(TypedDict):
    """GainArguments, weight and speed of a task."""

    kp: Numbers
    kd: Numbers | None
    weight: Numbers
    speed: Numbers | None


class PoseTask(ShippedTask[PoseTarget]):
    """A task of some components of a frame's pose: position rows, then orientation rows.

    Attributes:
        frame: the frame that should move.
        turns: whether any of its rows is an orientation.
    """

    def __init__(self, name: str, frame: str, axes: str, gains: GainArguments) -> None:
        super().__init__(name, **gains)
        self.frame = checked_kind(frame, str, f"frame of task {self.name!r}")
        mask = "position+orientation" if axes == "pose" else axes
        self.chosen = index = parse_axes(mask, {"position": 0, "orientation": 3})
        self.turns = bool(index[-1] >= 3)
        self.unit = ("m, rad" if index[0] < 3 else "rad") if self.turns else "m"
        self._target = PoseTarget(f"task {self.name!r}", index.tolist())

    @property
    def blocks(self) -> tuple[int, ...]:
        """Position rows, then orientation rows."""
        return split_rows(self.chosen)


class FrameTask(PoseTask):
    """A frame follows a target pose in the world.

    Rows are world axes, position first: J dv + drift = reference with the `LOCAL_WORLD_ALIGNED`
    Jacobian and classical drift. The orientation error is the rotation vector
    (ln target_R actual_R^T)^vee = r phi, right at zero and at pi; or its sine, r sin(phi), as eq.
    (63) of (Park, Jin, Kang 2022) has it for small errors.

    At half a turn r has two signs, and the rotation vector jumps from one to the other as a target
    turns on. Feedback therefore acts on

        r min(phi, 4 (pi - phi)),

    which is continuous everywhere: the rotation vector up to 144 degrees, zero at half a turn, from
    where the frame goes back the other way. So at exactly half a turn, and nowhere else but at the
    target, feedback asks for nothing; some such orientation there must be, for a continuous field
    that vanishes at the target alone does not exist on the rotations. `error` is r phi throughout.

    A sole whose leg cannot turn it every way (`Sole.controlled`) has rows for the turns that are
    left, about its own axes, where all turns are asked for.

    Args:
        frame: a role such as "left_hand", or a link or frame of the robot's document.
        axes: "pose", "position", "orientation", with letters "position_z", or joined by "+".
        kp: stiffness, one number or one a row [1/s^2].
        kd: damping [1/s]; critical when None.
        weight: weight of its rows in their level.
        speed: largest speeds that feedback asks for, one number or one for each of `blocks`:
            position [m/s], then orientation [rad/s]; 2.5 m/s and pi rad/s when None, but 0.8
            rad/s for the robot's pelvis and torso.
        name: what reports call it; the frame and the axes when None.
        orientation_error: one of `ORIENTATION_ERRORS`.

    Raises:
        UnknownNameError: no such orientation error.

    Attributes:
        frame: the frame that should move.
        turns: whether any of its rows is an orientation.
    """

    def __init__(
        self,
        frame: str,
        axes: str = "pose",
        *,
        kp: Numbers = 100.0,
        kd: Numbers | None = None,
        weight: Numbers = 1.0,
        speed: Numbers | None = None,
        name: str | None = None,
        orientation_error: str = "logarithm",
    ) -> None:
        gains: GainArguments = {"kp": kp, "kd": kd, "weight": weight, "speed": speed}
        super().__init__(name or f"{frame} {axes}", frame, axes, gains)
        if orientation_error not in ORIENTATION_ERRORS:
            raise UnknownNameError(
                f"no such orientation error of task {self.name!r}",
                got=orientation_error,
                choices=ORIENTATION_ERRORS,
            )
        self.sine = self.turns and orientation_error == "sine"

    def set_target(
        self,
        position: Pose | None = None,
        rotation: Numbers | None = None,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Set where the frame should be; what is not given stays as it is.

        Rates belong to what is given beside them: with a position alone, the angular rates stay.
        A task of positions alone takes linear rates alone, too, and one of orientations angular
        ones.

        Args:
            position: in the world [m]; or position and orientation in one, as `pinocchio.SE3`,
                a 4 x 4 matrix, or a pair of a position and what `rotation` may be.
            rotation: world_R_frame, a matrix or a quaternion (x, y, z, w).
            velocity: linear then angular, in the world, 6 numbers or 3 [m/s, rad/s]; zero when
                None.
            acceleration: in the same form [m/s^2, rad/s^2]; zero when None.

        Raises:
            TargetError: wrong shape, NaN, not a rotation, or a rotation beside a pose.
        """
        self._target.set(position, rotation, velocity, acceleration)

    @property
    def target_position(self) -> Float64[np.ndarray, "3"] | None:
        """Target position [m]; None until one is set or taken from the robot."""
        return self._target.position

    @property
    def target_rotation(self) -> Float64[np.ndarray, "3 3"] | None:
        """Target orientation, world_R_frame; None until one is set or taken from the robot."""
        return self._target.rotation

    @property
    def components(self) -> set[int]:
        """Components of the frame's motion that it acts on, about whichever axes."""
        return {k if k < OWN_AXES else k - OWN_AXES + 3 for k in self.chosen.tolist()}

    def hold(self, dynamics: Dynamics) -> None:
        """Set the parts of the target that were never set from the robot's state.

        Args:
            dynamics: the state, up to date.
        """
        frame = dynamics.frame(self.frame_ids[0])
        self._target.hold(frame.position, frame.rotation if self.turns else None)

    def _resolve(self, robot: Robot) -> int:
        self.frame_ids = (robot.frame_id(self.frame),)
        sole = robot.soles.get(self.frame)
        if sole is not None and len(sole.controlled) < 6 and self.components >= _ALL_TURNS:
            turns = [OWN_AXES + k - 3 for k in sole.controlled if k in _ALL_TURNS]
            self.chosen = np.array([*sorted(self.components - _ALL_TURNS), *turns])
        return len(self.chosen)

    def _usual_speed(self, robot: Robot) -> Numbers:
        trunk = {robot.frame_id(name) for name in (robot.pelvis, robot.torso)}
        is_trunk = self.frame_ids[0] in trunk
        return usual_speeds(self.chosen, TRUNK_SPEED if is_trunk else ANGULAR_SPEED)


@part
def frame_rows(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """A frame's pose along the world's axes."""
    motion, owners, rows, work = state.motion, assembly.owners, assembly.rows, assembly.work
    frame, m, error = line.frame, line.dim, KINEMATICS
    frames, parameters = owners.frames, owners.parameters
    target = line.start + GAINS * m
    place_frame(motion, frames, frame, work, 0)
    turn_to_world(work, 0)
    for i in range(3):
        work[error + i] = parameters[target + i] - work[i]
    fade = 1.0
    if line.sine:
        sine_between(parameters, target + TARGET_ROTATION, work, ROTATION, work, error + 3)
    elif line.turns:
        turn_between(parameters, target + TARGET_ROTATION, work, ROTATION, work, error + 3)
        fade = fade_of(work, error + 3)
    for k in range(frames.starts[frame], frames.starts[frame + 1]):
        column = int(frames.columns[k])
        x = column_at(motion, column, work[0], work[1], work[2])
        for i in range(m):
            component = int(owners.chosen[line.chosen + i])
            if component < OWN_AXES:
                coefficient = x[component]
            else:
                axis = ROTATION + component - OWN_AXES
                coefficient = work[axis] * x[3] + work[axis + 3] * x[4] + work[axis + 6] * x[5]
            rows.matrix[rows.first + line.first + i, column] = coefficient
    for i in range(m):
        c = int(owners.chosen[line.chosen + i])
        off, fed_back = along(work, error, c, work), 1.0 if c < 3 else fade
        velocity = along(parameters, target + TARGET_VELOCITY, c, work)
        ahead = along(parameters, target + TARGET_ACCELERATION, c, work)
        actual, drift = along(work, VELOCITY, c, work), along(work, BIAS, c, work)
        write_measured(assembly, line, i, off, fed_back, velocity, actual, ahead, drift)


@part
def fade_of(turn: Float64[np.ndarray, " k"], at: int) -> float:
    """Part of a rotation vector of angle phi that is fed back, min(phi, 4 (pi - phi)) / phi."""
    x, y, z = turn[at], turn[at + 1], turn[at + 2]
    angle = math.sqrt(x * x + y * y + z * z)
    return 1.0 if angle <= _FADING else max(_STEEPNESS * (math.pi - angle) / angle, 0.0)


@part
def along(
    twist: Float64[np.ndarray, " k"], at: int, component: int, work: Float64[np.ndarray, " work"]
) -> float:
    """A component of a twist: along an axis of the world, or about one of the frame's own."""
    if component < OWN_AXES:
        return twist[at + component]
    axis = ROTATION + component - OWN_AXES
    return (
        work[axis] * twist[at + 3] + work[axis + 3] * twist[at + 4] + work[axis + 6] * twist[at + 5]
    )
