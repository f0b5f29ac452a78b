"""`ArmMotion`: references of the arms' joints, by a model of the arms alone on a torso at rest."""

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise.locomotion._stepping._upper_body._clearance import ArmClearance
from poise.locomotion._stepping._upper_body._null_space import ArmServer, Bounds
from poise.locomotion._stepping._upper_body._turning import (
    ARRIVED,
    BRAKING,
    SPEED_RATIO,
    TurnProgress,
    TurnRate,
    TurnShare,
    stopping,
)
from poise.robots import Robot

_GAIN = 15.0
"""How fast a hand goes to its place, over its distance from there [1/s]."""

_SINGULAR, _DAMPING = 0.1, 0.05
"""An arm whose hand is moved by no more than this a radian in some direction [m] is nearly
stretched; the damping of one that is [m]."""

_TURN_GAIN, _TURN_ACCELERATION = 10.0, 20.0
"""How fast a hand turns to where it shall be, over the angle [1/s]; and how hard [rad/s^2]."""

_TURN_DAMPING = 0.1
"""A wrist that turns its hand by no more than this a radian in some direction turns it half as fast
there as it is asked to."""

_TURN_JOINT_SPEED = 2.5
"""No joint is faster for turning a hand [rad/s]: centripetal acceleration would move it."""

_TURN_HOW = (_DAMPING, _TURN_DAMPING, _TURN_JOINT_SPEED)
"""All of that for an `ArmServer`."""

_STEP_DAMPING = 1e-3
"""Of a step that is known to be possible [m, 1]."""

_LEAST_DAMPING = 1e-6
"""Of an arm that has lost joints to their limits [m^2]."""

_RETURN_GAIN, _RETURN_SPEED = 3.0, 1.2
"""How fast joints go back to rest, over their distance from there [1/s], and at most [rad/s]."""

_ELBOW_GAIN, _BEND_GAIN = 1.0, 8.0
"""How fast the freedom that a hand leaves its arm goes back to rest, and how fast a stretched arm
does [1/s]: stretched, it could not be shortened to first order."""

_LIMIT_MARGIN, _STOP, _HARD_STOP = 0.05, 10.0, 25.0
"""How far from their limits joints stop [rad]; the acceleration with which they are to, and with
which they do if need be [rad/s^2]."""

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
    server: ArmServer


