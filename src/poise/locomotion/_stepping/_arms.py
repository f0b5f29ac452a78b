"""`ArmMotion`: references of the arms' joints, by a model of the arms alone on a torso at rest."""

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise.locomotion._stepping._clearance import ArmClearance
from poise.robots import Robot

_GAIN = 15.0
"""How fast a hand goes to its place, over its distance from there [1/s]."""

_BRAKING = 0.6
"""Part of the largest acceleration that a hand counts on when it comes near its place."""

_SINGULAR, _DAMPING = 0.1, 0.05
"""An arm whose hand is moved by no more than this a radian in some direction [m] is nearly
stretched; the damping of one that is [m]."""

_LEAST_DAMPING = 1e-6
"""Of an arm that has lost joints to their limits [m^2]."""

_RETURN_GAIN, _RETURN_SPEED = 3.0, 1.2
"""How fast joints go back to rest, over their distance from there [1/s], and at most [rad/s]."""

_ARRIVED = 1e-3
"""Joints that are no further from rest than this, and no faster, are at rest [rad, rad/s]."""

_ELBOW_GAIN, _BEND_GAIN = 1.0, 8.0
"""How fast the freedom that a hand leaves its arm goes back to rest, and how fast a stretched arm
does [1/s]: stretched, it could not be shortened to first order."""

_LIMIT_MARGIN, _STOP, _HARD_STOP = 0.05, 10.0, 25.0
"""How far from their limits joints stop [rad]; the acceleration with which they are to, and with
which they do if need be [rad/s^2]."""

_SPEED_RATIO = 0.7
"""Part of the joints' velocity limits that is used."""

_JOINT_ACCELERATION = 60.0
"""Largest acceleration of a joint [rad/s^2]."""

