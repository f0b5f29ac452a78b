"""`CarriedTarget`: a task's target that goes along with the body."""

import math

import numpy as np
from jaxtyping import Float64

from poise.tasks import FrameTask


class CarriedTarget:
    """The target of a frame task, given as if the robot had not walked.

    With the body's way and turn psi since the beginning, and the target p as it would be had the
    robot not walked, world_p = begin + way + R_z(psi) (p - begin).

    Args:
        task: of a frame that goes along.
        position: of the frame at the beginning [m].
        rotation: world_R_frame at the beginning.
        begin: where the body's way begins [m].
    """

    def __init__(
        self,
        task: FrameTask,
        position: Float64[np.ndarray, "3"],
        rotation: Float64[np.ndarray, "3 3"],
        begin: Float64[np.ndarray, "3"],
    ) -> None:
        self.task = task
        self._moves = task.unit != "rad"
        self._begin, self._rotation = begin.copy(), rotation.copy()
        # Offset from the beginning, with its rates.
        self._course = np.array([position - begin, np.zeros(3), np.zeros(3)])
        self._turned = math.nan

    @property
    def target_position(self) -> Float64[np.ndarray, "3"]:
        """Where the frame should be had the robot not walked [m]."""
        return self._begin + self._course[0]

    def set_target(
        self,
        position: Float64[np.ndarray, "3"],
        velocity: Float64[np.ndarray, "3"],
        acceleration: Float64[np.ndarray, "3"],
    ) -> None:
        """Moves the target, as if the robot had not walked.

        Args:
            position: [m].
            velocity: [m/s].
            acceleration: [m/s^2].
        """
        self._course = np.array([position - self._begin, velocity, acceleration])

    def write(self, way: Float64[np.ndarray, "3 4"], spin: Float64[np.ndarray, "3 3"]) -> None:
        """Sets the task's target.

        Args:
            way: x, y, z [m] and turn [rad] since the beginning, and their rates, a row each.
            spin: R_z of the turn.
        """
        turn, rate, second = way[:, 3].tolist()
        still = rate == 0.0 and second == 0.0
        # A target that neither turns nor has turned since it was written last stays as it is.
        rotation = None
        if self.task.turns and not (still and turn == self._turned):
            rotation = spin @ self._rotation
        self._turned = turn if still else math.nan
        rates = np.zeros((2, 6))
        rates[:, 5] = rate, second
        if not self._moves:
            if rotation is not None:
                self.task.set_target(rotation=rotation, velocity=rates[0], acceleration=rates[1])
            return
        place = way[:, :3] + self._course
        if turn != 0.0 or not still:
            place = way[:, :3] + _turned(self._course, spin, rate, second)
        rates[:, :3] = place[1:]
        self.task.set_target(
            position=self._begin + place[0],
            rotation=rotation,
            velocity=rates[0],
            acceleration=rates[1],
        )


def _turned(
    course: Float64[np.ndarray, "3 3"],
    spin: Float64[np.ndarray, "3 3"],
    rate: float,
    second: float,
) -> Float64[np.ndarray, "3 3"]:
    """A point with its rates, seen from outside of a frame that turns about z."""
    arm, slip, pull = course @ spin.T
    across = np.array([-arm[1], arm[0], 0.0])
    drift = np.array([-slip[1], slip[0], 0.0])
    inwards = np.array([arm[0], arm[1], 0.0])
    velocity = slip + rate * across
    acceleration = pull + second * across - rate * rate * inwards + 2.0 * rate * drift
    return np.array([arm, velocity, acceleration])
