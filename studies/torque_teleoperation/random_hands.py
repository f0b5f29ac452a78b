"""`RandomHands`: an operator's hands that go anywhere. `arm_length`: how far that is."""

import numpy as np

from poise.dynamics import Dynamics, RobotState
from poise.locomotion import HandLeader, HandStatus, TrackedPose
from poise.robots import Robot

FASTEST = 1.0
"""Of the devices [m/s]."""

BEGINS = 1.0
"""When the hands begin [s]."""


class RandomHands:
    """An operator who sends both hands to places at random, and lets go now and then.

    Each device is moved straight at the place that its hand shall go to, at a speed drawn for each
    place; at the edge of reach another place is drawn. Every few seconds the clutch is open for
    0.3 s, and the device is meanwhile brought somewhere else.
    """

    def __init__(self, leader: HandLeader, size: float, dt: float, seed: int) -> None:
        self._leader, self._size, self._dt = leader, size, dt
        self._rng = np.random.default_rng((seed, 11))
        self._middle = [place.copy() for place in leader.places]
        count = len(self._middle)
        self._devices = [np.zeros(3) for _ in range(count)]
        self._goals = [place.copy() for place in self._middle]
        self._speeds, self._until = [FASTEST] * count, [0.0] * count
        self._open_at, self._stuck = [BEGINS] * count, [0.0] * count

    def hands(self, time: float) -> tuple[TrackedPose | None, TrackedPose | None]:
        """What both devices say; drawn tick by tick, so ask once a tick."""
        left, right = (self._hand(hand, time) for hand in (0, 1))
        return left, right

    def _hand(self, hand: int, time: float) -> TrackedPose:
        if time >= self._open_at[hand] + 0.3:
            self._open_at[hand] = time + float(self._rng.uniform(3.0, 8.0))
            self._devices[hand] = self._rng.uniform(-1.0, 1.0, 3)
        if time < BEGINS or time >= self._open_at[hand]:
            return TrackedPose.of(self._devices[hand], clutch=False)
        edge = self._leader.status[hand] is HandStatus.REACH
        self._stuck[hand] = self._stuck[hand] + self._dt if edge else 0.0
        way = self._goals[hand] - self._leader.places[hand]
        far = float(np.linalg.norm(way))
        if far < 0.02 or self._stuck[hand] > 0.3 or time >= self._until[hand]:
            self._draw(hand, time)
        step = min(1.0, self._dt * self._speeds[hand] / max(far, 1e-9))
        self._devices[hand] = self._devices[hand] + step * way
        return TrackedPose.of(self._devices[hand], clutch=True)

    def _draw(self, hand: int, time: float) -> None:
        """A place in a box that is larger than what the hand reaches."""
        box = self._size * self._rng.uniform((-0.6, -1.0, -0.5), (1.0, 1.0, 1.4))
        self._goals[hand] = self._middle[hand] + box
        self._speeds[hand] = float(self._rng.uniform(0.3, 1.0)) * FASTEST
        self._until[hand], self._stuck[hand] = time + 3.0, 0.0


def arm_length(robot: Robot) -> float:
    """Length of an arm, from a robot's height [m]: arms are long as legs are, about."""
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    return 0.6 * float(dynamics.com[2])