_BLOCKED, _LEAST_SPEED, _ENOUGH = 0.5, 0.05, 0.1
"""A hand is at the edge of its reach where so much of its velocity is lost, if it is to go faster
than this [m/s], and comes nearer to its place by less than this [m/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Arm:
    """Of one arm: its joints among those of both arms, its hand's frame, its joints' bounds."""

    joints: Int64[np.ndarray, " k"]
    frame: int
    speed: Float64[np.ndarray, " k"]


class ArmMotion:
    """Moves a model of both arms on a torso that rests, so that hands go to their places.

    With the hand at x in the torso and its place p, the hand's velocity is k (p - x), no faster
    than `speed_max` and than it can be braked; the joints' follows by damped least squares
    (Nakamura and Hanafusa 1986), what is left of their freedom brings them back to rest, which
    keeps stretched arms bent, and joints stop before their limits, links before each other
    (`ArmClearance`).
    Velocities change by what keeps the hands' acceleration below `acceleration_max`. So whatever
    places are asked for, the joints' motion is smooth, and within reach by construction.

    Args:
        robot: with or without arms.
        q_rest: configuration at rest [m, rad].
        dt: length of a tick [s].
        speed_max: of a hand [m/s].
        acceleration_max: of a hand [m/s^2].

    Attributes:
        names: of the hands.
        joints: names of the arms' joints, in the robot's order; none without arms.
        index: which of the robot's joints they are.
        q: their angles [rad].
        v: their velocities [rad/s].
        a: their accelerations [rad/s^2].
        hands: where the hands are in the torso [m].
        blocked: whether each hand is at the edge of its reach.
    """

    def __init__(
        self,
        robot: Robot,
        q_rest: Float64[np.ndarray, " nq"],
        *,
        dt: float,
        speed_max: float,
        acceleration_max: float,
    ) -> None:
        self._dt, self._speed, self._acceleration = dt, speed_max, acceleration_max
        chains = _chains(robot)
        index = np.sort(np.concatenate([*chains.values(), np.zeros(0, dtype=np.int64)]))
        self._model, self._q = robot.model, q_rest.copy()
        self._places, self._columns = robot.nq - robot.nj + index, robot.nv - robot.nj + index
        self.names, self.index = tuple(chains), index
        self.joints = tuple(robot.joint_names[j] for j in index)
        self._data = self._model.createData()
        self._torso = robot.frame_id(robot.torso)
        self._rest = q_rest[self._places]
        self._lower = np.minimum(robot.q_min[index] + _LIMIT_MARGIN, self._rest)
        self._upper = np.maximum(robot.q_max[index] - _LIMIT_MARGIN, self._rest)
        self._arms = [
            _Arm(
                joints=np.array([np.flatnonzero(index == j)[0] for j in chain], dtype=np.int64),
                frame=robot.frame_id(hand),
                speed=_SPEED_RATIO * robot.v_max[chain],
            )
            for hand, chain in chains.items()
        ]
        self._clearance = ArmClearance(robot, self._columns, dt) if self._arms else None
        self.reset()

    def reset(self) -> None:
        """Both arms are at rest."""
        n = len(self.joints)
        self.q, self.v, self.a = self._rest.copy(), np.zeros(n), np.zeros(n)
        self.blocked = [False] * len(self._arms)
        self._update()

    def advance(self, places: list[Float64[np.ndarray, "3"] | None]) -> None:
        """One tick.

        Args:
            places: where each hand shall be in the torso [m]; None for an arm that goes to rest.
        """
        if all(place is None for place in places) and self._is_at_rest():
            return
        v, all_wanted = self.v.copy(), self.v.copy()
        jacobians = [self._jacobian(arm) for arm in self._arms]
        velocities: list[Float64[np.ndarray, "3"] | None] = []
        for i, (arm, place) in enumerate(zip(self._arms, places, strict=True)):
            velocity = None if place is None else self._towards(place - self.hands[i])
            all_wanted[arm.joints] = (
                self._homewards(arm)
                if velocity is None
                else self._follow(arm, jacobians[i], velocity)
            )
            velocities.append(velocity)
        if self._clearance is not None:
            self._clearance.update(self._q)
            all_wanted = self._clearance.keep(all_wanted, hard=False)
        for i, (arm, velocity) in enumerate(zip(self._arms, velocities, strict=True)):
            own, J = arm.joints, jacobians[i]
            wanted, self.blocked[i] = all_wanted[own], False
            if velocity is not None:
                speed, nearer = math.hypot(*velocity), float(velocity @ J @ wanted)
                least = speed * min(_BLOCKED * speed, _ENOUGH)
                self.blocked[i] = speed > _LEAST_SPEED and nearer < least
            change = wanted - self.v[own]
            fastest = max(
                math.hypot(*(J @ change)) / self._acceleration,
                float(np.abs(change).max()) / _JOINT_ACCELERATION,
            )
            v[own] += change * min(1.0, self._dt / max(fastest, 1e-12))
            v[own] = np.clip(v[own], *self._bounds(arm, _HARD_STOP))
        if self._clearance is not None:
            braked = self._clearance.keep(v, hard=True) - self.v
            # What is near changes from tick to tick, and joints jerk no harder for that.
            fastest = float(np.abs(braked).max()) / _JOINT_ACCELERATION
            v = self.v + braked * min(1.0, self._dt / max(fastest, 1e-12))
        self.q, self.v, self.a = self.q + self._dt * v, v, (v - self.v) / self._dt
        self._update()

    def _is_at_rest(self) -> bool:
        """Whether nothing moves any more; then the arms are where they rest to the last bit."""
        off = max(float(np.abs(self.q - self._rest).max()), float(np.abs(self.v).max()))
        if off > _ARRIVED:
            return False
        self.q, self.v, self.a = self._rest.copy(), np.zeros_like(self.v), np.zeros_like(self.a)
        return True

    def _update(self) -> None:
        self._q[self._places] = self.q
        pin.computeJointJacobians(self._model, self._data, self._q)
        self._turn = self._placement(self._torso).rotation.T
        origin = self._placement(self._torso).translation
        self.hands = [
            self._turn @ (self._placement(arm.frame).translation - origin) for arm in self._arms
        ]

    def _placement(self, frame: int) -> pin.SE3:
        return pin.updateFramePlacement(self._model, self._data, frame)

    def _jacobian(self, arm: _Arm) -> Float64[np.ndarray, "3 k"]:
        """Of the hand's position in the torso, by the arm's own joints."""
        aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        J = pin.getFrameJacobian(self._model, self._data, arm.frame, aligned)
        return self._turn @ J[:3, self._columns[arm.joints]]

    def _towards(self, way: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
        """The velocity of a hand that has a way to go [m/s]."""
        far = math.hypot(*way)
        braked = math.sqrt(2.0 * _BRAKING * self._acceleration * far)
        speed = min(_GAIN * far, braked, self._speed)
        return way * (speed / max(far, 1e-9))

    def _homewards(self, arm: _Arm) -> Float64[np.ndarray, " k"]:
        way = self._rest[arm.joints] - self.q[arm.joints]
        far = float(np.abs(way).max())
        return way * min(_RETURN_GAIN, _RETURN_SPEED / max(far, 1e-9))

    def _bounds(
        self, arm: _Arm, stop: float
    ) -> tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, " k"]]:
        """Least and largest velocities with which joints still stop at their limits [rad/s]."""
        own = arm.joints
        down = _braked(self.q[own] - self._lower[own], stop, self._dt)
        up = _braked(self._upper[own] - self.q[own], stop, self._dt)
        return -np.minimum(arm.speed, down), np.minimum(arm.speed, up)

    def _follow(
        self, arm: _Arm, J: Float64[np.ndarray, "3 k"], velocity: Float64[np.ndarray, "3"]
    ) -> Float64[np.ndarray, " k"]:
        """The joints' velocities, within their bounds; what one cannot do, the others do."""
        own = arm.joints
        low, high = self._bounds(arm, _STOP)
        least = math.sqrt(max(float(np.linalg.eigvalsh(J @ J.T)[0]), 0.0))
        stretched = max(1.0 - least / _SINGULAR, 0.0)
        gain = _ELBOW_GAIN + stretched * (_BEND_GAIN - _ELBOW_GAIN)
        back = gain * (self._rest[own] - self.q[own])
        damping = (_LEAST_DAMPING + (stretched * _DAMPING) ** 2) * np.eye(3)
        free = np.ones(len(own), dtype=np.bool_)
        wanted = np.zeros(len(own))
        for _ in range(len(own)):
            A, rest = J[:, free], velocity - J[:, ~free] @ wanted[~free]
            inverse = A.T @ np.linalg.inv(A @ A.T + damping)
            wanted[free] = back[free] + inverse @ (rest - A @ back[free])
            beyond = free & ((wanted < low) | (wanted > high))
            if not beyond.any():
                break
            wanted[beyond] = np.clip(wanted, low, high)[beyond]
            free &= ~beyond
        return np.clip(wanted, low, high)


