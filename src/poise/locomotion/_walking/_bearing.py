"""`Bearing`: where in its sole a foot can carry the whole robot by itself."""

import math
from typing import NamedTuple

import pinocchio as pin

from poise.locomotion._support import Point
from poise.robots import Robot

_ALIGNED = 0.7
"""A joint whose axis has this much of a sole's axis turns the foot about it."""

_MIDDLE = 0.1
"""How far beside the middle of what bears the ZMP may rest, over its size: in the centre of a sole
of which an edge is out of a strong ankle's reach."""


class Bearing(NamedTuple):
    """A rectangle in which the ZMP can be while the other foot is in the air.

    Attributes:
        x: of its middle, along the sole's axes from the sole's centre [m].
        y: likewise [m].
        length: along x [m].
        width: along y [m]; zero on an edge.
    """

    x: float
    y: float
    length: float
    width: float

    @property
    def rest(self) -> Point:
        """Where the ZMP rests: near its middle, on the side of the sole's centre [m]."""
        x, y = _MIDDLE * self.length, _MIDDLE * self.width
        return min(max(0.0, self.x - x), self.x + x), min(max(0.0, self.y - y), self.y + y)

    @property
    def room(self) -> Point:
        """How far the ZMP can go from there either way, along x and y [m]."""
        x, y = self.rest
        return 0.5 * self.length - abs(x - self.x), 0.5 * self.width - abs(y - self.y)

    def rest_at(self, position: Point, yaw: float) -> Point:
        """Return the rest of the ZMP in the world, on a sole that lies there [m]."""
        (ahead, left), c, s = self.rest, math.cos(yaw), math.sin(yaw)
        return position[0] + c * ahead - s * left, position[1] + s * ahead + c * left

    def within(self, lower: Point, upper: Point) -> "Bearing":
        """Return its part in another rectangle; the nearest edge or corner where there is none."""
        (x, length), (y, width) = (
            _common(middle, size, *ends)
            for middle, size, *ends in (
                (self.x, self.length, lower[0], upper[0]),
                (self.y, self.width, lower[1], upper[1]),
            )
        )
        return Bearing(x, y, length, width)


def _common(middle: float, size: float, lower: float, upper: float) -> tuple[float, float]:
    """Middle and size of what two intervals share [m]."""
    low, high = middle - 0.5 * size, middle + 0.5 * size
    begin, end = min(max(lower, low), high), min(max(upper, low), high)
    return 0.5 * (begin + end), end - begin


def bearing(robot: Robot, sole: str, outwards: float) -> Bearing:
    """All of the sole, but for what its leg cannot hold.

    An ankle with the torque tau holds the weight W as far as tau / W from its axis. A sole that
    leans with its leg does so outwards while it carries alone, as the body is on its side of the
    middle, and stands on its outer edge.
    """
    size = robot.soles[sole]
    back, front = _held(robot, sole, 4, 0, 0.5 * size.length)
    right, left = _held(robot, sole, 3, 1, 0.5 * size.width)
    if size.leans:
        left = right = 0.5 * outwards * size.width
    return Bearing(0.5 * (front + back), 0.5 * (left + right), front - back, left - right)


def _held(robot: Robot, sole: str, turn: int, axis: int, half: float) -> tuple[float, float]:
    """The part of a sole along one axis that the joint which turns it about the other one holds."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id(sole)
    pin.computeJointJacobians(model, data, robot.q_home)
    J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
    pose = pin.updateFramePlacement(model, data, frame)
    for joint in reversed(robot.leg_joints(sole)):
        column = model.joints[joint].idx_v
        if abs(J[turn, column]) > _ALIGNED:
            at = float(pose.actInv(data.oMi[joint].translation)[axis])
            torque = float(robot.tau_max[column - robot.base_dofs])
            reach = torque / robot.weight
            low, high = max(at - reach, -half), min(at + reach, half)
            if low < high:
                return low, high
            # An ankle that holds nothing of the sole: as near to its axis as can be.
            nearest = min(max(at, -half), half)
            return nearest, nearest
    return -half, half
