"""`HandLeader` and `GazeLeader`: arms and neck that follow the operator's hands and head."""

import math
from collections import Counter
from enum import Enum

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise._checks import checked_number
from poise.dynamics import RobotState, rotation_vector
from poise.locomotion._stepping._feet import FARTHEST
from poise.locomotion._stepping._footing import LEVEL, TORSO_MOST
from poise.locomotion._stepping._guard import OperatorGuard, RateLimiter, Tracker
from poise.locomotion._stepping._limbs import TURN_ACCELERATION, Approach, Goal, Limb, LimbTracking
from poise.robots import Robot


class HandStatus(Enum):
    """State of a hand, or of the head."""

    REST = "at rest, or on its way there"
    HELD = "stays where it was let go"
    LED = "follows its device"
    REACH = "at the edge of its reach: it comes no further"
    TURNED = "turned as far as it goes: its place follows"


def _next_status(status: HandStatus, *, led: bool, rest: bool) -> HandStatus:
    """Return the status of a part in the next tick."""
    if led:
        return HandStatus.LED
    return HandStatus.REST if rest or status is HandStatus.REST else HandStatus.HELD


_TURN_EDGE = 1.0
"""A hand's orientation is no further ahead than this [rad]. So far a device may turn where the
hand cannot follow, and turned back both match again, as an operator expects. Much
more, and there are two ways round."""


