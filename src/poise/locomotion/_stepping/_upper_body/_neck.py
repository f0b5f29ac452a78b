"""`NeckMotion`: references of a neck's joints, by a model of it alone on a torso at rest."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise.locomotion._stepping._upper_body._null_space import serve
from poise.locomotion._stepping._upper_body._turning import (
    ARRIVED,
    SPEED_RATIO,
    TurnRate,
    is_stuck,
    stopping,
)
from poise.robots import Robot

_HEADS = ("head", "neck")
"""What frames are called that a head carries."""

_GAIN, _ACCELERATION = 10.0, 15.0
"""How fast a head turns to where it shall look, over the angle [1/s]; and how hard [rad/s^2]."""

_ROLL = 0.1
"""What a head that is held askew counts beside one that looks elsewhere."""

_DAMPING, _BACK_GAIN = 0.05, 1.0
"""Of directions in which a neck hardly turns its head; and how fast joints that change nothing go
back to rest [1/s]."""

_LIMIT_MARGIN, _STOP = 0.02, 10.0
"""How far from their limits joints stop [rad], and how hard [rad/s^2]."""

_JOINT_ACCELERATION = 40.0
"""Largest acceleration of the joints [rad/s^2]."""


class NeckMotion:
    """Moves a model of the neck on a torso that rests, so that the head looks where it shall.

    The head turns as `TurnRate` says, its joints' velocities follow by damped least squares, and
    stop before their limits. A neck of two joints looks where it shall and is not held askew: what
    turns the head about where it looks counts little.

    Args:
        robot: with or without a neck.
        q_rest: configuration at rest, in which the head looks straight ahead [m, rad].
        dt: length of a tick [s].
        speed_max: of the head [rad/s].

    Attributes:
        joints: names of the neck's joints, in the robot's order; none without a neck.
        q: their angles [rad].
        v: their velocities [rad/s].
        a: their accelerations [rad/s^2].
        rotation: of the head against straight ahead, along the torso's axes.
        stuck: whether it is turned as far as it goes.
    """

    def __init__(
        self, robot: Robot, q_rest: Float64[np.ndarray, " nq"], *, dt: float, speed_max: float
    ) -> None:
        index, self._frame = _neck(robot)
        self._dt = dt
        self._model, self._data = robot.model, robot.model.createData()
        self._q, self._torso = q_rest.copy(), robot.frame_id(robot.torso)
        self._places, self._columns = robot.nq - robot.nj + index, robot.nv - robot.nj + index
        self.joints = tuple(robot.joint_names[j] for j in index)
        self._rest = q_rest[self._places]
        self._lower = np.minimum(robot.q_min[index] + _LIMIT_MARGIN, self._rest)
        self._upper = np.maximum(robot.q_max[index] - _LIMIT_MARGIN, self._rest)
        self._speed = SPEED_RATIO * robot.v_max[index]
        self._rate = TurnRate(gain=_GAIN, speed=speed_max, acceleration=_ACCELERATION, dt=dt)
        self._ahead = np.eye(3)
        self.reset()
        self._ahead = self.rotation.T
        # What is compiled is compiled now, not in the first tick.
        if self.joints:
            self.advance(pin.exp3(np.full(3, 0.1)))
        self.reset()

    def reset(self) -> None:
        """The head looks straight ahead."""
        n = len(self.joints)
        self.q, self.v, self.a = self._rest.copy(), np.zeros(n), np.zeros(n)
        self.stuck = False
        self._update()

    def advance(self, gaze: Float64[np.ndarray, "3 3"]) -> None:
        """One tick.

        Args:
            gaze: how the head shall be turned against straight ahead, along the torso's axes.
        """
        way = self._rate.towards(gaze, self.rotation)
        if self._is_at_rest(way):
            return
        turning = self._jacobian()
        asked = self._rate.change(way, turning @ self.v)
        # Along the axes of the head: what turns it about where it looks comes first.
        weights = np.array([_ROLL, 1.0, 1.0])[:, None] * self.rotation.T
        down = stopping(self.q - self._lower, _STOP, self._dt)
        up = stopping(self._upper - self.q, _STOP, self._dt)
        bounds = -np.minimum(self._speed, down), np.minimum(self._speed, up)
        n = len(self.q)
        v = serve(
            np.zeros((0, n)),
            weights @ turning,
            weights @ asked,
            np.clip(_BACK_GAIN * (self._rest - self.q), *bounds),
            bounds,
            (np.zeros((0, n)), np.zeros(0)),
            _DAMPING,
        )
        aside = np.diag([0.0, 1.0, 1.0]) @ self.rotation.T
        self.stuck = is_stuck(aside @ way, aside @ asked, aside @ turning @ v)
        most = self._dt * _JOINT_ACCELERATION
        v = np.clip(v, self.v - most, self.v + most)
        self.q, self.v, self.a = self.q + self._dt * v, v, (v - self.v) / self._dt
        self._update()

    def _is_at_rest(self, way: Float64[np.ndarray, "3"]) -> bool:
        """Whether it looks straight ahead and shall; then joints are at rest to the last bit."""
        off = max(float(np.abs(self.q - self._rest).max()), float(np.abs(self.v).max()))
        if off > ARRIVED or float(np.abs(way).max()) > ARRIVED * _GAIN:
            return False
        self.q, self.v, self.a = self._rest.copy(), np.zeros_like(self.v), np.zeros_like(self.a)
        return True

    def _update(self) -> None:
        self._q[self._places] = self.q
        pin.computeJointJacobians(self._model, self._data, self._q)
        torso, head = (
            pin.updateFramePlacement(self._model, self._data, f) for f in (self._torso, self._frame)
        )
        self._into_torso = torso.rotation.T
        self.rotation = self._into_torso @ head.rotation @ self._ahead

    def _jacobian(self) -> Float64[np.ndarray, "3 n"]:
        """Of the head's angular velocity along the torso's axes."""
        aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        J = pin.getFrameJacobian(self._model, self._data, self._frame, aligned)
        return self._into_torso @ J[3:, self._columns]


def _neck(robot: Robot) -> tuple[Int64[np.ndarray, " n"], int]:
    """Joints between the torso and its head, and a frame of the head; the torso's without one.

    The head is what frames of that name are on that most joints beyond the torso move, none of
    which moves a hand or a sole.
    """
    torso = set(robot.joints_above(robot.torso))
    others = torso.union(*(robot.joints_above(name) for name in (*robot.hands, *robot.soles)))
    found, best = set[int](), robot.frame_id(robot.torso)
    for frame, each in enumerate(robot.model.frames):
        if any(word in each.name.lower() for word in _HEADS):
            above = set(robot.model.supports[each.parentJoint].tolist()) - {0}
            own = above - others
            on_torso = torso <= above
            if on_torso and len(own) > len(found):
                found, best = own, frame
    # Joint 0 is the world; those of a floating base are no neck's.
    first = 2 if robot.floating_base else 1
    return np.array(sorted(j - first for j in found), dtype=np.int64), best
