"""`GazeLeader`: the robot looks where the operator looks."""

import math

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import checked_number
from poise.locomotion._stepping._operator import OperatorGuard, RateLimiter
from poise.locomotion._stepping._stance import LEVEL, TORSO_MOST
from poise.locomotion._stepping._upper_body._hands import HandStatus, next_status
from poise.locomotion._stepping._upper_body._limb_motion import (
    TURN_GAIN,
    Approach,
    Goal,
    LedLimbs,
)
from poise.robots import Robot

_ACCELERATION, _JOINT_ACCELERATION = 15.0, 40.0
"""Largest accelerations of head and joints [rad/s^2]."""

_LIMIT_MARGIN = 0.02
"""Distance of joints from their limits [rad]."""

_BY_TORQUES = (100.0, 100.0, 0.0)
"""A head carries nothing."""

_HEADS = ("head", "neck")
"""Names of frames that a head carries."""


class GazeLeader:
    """Turns the head as the operator turns theirs, or brings it back to look straight ahead.

    The gaze is along the axes of the torso, and ahead is where the head looks at rest. Its task has
    the neck's joints follow a model of the neck (`LimbMotion`), smooth and within reach. Like that
    of the arms it belongs into a level below the balance. Where there is no neck the torso may be
    turned instead, by whoever leads that: by `torso`, as far as a torso is turned by command.

    Args:
        robot: with a neck, which is what joints there are between the torso and a frame of a head,
            or without.
        dt: length of a tick [s].
        q_rest: configuration in which the head looks straight ahead; the robot's home when None.
        weight: of the task in its level.
        speed_max: of the head [rad/s].
        turns_torso: whether somebody turns the torso by `torso` where there is no neck.
        servos: whether servos of commanded velocities move the neck; else torques do.

    Raises:
        ConfigurationError: a number that is not positive.

    Attributes:
        task: of the neck's joints; None without a neck.
        status: what the head does; None where nothing can turn it.
        gaze: how it is led to be turned against straight ahead, along the torso's axes.
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
        self._dt = checked_number(dt, "dt of the gaze [s]", above=0.0)
        self._speed = checked_number(speed_max, "speed_max of the gaze [rad/s]", above=0.0)
        self._neck = LedLimbs(
            robot,
            _neck_chain(robot),
            q_rest,
            move=None,
            turn=Approach(gain=TURN_GAIN, speed=speed_max, acceleration=_ACCELERATION),
            home=Approach(gain=TURN_GAIN, speed=speed_max, acceleration=_JOINT_ACCELERATION),
            margin=_LIMIT_MARGIN,
            by_torques=_BY_TORQUES,
            dt=dt,
            weight=weight,
            name="neck",
            servos=servos,
        )
        self.task = self._neck.task
        self._turns_torso = turns_torso and self.task is None
        self.reset()

    def reset(self) -> None:
        """Forgets the past: the head looks straight ahead."""
        self._neck.reset()
        # No burst: the head turns at its own speed, whoever leads it.
        self._limiter = RateLimiter(self._dt * self._speed, self._dt * self._speed)
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
        """Set what the neck does in the tick that begins.

        Args:
            operator: the guard that has checked this tick's sample.
        """
        if self.status is None:
            return
        led = operator.head is not None
        self.status = next_status(self.status, led=led, rest=operator.rest)
        rests = self.status is HandStatus.REST
        goal = LEVEL if rests else operator.head
        if goal is not None:
            self.gaze, _ = self._limiter.turn(self.gaze, goal)
        for neck in self._neck.limbs:
            goal = None if rests else Goal(rotation=self.gaze @ neck.rest_rotation)
            self._neck.follow([goal])
        if led and self._at_edge():
            self.status = HandStatus.REACH

    def _at_edge(self) -> bool:
        if self.task is not None:
            return self._neck.limbs[0].stuck
        _, pitch, yaw = self.torso
        return bool(abs(pitch) > TORSO_MOST[1] or abs(yaw) > TORSO_MOST[2])


def _neck_chain(robot: Robot) -> dict[str, Int64[np.ndarray, " k"]]:
    """Return the joints between the torso and its head, by a frame of it; empty without a neck.

    The head is what frames of that name are on that most joints beyond the torso move, none of
    which moves a hand or a sole.
    """
    torso = set(robot.joints_above(robot.torso))
    others = torso.union(*(robot.joints_above(name) for name in (*robot.hands, *robot.soles)))
    found, best = set[int](), ""
    for each in robot.model.frames:
        if any(word in each.name.lower() for word in _HEADS):
            above = set(robot.model.supports[each.parentJoint].tolist()) - {0}
            own = above - others
            if torso <= above and len(own) > len(found):
                found, best = own, each.name
    first = robot.model.njoints - robot.nj
    return {best: np.array(sorted(found), np.int64) - first} if found else {}