class HandLeader:
    """Move the arms by an operator's hands, or return them to rest.

    A hand follows the motion of its device while the clutch is closed, `scale` times, along the
    axes of the torso: hands move with the body as it walks, and where it leans no arm is thrown
    about. A turn of the device meanwhile, where it gives that, turns the hand, not scaled. A hand
    that was ever turned keeps its orientation in the torso until it rests; another is turned as its
    arm has it. `task` has the arms' joints follow a model of the arms (`LimbTracking`), smooth and
    within reach. It belongs into a level below the balance.

    Args:
        robot: with arms or without.
        dt: length of a tick [s].
        q_rest: configuration of the arms at rest; the robot's home when None.
        weight: of the task in its level.
        scale: motion of a hand over that of its device.
        speed_max: of a hand [m/s].
        acceleration_max: of a hand [m/s^2].
        turn_speed_max: of a hand [rad/s].
        servos: whether servos of commanded velocities move the arms; else torques do.

    Raises:
        ConfigurationError: a number that is not positive.

    Attributes:
        arms: model of the arms.
        task: of the arms' joints; None without arms.
        names: of the hands.
        status: state of each hand.
        places: commanded, in the torso's frame [m].
        rotations: commanded, torso_R_hand; None for a hand that is not turned.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        dt: float,
        q_rest: Float64[np.ndarray, " nq"] | None = None,
        weight: float = 1.0,
        scale: float = 1.0,
        speed_max: float = 1.5,
        acceleration_max: float = 5.0,
        turn_speed_max: float = 3.0,
        servos: bool = False,
    ) -> None:
        numbers = {
            "dt of the hands [s]": dt,
            "scale of the hands": scale,
            "speed_max of the hands [m/s]": speed_max,
            "acceleration_max of the hands [m/s^2]": acceleration_max,
            "turn_speed_max of the hands [rad/s]": turn_speed_max,
        }
        for what, number in numbers.items():
            checked_number(number, what, above=0.0)
        self._scale = scale
        self.arms = LimbTracking(
            robot,
            _arm_chains(robot),
            q_rest,
            move=Approach(speed_max, acceleration_max),
            turn=Approach(turn_speed_max, TURN_ACCELERATION),
            dt=dt,
            weight=weight,
            name="arms",
            servos=servos,
        )
        self.names, self.task = self.arms.names, self.arms.task
        # Of a third hand, which no operator has.
        self._no_hand = Tracker(dt)
        self._sides = [
            _side(robot, name, arm.place)
            for name, arm in zip(self.names, self.arms.limbs, strict=True)
        ]
        self.reset()

    def reset(self) -> None:
        """Restart with arms at rest."""
        self.arms.reset()
        self.places = [arm.place for arm in self.arms.limbs]
        self.rotations: list[Float64[np.ndarray, "3 3"] | None] = [None for _ in self.names]
        self.status = [HandStatus.REST for _ in self.names]

    def lead(self, operator: OperatorGuard, state: RobotState) -> None:
        """Set the targets of the arms for the next tick.

        Args:
            operator: the guard that has checked this tick's sample.
            state: as it is measured or estimated.
        """
        left, right = operator.hands
        if self.arms.rests and not (left.engaged or right.engaged):
            return
        trackers = [(left, right, self._no_hand)[min(side, 2)] for side in self._sides]
        goals = [
            self._goal(hand, tracker, rest=operator.rest, time=state.time)
            for hand, tracker in enumerate(trackers)
        ]
        self.arms.follow(goals, state.q)
        for hand, arm in enumerate(self.arms.limbs):
            self._stop_at_edge(hand, arm)

    def _goal(self, hand: int, tracker: Tracker, *, rest: bool, time: float) -> Goal | None:
        self._turn(hand, tracker)
        self.status[hand] = _next_status(self.status[hand], led=tracker.engaged, rest=rest)
        if tracker.engaged:
            self.places[hand] = self.places[hand] + self._scale * tracker.step
        if self.status[hand] is HandStatus.REST:
            return None
        rate = tracker.velocity(time)
        rate = None if rate is None else self._scale * np.array(rate)
        return Goal(self.places[hand], self.rotations[hand], rate)

    def targets(
        self, position: Float64[np.ndarray, "3"], rotation: Float64[np.ndarray, "3 3"]
    ) -> tuple[Float64[np.ndarray, "3"], ...]:
        """Return the commanded place of each hand in the world [m].

        Args:
            position: of the torso [m].
            rotation: world_R_torso.
        """
        return tuple(position + rotation.dot(place) for place in self.places)

    def orientations(
        self, rotation: Float64[np.ndarray, "3 3"]
    ) -> tuple[Float64[np.ndarray, "3 3"] | None, ...]:
        """Return the commanded orientation of each hand, world_R_hand; None without one.

        Args:
            rotation: world_R_torso.
        """
        return tuple(None if turned is None else rotation.dot(turned) for turned in self.rotations)

    def _turn(self, hand: int, tracker: Tracker) -> None:
        """Turn the commanded orientation of a hand by the motion of its device."""
        turned = self.rotations[hand]
        if turned is None:
            if tracker.turns:
                self.rotations[hand] = self.arms.limbs[hand].rotation
            return
        if tracker.turn.any():
            turned = pin.exp3(tracker.turn) @ turned
        here = self.arms.limbs[hand].rotation
        way = rotation_vector(turned, here)
        far = math.hypot(*way)
        self.rotations[hand] = (
            pin.exp3(way * (_TURN_EDGE / far)) @ here if far > _TURN_EDGE else turned
        )

    def _stop_at_edge(self, hand: int, arm: Limb) -> None:
        """Report a hand that is stuck, and keep its target near."""
        if self.status[hand] is HandStatus.REST:
            self.places[hand], self.rotations[hand] = arm.place, None
        elif arm.blocked:
            if self.status[hand] is HandStatus.LED:
                self.status[hand] = HandStatus.REACH
            way = self.places[hand] - arm.place
            self.places[hand] = arm.place + way * min(1.0, FARTHEST / max(math.hypot(*way), 1e-9))
        elif arm.stuck and self.status[hand] is HandStatus.LED:
            self.status[hand] = HandStatus.TURNED


def _arm_chains(robot: Robot) -> dict[str, Int64[np.ndarray, " k"]]:
    """Return the joints of each arm beyond the torso, by its hand; none that moves two hands."""
    torso = set(robot.joints_above(robot.torso))
    above = {hand: robot.joints_above(hand) for hand in robot.hands}
    hands = Counter(joint for joints in above.values() for joint in joints)
    first = robot.model.njoints - robot.nj
    chains = {
        hand: np.array([j - first for j in joints if hands[j] == 1 and j not in torso], np.int64)
        for hand, joints in above.items()
    }
    return {hand: joints for hand, joints in chains.items() if len(joints) >= 3}


def _side(robot: Robot, name: str, place: Float64[np.ndarray, "3"]) -> int:
    """Return the operator's hand for a hand: 0, the left one, for the robot's first."""
    # An only hand follows the one on its side.
    if len(robot.hands) == 1:
        return 0 if place[1] > 0.0 else 1
    return robot.hands.index(name)


class GazeLeader:
    """Turn the head with the operator's head, or return it to straight ahead.

    Args:
        robot: with a neck or without.
        dt: length of a tick [s].
        q_rest: configuration in which the head looks straight ahead; the robot's home when None.
        weight: of the task in its level, below the balance.
        speed_max: of the head [rad/s].
        turns_torso: the torso is turned by `torso` where there is no neck.
        servos: servos of commanded velocities move the neck; else torques do.

    Attributes:
        neck: model of the neck.
        task: of the neck's joints; None without a neck.
        status: of the head; None where nothing can turn it.
        gaze: commanded turn against straight ahead, along the torso's axes.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        dt: float,
        q_rest: Float64[np.ndarray, " nq"] | None = None,
        weight: float = 1.0,
        speed_max: float = 2.5,
        turns_torso: bool = False,
        servos: bool = False,
    ) -> None:
        self._step = dt * speed_max
        self.neck = LimbTracking(
            robot,
            _neck_chain(robot),
            q_rest,
            move=None,
            turn=Approach(speed_max, TURN_ACCELERATION),
            dt=dt,
            weight=weight,
            name="neck",
            servos=servos,
        )
        self.task = self.neck.task
        self._turns_torso = turns_torso and self.task is None
        self.reset()

    def reset(self) -> None:
        """Restart with the head straight ahead."""
        self.neck.reset()
        # No jump: the speed of the head is limited, whatever the source of the command.
        self._limiter = RateLimiter(self._step, self._step)
        self.gaze: Float64[np.ndarray, "3 3"] = LEVEL
        can = self.task is not None or self._turns_torso
        self.status: HandStatus | None = HandStatus.REST if can else None

    @property
    def torso(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw by which the torso shall look there; zero where a neck does [rad]."""
        if self.gaze is LEVEL or not self._turns_torso:
            return (0.0, 0.0, 0.0)
        x, y, z = self.gaze[:, 0].tolist()
        return (0.0, math.atan2(-z, math.hypot(x, y)), math.atan2(y, x))

    def lead(self, operator: OperatorGuard) -> None:
        """Set the target of the neck for the next tick, from a checked sample."""
        if self.status is None:
            return
        led = operator.head is not None
        self.status = _next_status(self.status, led=led, rest=operator.rest)
        rests = self.status is HandStatus.REST
        goal = LEVEL if rests else operator.head
        if goal is not None:
            self.gaze, _ = self._limiter.turn(self.gaze, goal)
        for neck in self.neck.limbs:
            goal = None if rests else Goal(rotation=self.gaze @ neck.rest_rotation)
            self.neck.follow([goal])
        if led and self._at_edge():
            self.status = HandStatus.REACH

    def _at_edge(self) -> bool:
        if self.task is not None:
            return self.neck.limbs[0].stuck
        _, pitch, yaw = self.torso
        return bool(abs(pitch) > TORSO_MOST[1] or abs(yaw) > TORSO_MOST[2])


def _neck_chain(robot: Robot) -> dict[str, Int64[np.ndarray, " k"]]:
    """Return the joints between the torso and its head, by a frame of it; empty without a neck."""
    # The head is what frames of that name are on that most joints beyond the torso move, none of
    # which moves a hand or a sole.
    torso = set(robot.joints_above(robot.torso))
    others = torso.union(*(robot.joints_above(name) for name in (*robot.hands, *robot.soles)))
    found, best = set[int](), ""
    for each in robot.model.frames:
        if any(word in each.name.lower() for word in ("head", "neck")):
            above = set(robot.model.supports[each.parentJoint].tolist()) - {0}
            own = above - others
            if torso <= above and len(own) > len(found):
                found, best = own, each.name
    first = robot.model.njoints - robot.nj
    return {best: np.array(sorted(found), np.int64) - first} if found else {}