class ArmMotion:
    """Moves a model of both arms on a torso that rests, so that hands go to their places.

    With the hand at x in the torso and its place p, the hand's velocity is k (p - x) + p', with p'
    where it is known, no faster than `speed_max` and, against p', than it can be braked; the
    joints' follows by damped least squares (Nakamura and Hanafusa 1986), what is left of their
    freedom brings them back to rest, which keeps stretched arms bent, and joints stop before their
    limits, links before each other (`ArmClearance`). How a hand is turned comes after all that:
    with what then is left of the joints' freedom (`ArmServer`), and not at all where the hand does
    not come to its place (`TurnShare`).
    Velocities change by what keeps the hands' acceleration below `acceleration_max`. So whatever
    places are asked for, the joints' motion is smooth, and within reach by construction.

    Args:
        robot: with or without arms.
        q_rest: configuration at rest [m, rad].
        dt: length of a tick [s].
        speed_max: of a hand [m/s].
        acceleration_max: of a hand [m/s^2].
        turn_speed_max: of a hand [rad/s].

    Attributes:
        names: of the hands.
        joints: names of the arms' joints, in the robot's order; none without arms.
        index: which of the robot's joints they are.
        q: their angles [rad].
        v: their velocities [rad/s].
        a: their accelerations [rad/s^2].
        hands: where the hands are in the torso [m].
        rotations: how they are turned, torso_R_hand.
        rests: whether nothing moves, and all arms are where they rest.
        blocked: whether each hand is at the edge of its reach.
        stuck: whether each is turned as far as it goes.
    """

    def __init__(
        self,
        robot: Robot,
        q_rest: Float64[np.ndarray, " nq"],
        *,
        dt: float,
        speed_max: float,
        acceleration_max: float,
        turn_speed_max: float = 3.0,
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
                speed=SPEED_RATIO * robot.v_max[chain],
                server=ArmServer(len(chain)),
            )
            for hand, chain in chains.items()
        ]
        self._rate = TurnRate(
            gain=_TURN_GAIN, speed=turn_speed_max, acceleration=_TURN_ACCELERATION, dt=dt
        )
        self._clearance = ArmClearance(robot, self._columns, dt) if self._arms else None
        self.reset()

    def reset(self) -> None:
        """Both arms are at rest."""
        n = len(self.joints)
        self.q, self.v, self.a = self._rest.copy(), np.zeros(n), np.zeros(n)
        self.rests = True
        self.blocked, self.stuck = [False] * len(self._arms), [False] * len(self._arms)
        self._shares = [TurnShare(self._dt) for _ in self._arms]
        self._progress = [TurnProgress(self._dt) for _ in self._arms]
        self._update()

    def advance(
        self,
        places: list[Float64[np.ndarray, "3"] | None],
        rotations: list[Float64[np.ndarray, "3 3"] | None] | None = None,
        rates: list[Float64[np.ndarray, "3"] | None] | None = None,
    ) -> None:
        """One tick.

        Args:
            places: where each hand shall be in the torso [m]; None for an arm that goes to rest.
            rotations: how each hand that has a place shall be turned, torso_R_hand; None for one
                that is turned as its place asks for.
            rates: how fast each place moves [m/s]; None for one of which that is not known.
        """
        if all(place is None for place in places) and self._is_at_rest():
            return
        self.rests = False
        v, all_wanted = self.v.copy(), self.v.copy()
        jacobians = [self._jacobian(arm) for arm in self._arms]
        bounds = [self._bounds(arm, _STOP) for arm in self._arms]
        velocities: list[Float64[np.ndarray, "3"] | None] = []
        for i, (arm, place) in enumerate(zip(self._arms, places, strict=True)):
            rate = None if rates is None else rates[i]
            velocity = None if place is None else self._towards(place - self.hands[i], rate)
            all_wanted[arm.joints] = (
                self._homewards(arm)
                if velocity is None
                else self._follow(arm, jacobians[i][:3], velocity, bounds[i])
            )
            velocities.append(velocity)
        followed = all_wanted
        if self._clearance is not None:
            self._clearance.update(self._q)
            all_wanted = self._clearance.keep(all_wanted, hard=False)
        turned = [False] * len(self._arms)
        for i, rotation in enumerate(rotations or ()):
            self.stuck[i], velocity = False, velocities[i]
            turned[i] = rotation is not None and velocity is not None
            if rotation is not None and velocity is not None:
                self._turn(i, jacobians[i], (velocity, rotation), followed, all_wanted, bounds[i])
        for i, (arm, velocity) in enumerate(zip(self._arms, velocities, strict=True)):
            own, J = arm.joints, jacobians[i]
            wanted, self.blocked[i] = all_wanted[own], False
            if velocity is not None:
                speed, nearer = math.hypot(*velocity), float(velocity @ J[:3] @ wanted)
                least = speed * min(_BLOCKED * speed, _ENOUGH)
                self.blocked[i] = speed > _LEAST_SPEED and nearer < least
            step = self._step_turned if turned[i] else self._step
            v[own] = np.clip(step(arm, J, wanted), *self._bounds(arm, _HARD_STOP))
        if self._clearance is not None:
            braked = self._clearance.keep(v, hard=True) - self.v
            # What is near changes from tick to tick, and joints jerk no harder for that.
            fastest = float(np.abs(braked).max()) / _JOINT_ACCELERATION
            v = self.v + braked * min(1.0, self._dt / max(fastest, 1e-12))
        self.q, self.v, self.a = self.q + self._dt * v, v, (v - self.v) / self._dt
        self._update()

    def _step(
        self, arm: _Arm, jacobian: Float64[np.ndarray, "6 k"], wanted: Float64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, " k"]:
        """An arm's velocities after a tick, as near to the wanted ones as accelerations allow."""
        before = self.v[arm.joints]
        change = wanted - before
        fastest = max(
            math.hypot(*(jacobian[:3] @ change)) / self._acceleration,
            float(np.abs(change).max()) / _JOINT_ACCELERATION,
        )
        return before + change * min(1.0, self._dt / max(fastest, 1e-12))

    def _step_turned(
        self, arm: _Arm, jacobian: Float64[np.ndarray, "6 k"], wanted: Float64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, " k"]:
        """Likewise, but joints that turn the hand get no acceleration that moving it needs."""
        most = self._dt * self._acceleration, self._dt * _JOINT_ACCELERATION, _STEP_DAMPING
        return arm.server.step(jacobian, self.v[arm.joints], wanted, most)

    def _is_at_rest(self) -> bool:
        """Whether nothing moves any more; then the arms are where they rest to the last bit."""
        if self.rests:
            return True
        off = max(float(np.abs(self.q - self._rest).max()), float(np.abs(self.v).max()))
        if off > ARRIVED:
            return False
        self.q, self.v, self.a = self._rest.copy(), np.zeros_like(self.v), np.zeros_like(self.a)
        self.rests = True
        return True

    def _update(self) -> None:
        self._q[self._places] = self.q
        pin.computeJointJacobians(self._model, self._data, self._q)
        self._into_torso = turn = self._placement(self._torso).rotation.T
        origin = self._placement(self._torso).translation
        poses = [self._placement(arm.frame) for arm in self._arms]
        self.hands = [turn @ (pose.translation - origin) for pose in poses]
        self.rotations = [turn @ pose.rotation for pose in poses]

    def _placement(self, frame: int) -> pin.SE3:
        return pin.updateFramePlacement(self._model, self._data, frame)

    def _jacobian(self, arm: _Arm) -> Float64[np.ndarray, "6 k"]:
        """Of the hand in the torso, linear first, by the arm's own joints."""
        aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        J = pin.getFrameJacobian(self._model, self._data, arm.frame, aligned)
        own = J[:, self._columns[arm.joints]]
        return np.concatenate((self._into_torso @ own[:3], self._into_torso @ own[3:]))

    def _turn(
        self,
        hand: int,
        jacobian: Float64[np.ndarray, "6 k"],
        goal: tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]],
        followed: Float64[np.ndarray, " n"],
        wanted: Float64[np.ndarray, " n"],
        bounds: Bounds,
    ) -> None:
        """Has an arm turn its hand, too, by what its wanted velocities leave free."""
        arm, share, (velocity, rotation) = self._arms[hand], self._shares[hand], goal
        own = arm.joints
        speed, now = math.hypot(*velocity), jacobian @ self.v[own]
        share.update(speed, float(velocity @ now[:3]) / max(speed, 1e-9))
        to_be = self._rate.towards(rotation, self.rotations[hand])
        asked = self._rate.change(to_be, now[3:])
        near = np.zeros((0, len(own))), np.zeros(0)
        if self._clearance is not None:
            near = self._clearance.near(own, wanted)
        # An elbow that turning brought near the body must not hold the hand back from its place.
        reference = np.concatenate((jacobian[:3] @ followed[own], asked))
        found = arm.server.turn(jacobian, reference, wanted[own], bounds, near, _TURN_HOW)
        wanted[own] += share.part * (found - wanted[own])
        self._progress[hand].update(to_be, now[3:])
        self.stuck[hand] = self._progress[hand].stuck

    def _towards(
        self, way: Float64[np.ndarray, "3"], rate: Float64[np.ndarray, "3"] | None
    ) -> Float64[np.ndarray, "3"]:
        """The velocity of a hand that has a way to go to a place that moves [m/s]."""
        far = math.hypot(*way)
        braked = math.sqrt(2.0 * BRAKING * self._acceleration * far)
        velocity = way * (min(_GAIN * far, braked, self._speed) / max(far, 1e-9))
        if rate is None:
            return velocity
        velocity += rate
        return velocity * min(1.0, self._speed / max(math.hypot(*velocity), 1e-9))

    def _homewards(self, arm: _Arm) -> Float64[np.ndarray, " k"]:
        way = self._rest[arm.joints] - self.q[arm.joints]
        far = float(np.abs(way).max())
        return way * min(_RETURN_GAIN, _RETURN_SPEED / max(far, 1e-9))

    def _bounds(self, arm: _Arm, stop: float) -> Bounds:
        """Least and largest velocities with which joints still stop at their limits [rad/s]."""
        own = arm.joints
        down = stopping(self.q[own] - self._lower[own], stop, self._dt)
        up = stopping(self._upper[own] - self.q[own], stop, self._dt)
        return -np.minimum(arm.speed, down), np.minimum(arm.speed, up)

    def _follow(
        self,
        arm: _Arm,
        J: Float64[np.ndarray, "3 k"],
        velocity: Float64[np.ndarray, "3"],
        bounds: Bounds,
    ) -> Float64[np.ndarray, " k"]:
        """The joints' velocities, within their bounds; what one cannot do, the others do."""
        own, (low, high) = arm.joints, bounds
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


def _chains(robot: Robot) -> dict[str, Int64[np.ndarray, " k"]]:
    """Joints of each arm, from the torso on, by its hand; no joint that moves both hands."""
    torso = robot.joints_above(robot.torso)
    above = {hand: robot.joints_above(hand) for hand in robot.hands}
    own: dict[str, Int64[np.ndarray, " k"]] = {}
    for hand, joints in above.items():
        others = set(torso).union(*(above[h] for h in above if h != hand))
        # Joint 0 is the world; those of a floating base are no arm's.
        index = [j - (2 if robot.floating_base else 1) for j in joints if j not in others]
        if len(index) >= 3:
            own[hand] = np.array(index, dtype=np.int64)
    return own
