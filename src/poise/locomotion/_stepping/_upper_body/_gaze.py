"""`GazeLeader`: the robot looks where the operator looks."""

import math

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.locomotion._stepping._operator import OperatorGuard, RateLimiter
from poise.locomotion._stepping._stance import LEVEL, TORSO_MOST
from poise.locomotion._stepping._upper_body._approach import Approach
from poise.locomotion._stepping._upper_body._chains import neck_chain
from poise.locomotion._stepping._upper_body._hands import HandStatus
from poise.locomotion._stepping._upper_body._limb_feedback import (
    BY_SERVOS,
    NECK_BY_TORQUES,
    LimbFeedback,
)
from poise.locomotion._stepping._upper_body._limb_motion import Goal, LimbMotion, Motions
from poise.robots import Robot
from poise.stack import JointTask

_GAIN, _ACCELERATION, _JOINT_ACCELERATION = 10.0, 15.0, 40.0
"""Gain of a head's turn towards its gaze [1/s]; largest accelerations of head and joints
[rad/s^2]."""

_LIMIT_MARGIN = 0.02
"""Distance of joints from their limits [rad]."""


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
        q_rest = robot.q_home if q_rest is None else q_rest
        turn = Approach(gain=_GAIN, speed=speed_max, acceleration=_ACCELERATION)
        home = Approach(gain=_GAIN, speed=speed_max, acceleration=_JOINT_ACCELERATION)
        motions = Motions(move=None, turn=turn, home=home, margin=_LIMIT_MARGIN)
        self._neck = LimbMotion(robot, neck_chain(robot), q_rest, motions, dt=dt)
        self.task: JointTask | None = None
        if self._neck.joints:
            self.task = JointTask(self._neck.joints, weight=weight, name="neck")
            self.task.bind(robot)
        firmness = BY_SERVOS if servos else NECK_BY_TORQUES
        self._feedback = LimbFeedback(self.task, firmness, dt)
        self._turns_torso = turns_torso and self.task is None
        self.reset()

    def reset(self) -> None:
        """Forgets the past: the head looks straight ahead."""
        self._neck.reset()
        self._feedback.reset()
        # No burst: the head turns at its own speed, whoever leads it.
        self._limiter = RateLimiter(self._dt * self._speed, self._dt * self._speed)
        self.gaze: Float64[np.ndarray, "3 3"] = LEVEL
        can = self.task is not None or self._turns_torso
        self.status: HandStatus | None = HandStatus.REST if can else None
        self._set_target()

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
        if operator.head is not None:
            self.status = HandStatus.LED
        elif operator.rest:
            self.status = HandStatus.REST
        elif self.status is not HandStatus.REST:
            self.status = HandStatus.HELD
        goal = LEVEL if self.status is HandStatus.REST else operator.head
        if goal is not None:
            self.gaze, _ = self._limiter.turn(self.gaze, goal)
        if self.task is not None:
            rests = self.status is HandStatus.REST
            ahead = self._neck.rest_rotations[0]
            self._neck.advance([None if rests else Goal(rotation=self.gaze @ ahead)])
            moving = bool(self._neck.v.any())
            self._feedback.stiffen(led=moving or self.status is not HandStatus.REST)
            self._set_target()
        if self.status is HandStatus.LED and self._at_edge():
            self.status = HandStatus.REACH

    def _at_edge(self) -> bool:
        if self.task is not None:
            return self._neck.stuck[0]
        _, pitch, yaw = self.torso
        return bool(abs(pitch) > TORSO_MOST[1] or abs(yaw) > TORSO_MOST[2])

    def _set_target(self) -> None:
        if self.task is not None:
            self.task.set_target(self._neck.q, self._neck.v, self._neck.a)
