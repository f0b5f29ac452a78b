"""DCM: pendulum with legs, references by recursion, feedback."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.locomotion._support import Point
from poise.robots import Robot

FeetAt = tuple[Point, Point]
"""Something of both feet along x and y: positions, velocities or accelerations."""


class LegRatios(NamedTuple):
    """Angular momentum of moving legs."""

    ahead: float  # angular momentum about the CoM of a foot that moves ahead at 1 m/s, over m h
    rise: float  # that of a foot that rises, over that of one that moves ahead


def leg_ratios(robot: Robot, q: Float64[np.ndarray, " nq"], soles: tuple[str, str]) -> LegRatios:
    """Return the ratios of a robot's legs, the mean of both."""
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    momentum = pin.computeCentroidalMap(model, data, q)
    height = float(pin.centerOfMass(model, data, q)[2])
    ratios: list[Point] = []
    for sole in soles:
        frame = robot.frame_id(sole)
        jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        leg = [model.joints[j].idx_v for j in robot.joints_above(sole) if j > 1]
        lever = robot.mass * (height - float(data.oMf[frame].translation[2]))
        facing = data.oMf[frame].rotation[:2, 0]
        c, s = facing / np.linalg.norm(facing)
        ways = np.array([[c, s, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]).T
        motions = np.linalg.lstsq(jacobian[:, leg], ways, rcond=None)[0]
        about_left = c * momentum[4, leg] - s * momentum[3, leg]
        x, z = (-about_left @ motions / lever).tolist()
        ratios.append((x, z / x))
    return LegRatios(*np.mean(ratios, axis=0).tolist())


class LegMomentum:
    """The linear inverted pendulum of a robot whose legs are not light."""

    # A leg that swings has angular momentum, which the ground has to give: with
    # L_y = -m h beta (p' - c') for each foot p, the ZMP z and the CoM c,
    #     c'' = omega^2 (c - z) + beta sum (p'' - c'')
    # so C = (1 + 2 beta) c - beta (p_left + p_right) moves as the CoM of the plain pendulum does,
    # C'' = W^2 (C - Z), with Z defined from z and W^2 = omega^2 / (1 + 2 beta). A foot
    # that rises turns its leg as one does that moves ahead: its height counts `LegRatios.rise`
    # times as a way ahead.

    def __init__(self, beta: float, omega: float) -> None:
        self.beta, self.factor = beta, 1.0 + 2.0 * beta
        # W [1/s]
        self.omega = omega / math.sqrt(self.factor)

    def joined(self, body: Point, feet: FeetAt) -> Point:
        """C or Z, or a rate of it."""
        (lx, ly), (rx, ry) = feet
        return (
            self.factor * body[0] - self.beta * (lx + rx),
            self.factor * body[1] - self.beta * (ly + ry),
        )

    def parted(self, joined: Point, feet: FeetAt) -> Point:
        """Invert `joined`."""
        (lx, ly), (rx, ry) = feet
        return (
            (joined[0] + self.beta * (lx + rx)) / self.factor,
            (joined[1] + self.beta * (ly + ry)) / self.factor,
        )


REST_TIME = 0.3
"""Time of the ZMP from the last stance foot to where it rests [s]."""


class StepTimes(NamedTuple):
    """Durations of the phases of a step."""

    swing: float  # from lift-off to touchdown [s]
    double_support: float  # from touchdown to the next lift-off [s]


def before_transfer(xi: Point, start: Point, end: Point, omega: float, time: float) -> Point:
    """Return xi before a linear transfer of the ZMP, from xi after it."""
    # xi' = omega (xi - r) (Englsberger, Ott, Albu-Schaeffer 2015): with r even from r_0 to r_1,
    # xi(0) = r_0 + s + e^{-omega T} (xi(T) - r_1 - s),  s = (r_1 - r_0) / (omega T).
    kept, ratio = math.exp(-omega * time), 1.0 / (omega * time)
    s_x, s_y = ratio * (end[0] - start[0]), ratio * (end[1] - start[1])
    return (
        start[0] + s_x + kept * (xi[0] - end[0] - s_x),
        start[1] + s_y + kept * (xi[1] - end[1] - s_y),
    )


def touchdown_dcm(
    feet: Sequence[Point], legs: LegMomentum, times: StepTimes, rest: Point | None = None
) -> Point:
    """Return xi at the next touchdown from which all later steps can be made as planned."""
    omega = legs.omega
    xi = over = feet[-1] if rest is None else rest
    time = times.double_support if rest is None else REST_TIME
    for i in range(len(feet) - 1, 0, -1):
        behind, ahead = feet[i - 1], feet[i]
        stands = (behind, ahead)
        landed = legs.joined(behind, stands)
        xi = before_transfer(xi, landed, legs.joined(over, stands), omega, time)
        over, time = behind, times.double_support
        if i > 1:
            start = legs.joined(behind, (feet[i - 2], behind))
            xi = before_transfer(xi, start, landed, omega, times.swing)
    return xi


def transfer_gain(legs: LegMomentum, times: StepTimes) -> float:
    """Return the derivative of `touchdown_dcm` by the next foothold and all after it."""
    here, there = (0.0, 0.0), (1.0, 0.0)
    return touchdown_dcm((here, there, there), legs, times)[0]


DcmMotion = tuple[float, float]
"""Position [m] and velocity [m/s] of xi along one axis."""

DcmMotions = tuple[DcmMotion, DcmMotion]
"""The same along x and y."""


def hermite_step(now: DcmMotion, goal: DcmMotion, left: float, dt: float) -> DcmMotion:
    """One tick along the cubic that is at a goal, as fast as that asks for, in the time left."""
    (x, v), (x1, v1) = now, goal
    if left <= dt:
        return goal
    acceleration = 6.0 * (x1 - x) / (left * left) - (4.0 * v + 2.0 * v1) / left
    jerk = 6.0 * (v + v1) / (left * left) - 12.0 * (x1 - x) / left**3
    return (
        x + dt * (v + dt * (0.5 * acceleration + dt * jerk / 6.0)),
        v + dt * (acceleration + 0.5 * dt * jerk),
    )


_FADE = 0.05
"""Time over which a ZMP commanded by another feedback fades [s]: the DCM grows by a fifth in it."""


class DcmFeedback:
    """Feedback of the DCM, inside the soles (Englsberger, Ott, Albu-Schaeffer 2015)."""

    # With xi = c + c' / omega and the reference's own ZMP r_ref = c_ref - c_ref'' / omega^2,
    #     r = r_ref + (1 + k / omega) (xi - xi_ref), taken into the support polygon
    #     c'' = omega^2 (c - r)
    # The error dies out with the rate k while the ZMP is free.

    def __init__(self, omega: float, gain: float) -> None:
        self.omega, self._gain = omega, gain
        self.zmp = (0.0, 0.0)  # r [m]
        self.begin()

    def begin(self) -> None:
        self.error = self._offset = (0.0, 0.0)  # of the DCM, xi - xi_ref [m]
        self._continues_from: Point | None = None

    def continue_from(self, zmp: Point) -> None:
        """Begin the next tick at a ZMP and fade into the feedback's own: a bumpless transfer."""
        self._continues_from = zmp

    def acceleration(
        self,
        com: Point,
        velocity: Point,
        reference: tuple[Point, Point, Point],
        nearest: Callable[[Point], Point],
        dt: float = 0.0,
        gain: float | None = None,
    ) -> Point:
        """Return the horizontal acceleration of the CoM, with the nearest ZMP allowed [m/s^2]."""
        w = self.omega
        factor = 1.0 + (self._gain if gain is None else gain) / w
        (px, py), (rx, ry), (sx, sy) = reference
        (cx, cy), (vx, vy) = com, velocity
        ex, ey = cx - px + (vx - rx) / w, cy - py + (vy - ry) / w
        x, y = nearest((px - sx / (w * w) + factor * ex, py - sy / (w * w) + factor * ey))
        if self._continues_from is not None:
            from_x, from_y = self._continues_from
            self._continues_from, self._offset = None, (from_x - x, from_y - y)
        if self._offset != (0.0, 0.0):
            off_x, off_y = self._offset
            x, y = nearest((x + off_x, y + off_y))
            left = max(0.0, 1.0 - dt / _FADE)
            self._offset = left * off_x, left * off_y
        self.error, self.zmp = (ex, ey), (x, y)
        return w * w * (cx - x), w * w * (cy - y)
