"""`FrameTask`: position and orientation of a frame in the world."""

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, checked_kind
from poise.dynamics import Dynamics, rotation_sine, rotation_vector
from poise.errors import UnknownNameError
from poise.robots import Robot
from poise.stack._axes import as_rows, checked_rotation, checked_target, parse_axes, split_rows
from poise.stack._task import Task, VectorTarget

_LINEAR = np.array([0, 1, 2, 6, 7, 8])
_ANGULAR = np.array([3, 4, 5, 9, 10, 11])
"""Where linear and angular parts stand in velocity and acceleration put behind one another."""

ORIENTATION_ERRORS = {"logarithm": rotation_vector, "sine": rotation_sine}
"""Measures of how far two orientations are apart, by name."""


class FrameTask(Task):
    """A frame follows a target pose in the world.

    Rows are world axes, position first: J dv + drift = reference with the `LOCAL_WORLD_ALIGNED`
    Jacobian and classical drift. The orientation error is the rotation vector
    (ln target_R actual_R^T)^vee, right at zero and at pi; or its sine, r sin(phi), as eq. (63) of
    (Park, Jin, Kang 2022) has it for small errors.

    Args:
        frame: a role such as "left_hand", or a link or frame of the robot's document.
        axes: "pose", "position", "orientation", with letters "position_z", or joined by "+".
        kp: stiffness, one number or one a row [1/s^2].
        kd: damping [1/s]; critical when None.
        weight: weight of its rows in their level.
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
        name: str | None = None,
        orientation_error: str = "logarithm",
    ) -> None:
        super().__init__(name or f"{frame} {axes}", kp=kp, kd=kd, weight=weight)
        self.frame = checked_kind(frame, str, f"frame of task {self.name!r}")
        mask = "position+orientation" if axes == "pose" else axes
        index = parse_axes(mask, {"position": 0, "orientation": 3})
        self._size, self._rows = len(index), as_rows(index)
        self._blocks = split_rows(index)
        if orientation_error not in ORIENTATION_ERRORS:
            raise UnknownNameError(
                f"no such orientation error of task {self.name!r}",
                got=orientation_error,
                choices=ORIENTATION_ERRORS,
            )
        self._orientation_error = ORIENTATION_ERRORS[orientation_error]
        self.turns = bool(index[-1] >= 3)
        self.unit = ("m, rad" if index[0] < 3 else "rad") if self.turns else "m"
        self._target = VectorTarget(3, f"task {self.name!r}")
        self._orientation: Float64[np.ndarray, "3 3"] | None = None
        self._orientation_held = False
        self._rates = np.zeros(12)
        self._velocity, self._acceleration = self._rates[:6], self._rates[6:]
        self._frame_id = -1

    def set_target(
        self,
        position: Numbers | None = None,
        rotation: Numbers | None = None,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Sets where the frame should be; what is not given stays as it is.

        Rates belong to what is given beside them: with a position alone, the angular rates stay.

        Args:
            position: in the world [m].
            rotation: world_R_frame.
            velocity: linear then angular, in the world [m/s, rad/s]; zero when None.
            acceleration: linear then angular [m/s^2, rad/s^2]; zero when None.

        Raises:
            TargetError: wrong shape, NaN, or not a rotation.
        """
        new = np.zeros(12)
        if velocity is not None:
            new[:6] = checked_target(velocity, 6, f"target velocity of task {self.name!r}")
        if acceleration is not None:
            what = f"target acceleration of task {self.name!r}"
            new[6:] = checked_target(acceleration, 6, what)
        orientation = None
        if rotation is not None:
            orientation = checked_rotation(rotation, f"target rotation of task {self.name!r}")
        if position is not None:
            self._target.set(position)
        if orientation is not None:
            self._orientation = orientation
            self._orientation_held = False
        if position is not None or rotation is None:
            self._rates[_LINEAR] = new[_LINEAR]
        if rotation is not None or position is None:
            self._rates[_ANGULAR] = new[_ANGULAR]

    @property
    def target_position(self) -> Float64[np.ndarray, "3"] | None:
        """Where the frame should be [m]; None until a target is set or taken from the robot."""
        return self._target.position

    @property
    def target_rotation(self) -> Float64[np.ndarray, "3 3"] | None:
        """How the frame should be turned, world_R_frame; None until set or taken from the robot."""
        return self._orientation

    def reset(self) -> None:
        """Forgets a target that was taken from the robot."""
        self._target.release_hold()
        if self._orientation_held:
            self._orientation, self._orientation_held = None, False

    @property
    def blocks(self) -> tuple[int, ...]:
        """Position rows, then orientation rows."""
        return self._blocks

    def evaluate_jacobian(self, dynamics: Dynamics) -> None:
        """Fills `jacobian` alone."""
        self.jacobian = dynamics.frame(self._frame_id).jacobian[self._rows]

    def _resolve(self, robot: Robot) -> int:
        self._frame_id = robot.frame_id(self.frame)
        return self._size

    def _evaluate(self, dynamics: Dynamics) -> Float64[np.ndarray, " m"]:
        frame, error = dynamics.frame(self._frame_id), np.zeros(6)
        error[:3] = self._target.error(frame.position)
        if self.turns:
            if self._orientation is None:
                self._orientation, self._orientation_held = frame.rotation, True
            error[3:] = self._orientation_error(self._orientation, frame.rotation)
        parts = (
            frame.jacobian,
            frame.bias,
            error,
            self._velocity - frame.velocity,
            self._acceleration,
        )
        if self._size < 6:
            parts = tuple([part[self._rows] for part in parts])
        self.jacobian, self.drift, self.error, self.error_rate, acceleration = parts
        return acceleration
