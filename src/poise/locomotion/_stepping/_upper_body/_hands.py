"""`HandLeader`: arms that follow the operator's hands, whatever leads the feet.

`HandStatus`: what a hand does, or the gaze.
"""

import math
from collections import Counter
from enum import Enum

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise._checks import checked_number
from poise.dynamics import RobotState, rotation_vector
from poise.locomotion._stepping._operator import OperatorGuard, Tracker
from poise.locomotion._stepping._upper_body._limb_motion import (
    TURN_GAIN,
    Approach,
    Goal,
    LedLimbs,
    Limb,
)
from poise.robots import Robot


class HandStatus(Enum):
    """What a hand does, or the head."""

    REST = "at rest, or on its way there"
    HELD = "stays where it was let go"
    LED = "follows its device"
    REACH = "at the edge of its reach: it comes no further"
    TURNED = "turned as far as it goes: its place follows"


def next_status(status: HandStatus, *, led: bool, rest: bool) -> HandStatus:
    """Return the status after one, of a part that is led, or that is to rest."""
    if led:
        return HandStatus.LED
    return HandStatus.REST if rest or status is HandStatus.REST else HandStatus.HELD


_EDGE = 0.03
"""At the edge of its reach a hand's place is no further ahead than this [m]: when the device comes
back, so does the hand."""

_TURN_EDGE = 1.0
"""And it is led to be turned no further ahead than this [rad]. So far a device may turn where the
hand cannot follow, and turned back both face alike again, as whoever turns a wrist expects. Much
more, and there are two ways round."""


_UNLED = Tracker(1.0)
"""Of a third hand, which no operator has."""

_GAIN, _TURN_ACCELERATION = 15.0, 20.0
"""Gain of a hand's way [1/s]; largest angular acceleration [rad/s^2]."""

_HOME = Approach(gain=3.0, speed=1.2, acceleration=50.0)
"""Of the joints back to rest."""

_LIMIT_MARGIN = 0.05
"""Distance of joints from their limits [rad]."""

_BY_TORQUES = (25.0, 150.0, 150.0)
"""At rest as stiff as the posture; what a hand carries, and nobody knows of, is learned."""


class HandLeader:
    """Leads the arms by an operator's hands, or brings them back to rest.

    What counts is the motion of a device while its clutch is closed, `scale` times, along the axes
    of the torso: hands go along with a body that walks, and where it leans no arm is thrown about.
    How a device is turned meanwhile, which gives that, turns its hand, not scaled. A hand that was
    ever turned keeps its orientation in the torso until it rests; another is turned as its arm has
    it. `task` has the arms' joints follow a model of the arms (`LimbMotion`), smooth and within
    reach. It belongs into a level below the balance.

    Args:
        robot: with arms or without, which is led by nothing then.
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
        task: of the arms' joints; None without arms.
        names: of the hands that are led.
        status: what each hand does.
        places: where each hand is led to, in the torso's frame [m].
        rotations: how each is led to be turned, torso_R_hand; None for one that is not.
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
        checked_number(dt, "dt of the hands [s]", above=0.0)
        self._scale = checked_number(scale, "scale of the hands", above=0.0)
        checked_number(speed_max, "speed_max of the hands [m/s]", above=0.0)
        checked_number(acceleration_max, "acceleration_max of the hands [m/s^2]", above=0.0)
        checked_number(turn_speed_max, "turn_speed_max of the hands [rad/s]", above=0.0)
        self._arms = LedLimbs(
            robot,
            _arm_chains(robot),
            q_rest,
            move=Approach(gain=_GAIN, speed=speed_max, acceleration=acceleration_max),
            turn=Approach(gain=TURN_GAIN, speed=turn_speed_max, acceleration=_TURN_ACCELERATION),
            home=_HOME,
            margin=_LIMIT_MARGIN,
            by_torques=_BY_TORQUES,
            dt=dt,
            weight=weight,
            name="arms",
            servos=servos,
        )
        self.names, self.task = self._arms.names, self._arms.task
        self._sides = [
            _side(robot, name, arm.place)
            for name, arm in zip(self.names, self._arms.limbs, strict=True)
        ]
        self.reset()

    def reset(self) -> None:
        """Forgets the past: the arms are at rest."""
        self._arms.reset()
        self.places = [arm.place for arm in self._arms.limbs]
        self.rotations: list[Float64[np.ndarray, "3 3"] | None] = [None for _ in self.names]
        self.status = [HandStatus.REST for _ in self.names]

    def lead(self, operator: OperatorGuard, state: RobotState) -> None:
        """Set what the arms do in the tick that begins.

        Args:
            operator: the guard that has checked this tick's sample.
            state: as it is measured or estimated.
        """
        left, right = operator.hands
        if self._arms.rests and not (left.engaged or right.engaged):
            return
        trackers = [(left, right, _UNLED)[min(side, 2)] for side in self._sides]
        goals = [
            self._goal(hand, tracker, rest=operator.rest, time=state.time)
            for hand, tracker in enumerate(trackers)
        ]
        self._arms.follow(goals, state.q)
        for hand, arm in enumerate(self._arms.limbs):
            self._stop_at_edge(hand, arm)

    def _goal(self, hand: int, tracker: Tracker, *, rest: bool, time: float) -> Goal | None:
        self._turn(hand, tracker)
        self.status[hand] = next_status(self.status[hand], led=tracker.engaged, rest=rest)
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
        """Where each hand is led to in the world [m].

        Args:
            position: of the torso [m].
            rotation: world_R_torso.
        """
        return tuple(position + rotation.dot(place) for place in self.places)

    def orientations(
        self, rotation: Float64[np.ndarray, "3 3"]
    ) -> tuple[Float64[np.ndarray, "3 3"] | None, ...]:
        """How each hand is led to be turned, world_R_hand; None for one that is not.

        Args:
            rotation: world_R_torso.
        """
        return tuple(None if turned is None else rotation.dot(turned) for turned in self.rotations)

    def _turn(self, hand: int, tracker: Tracker) -> None:
        """Where a hand is led to be turned: by how its device turned, from how it is itself."""
        turned = self.rotations[hand]
        if turned is None:
            if tracker.turns:
                self.rotations[hand] = self._arms.limbs[hand].rotation
            return
        if tracker.turn.any():
            turned = pin.exp3(tracker.turn) @ turned
        here = self._arms.limbs[hand].rotation
        way = rotation_vector(turned, here)
        far = math.hypot(*way)
        self.rotations[hand] = (
            pin.exp3(way * (_TURN_EDGE / far)) @ here if far > _TURN_EDGE else turned
        )

    def _stop_at_edge(self, hand: int, arm: Limb) -> None:
        """A hand that comes no further says so, and its place stays near."""
        if self.status[hand] is HandStatus.REST:
            self.places[hand], self.rotations[hand] = arm.place, None
        elif arm.blocked:
            if self.status[hand] is HandStatus.LED:
                self.status[hand] = HandStatus.REACH
            way = self.places[hand] - arm.place
            self.places[hand] = arm.place + way * min(1.0, _EDGE / max(math.hypot(*way), 1e-9))
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
    """Which of the operator's hands leads a hand: the left one is 0, and the robot's first.

    A hand that is the only one is led by that on its side.
    """
    if len(robot.hands) == 1:
        return 0 if place[1] > 0.0 else 1
    return robot.hands.index(name)
