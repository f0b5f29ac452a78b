"""`LegMomentum`: the pendulum of a robot whose legs are not light.

`leg_ratios`: how heavy they are.
"""

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.locomotion._support import Point, SupportPolygon
from poise.robots import Robot

FeetAt = tuple[Point, Point]
"""Something of both feet along x and y: positions, velocities or accelerations."""


class LegRatios(NamedTuple):
    """How heavy legs are.

    Attributes:
        ahead: angular momentum about the COM of a foot that moves ahead at 1 m/s, over m h.
        rise: that of a foot that rises, over that of one that moves ahead.
    """

    ahead: float
    rise: float


def leg_ratios(robot: Robot, q: Float64[np.ndarray, " nq"], soles: tuple[str, str]) -> LegRatios:
    """How heavy the legs of a robot are, the mean of both.

    A leg follows its foot by its own joints, everything else stands still; m is the robot's mass, h
    the height of its COM above the sole.
    """
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    momentum = pin.computeCentroidalMap(model, data, q)
    height = float(pin.centerOfMass(model, data, q)[2])
    ahead: list[float] = []
    rise: list[float] = []
    for sole in soles:
        frame = robot.frame_id(sole)
        jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        leg = [model.joints[j].idx_v for j in robot.joints_above(sole) if j > 1]
        lever = robot.mass * (height - float(data.oMf[frame].translation[2]))
        c, s = _facing(data.oMf[frame].rotation)
        ways = np.array([[c, s, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]).T
        motions = np.linalg.lstsq(jacobian[:, leg], ways, rcond=None)[0]
        about_left = c * momentum[4, leg] - s * momentum[3, leg]
        x, z = (-about_left @ motions / lever).tolist()
        ahead.append(x)
        rise.append(z / x)
    return LegRatios(float(np.mean(ahead)), float(np.mean(rise)))


def _facing(rotation: Float64[np.ndarray, "3 3"]) -> Point:
    """Where a sole points, along the ground."""
    x, y = float(rotation[0, 0]), float(rotation[1, 0])
    length = math.hypot(x, y)
    return x / length, y / length


class LegMomentum:
    """The linear inverted pendulum of a robot whose legs are not light.

    A leg that swings has angular momentum, which the ground has to give: with
    L_y = -m h beta (p' - c') for each foot p, the ZMP z and the COM c,

        c'' = omega^2 (c - z) + beta sum (p'' - c'')

    so C = (1 + 2 beta) c - beta (p_left + p_right), roughly the COM of everything but the legs,
    moves as the COM of the plain pendulum does, C'' = W^2 (C - Z), with Z made of z in the same way
    and W^2 = omega^2 / (1 + 2 beta). It is the pendulum with three masses. All that is known of the
    plain one holds for C, Z and C + C' / W. A foot that rises turns its leg as one does that moves
    ahead, so its height counts as a way ahead, `LegRatios.rise` times.

    Attributes:
        beta: of each leg.
        factor: 1 + 2 beta.
        omega: W [1/s].
    """

    def __init__(self, beta: float, omega: float) -> None:
        self.beta, self.factor = beta, 1.0 + 2.0 * beta
        self.omega = omega / math.sqrt(self.factor)

    def joined(self, body: Point, feet: FeetAt) -> Point:
        """C or Z, or a rate of it."""
        (lx, ly), (rx, ry) = feet
        return (
            self.factor * body[0] - self.beta * (lx + rx),
            self.factor * body[1] - self.beta * (ly + ry),
        )

    def parted(self, joined: Point, feet: FeetAt) -> Point:
        """What `joined` was made from."""
        (lx, ly), (rx, ry) = feet
        return (
            (joined[0] + self.beta * (lx + rx)) / self.factor,
            (joined[1] + self.beta * (ly + ry)) / self.factor,
        )


class JoinedSupport:
    """Region of Z: a support polygon, seen through `LegMomentum.joined`."""

    def __init__(self, legs: LegMomentum, support: SupportPolygon, feet: FeetAt) -> None:
        self._legs, self._support, self._feet = legs, support, feet

    def nearest(self, point: Point) -> Point:
        """The point itself if it is inside, else the nearest of the edge."""
        inside = self._support.nearest(self._legs.parted(point, self._feet))
        return self._legs.joined(inside, self._feet)