def _braked(room: Float64[np.ndarray, " k"], stop: float, dt: float) -> Float64[np.ndarray, " k"]:
    """The velocities that come to rest in so much room, which may be rounded below zero [rad/s]."""
    room = np.maximum(room, 0.0)
    return np.minimum(np.sqrt(2.0 * stop * room), 0.5 * room / dt)


def _chains(robot: Robot) -> dict[str, Int64[np.ndarray, " k"]]:
    """Joints of each arm, from the torso on, by its hand; no joint that moves both hands."""
    model, torso = robot.model, _above(robot, robot.torso)
    above = {hand: _above(robot, hand) for hand in robot.hands}
    own: dict[str, Int64[np.ndarray, " k"]] = {}
    for hand, joints in above.items():
        others = set[int]().union(*(above[h] for h in above if h != hand))
        chain = [int(j) for j in model.supports[_joint(robot, hand)] if j in joints - others]
        # Joint 0 is the world; those of a floating base are no arm's.
        index = [j - (2 if robot.floating_base else 1) for j in chain if j not in torso]
        if len(index) >= 3:
            own[hand] = np.array(index, dtype=np.int64)
    return own


def _joint(robot: Robot, frame: str) -> int:
    return int(robot.model.frames[robot.frame_id(frame)].parentJoint)


def _above(robot: Robot, frame: str) -> set[int]:
    """Joints that move a frame."""
    return {int(j) for j in robot.model.supports[_joint(robot, frame)]}
