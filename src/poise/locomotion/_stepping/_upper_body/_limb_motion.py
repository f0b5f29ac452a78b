"""`LimbMotion`: references of limbs' joints, by inverse kinematics on a torso at rest."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise.control import DifferentialIK
from poise.dynamics import Dynamics, RobotState, rotation_vector
from poise.locomotion._stepping._upper_body._approach import Approach
from poise.robots import Robot
from poise.stack import (
    JointLimit,
    JointTask,
    RelativeFrameTask,
    SelfCollisionLimit,
    Stack,
    SurfaceContact,
    Task,
)

_ARRIVED = 1e-3
"""Joints no farther from rest than this, and no faster, are at rest [rad, rad/s]."""

_BACK_GAIN = 1.0
"""Rate at which the freedom that a frame leaves its joints goes back to rest [1/s]."""

_SPEED_RATIO, _LIMIT_TIME = 0.7, 0.2
"""Part of the velocity limits that is used; time in which joints may at most reach their limits,
which brakes them from 10 rad/s by the 50 rad/s^2 that arms have [s]."""

_MARGIN = 0.03
"""Distance between links [m]: more than the stack's own limit keeps, so that limbs come to rest
here and lean on no limit there."""

_SHORT, _SLOW, _HARDLY = 0.05, 0.1, 0.15
"""Speeds below which a frame that gets no nearer is where it shall be [m/s, rad/s], and the part of
the requested velocity below which it gets no nearer."""

_POSTURE, _FREE = 1e-2, 1e-4
"""Weights beside an orientation that counts: of the joints' way to rest, which costs it a
ten-thousandth, and of an orientation that does not count."""

_OUT, _IN = 0.2, 1.0
"""Times in which turning fades out where a frame does not get to its place, and in again [s]."""


class Goal(NamedTuple):
    """Pose of a frame in the torso, each part None for any, and the velocity of its place."""

    place: Float64[np.ndarray, "3"] | None = None
    rotation: Float64[np.ndarray, "3 3"] | None = None
    rate: Float64[np.ndarray, "3"] | None = None


@dataclass(frozen=True, kw_only=True)
class Motions:
    """Bounds of places, orientations and joints, and the distance of joints from limits [rad]."""

    move: Approach | None
    turn: Approach
    home: Approach
    margin: float


class _Limb:
    """A chain of joints from the torso to a frame, and the velocities that its tasks request."""

    def __init__(
        self,
        name: str,
        joints: Int64[np.ndarray, " k"],
        own: Int64[np.ndarray, " k"],
        motions: Motions,
        dt: float,
        dynamics: Dynamics,
    ) -> None:
        robot = dynamics.robot
        self.own, self._motions, self._dt, self._dynamics = own, motions, dt, dynamics
        self._torso, self._frame = robot.frame_id(robot.torso), robot.frame_id(name)
        self._columns = joints + robot.base_dofs
        self.place_task = RelativeFrameTask(name, robot.torso, "position")
        self.turn_task = RelativeFrameTask(name, robot.torso, "orientation")
        self.reset()
        self.update()
        self._ahead = self.rotation[0].copy()

    def reset(self) -> None:
        """Forget the past: nothing moves."""
        self.blocked = self.stuck = False
        self._share, self._asked = 1.0, np.zeros((2, 3))

    def update(self) -> None:
        """Take pose and Jacobian from the model's state."""
        torso, frame = (self._dynamics.frame(f) for f in (self._torso, self._frame))
        turn = torso.rotation.T
        self.place = turn @ (frame.position - torso.position)
        self.rotation = turn @ frame.rotation
        own = frame.jacobian[:, self._columns]
        self._jacobian = np.concatenate((turn @ own[:3], turn @ own[3:]))

    def go(self, v: Float64[np.ndarray, " n"]) -> None:
        """Request the frame velocity of given joint velocities."""
        self.reset()
        self._asked = (self._jacobian @ v[self.own]).reshape(2, 3)
        self.place_task.overwrite_target()[0] = self.place
        self.turn_task.overwrite_target()[1:4] = self.rotation
        self._ask(turned=True)

    def follow(self, goal: Goal) -> None:
        """Request velocities towards a goal."""
        motions, asked = self._motions, self._asked
        if motions.move is not None and goal.place is not None:
            way = goal.place - self.place
            wanted = motions.move.velocity(way, goal.rate)
            asked[0] = motions.move.step(wanted, asked[0], self._dt)
            self.place_task.overwrite_target()[0] = goal.place
        asked[1] = 0.0 if goal.rotation is None else asked[1]
        if goal.rotation is not None:
            way = rotation_vector(goal.rotation, self.rotation)
            if len(self.own) < 3:
                # Two joints have the head look there, and leave how it is held askew.
                looks = self.rotation @ self._ahead
                way -= looks * (looks @ way)
            wanted = motions.turn.velocity(way)
            asked[1] = motions.turn.step(wanted, asked[1], self._dt)
            self.turn_task.overwrite_target()[1:4] = goal.rotation
        self._ask(turned=goal.rotation is not None)

    def _ask(self, *, turned: bool) -> None:
        self.place_task.set_velocity(self._asked[0])
        self.turn_task.set_velocity(self._asked[1])
        self.turn_task.set_weight(_FREE ** (1.0 - self._share) if turned else _FREE)

    def look(self, v: Float64[np.ndarray, " n"]) -> None:
        """Update `blocked` and `stuck` by the solved joint velocities."""
        found = (self._jacobian @ v[self.own]).reshape(2, 3)
        self.blocked = _is_stuck(self._asked[0], found[0], _SHORT)
        self.stuck = _is_stuck(self._asked[1], found[1], _SLOW)
        change = -self._dt / _OUT if self.blocked else self._dt / _IN
        self._share = min(max(self._share + change, 0.0), 1.0)


class LimbMotion:
    """Smooth motion of limbs' joints towards goals of their frames, on a torso at rest."""

    def __init__(
        self,
        robot: Robot,
        chains: Mapping[str, Int64[np.ndarray, " k"]],
        q_rest: Float64[np.ndarray, " nq"],
        motions: Motions,
        *,
        dt: float,
    ) -> None:
        self.names, self._dt, self._motions = tuple(chains), dt, motions
        self.index = index = np.sort(np.concatenate([*chains.values(), np.zeros(0, np.int64)]))
        self.joints = tuple(robot.joint_names[j] for j in index)
        self._q_rest, self._still = q_rest.copy(), np.zeros(robot.nv)
        self._at = index + robot.nq - robot.nj
        self._rest = q_rest[self._at]
        self._lower = np.minimum(robot.q_min[index] + motions.margin, self._rest)
        self._upper = np.maximum(robot.q_max[index] - motions.margin, self._rest)
        self._dynamics = dynamics = Dynamics(robot)
        dynamics.update(RobotState(q_rest, self._still))
        self._limbs = limbs = [
            _Limb(name, chain, np.searchsorted(index, chain), motions, dt, dynamics)
            for name, chain in chains.items()
        ]
        self.rest_rotations = [limb.rotation for limb in limbs]
        if self.joints:
            self._posture = JointTask(self.joints, weight=_POSTURE)
            self._home = JointTask(self.joints)
            first = [] if motions.move is None else [[limb.place_task] for limb in limbs]
            second = [*(limb.turn_task for limb in limbs), self._posture]
            self._leads = self._controller([*first, second])
            self._homes = self._controller([[self._home]])
        self.reset()

    def _controller(self, levels: Sequence[Sequence[Task]]) -> DifferentialIK:
        robot, dynamics, move = self._dynamics.robot, self._dynamics, self._motions.move
        limit = SelfCollisionLimit(enabled=False)
        if move is not None:
            # In which the fastest frame stops without braking harder than it may.
            time = move.speed / move.acceleration
            limit = SelfCollisionLimit(margin=_MARGIN, approach_time=time)
        ranges = zip(self.joints, self._lower.tolist(), self._upper.tolist(), strict=True)
        stack = Stack(
            # The base stands still: no limb is between it and a sole.
            contacts=[
                SurfaceContact(sole) for sole in list(robot.soles)[:1] if robot.floating_base
            ],
            levels=levels,
            joint_limit=JointLimit(
                position_margin=0.0,
                velocity_scale=_SPEED_RATIO,
                position_range={name: (low, up) for name, low, up in ranges if low < up},
            ),
            self_collision_limit=limit,
        )
        return DifferentialIK(
            robot,
            stack,
            dt=self._dt,
            strategy="hqp",
            joints=self.joints,
            limit_time=_LIMIT_TIME,
            dynamics=dynamics,
        )

    def reset(self) -> None:
        """Put all limbs at rest."""
        n = len(self.joints)
        self.q, self.v, self.a = self._rest.copy(), np.zeros(n), np.zeros(n)
        self.rests = True
        for limb in self._limbs:
            limb.reset()
        self._update()

    @property
    def blocked(self) -> list[bool]:
        """True for each frame that gets no nearer to its place."""
        return [limb.blocked for limb in self._limbs]

    @property
    def stuck(self) -> list[bool]:
        """True for each frame that turns no further."""
        return [limb.stuck for limb in self._limbs]

    def advance(self, goals: Sequence[Goal | None]) -> None:
        """Move on by a tick; limbs without a goal go back to rest."""
        if not any(goals) and self._is_at_rest():
            return
        self.rests = False
        dt, home, found = self._dt, self._motions.home, self.v
        posture = _BACK_GAIN * (self._rest - self.q)
        led = [(limb, goal) for limb, goal in zip(self._limbs, goals, strict=True) if goal]
        resting = [limb for limb, goal in zip(self._limbs, goals, strict=True) if not goal]
        if resting:
            asked = self.v.copy()
            for limb in resting:
                asked[limb.own] = home.velocity(self._rest[limb.own] - self.q[limb.own])
            self._home.set_velocity(asked)
            found = self._solve(self._homes)
            for limb in resting:
                limb.go(found)
                posture[limb.own] = found[limb.own]
        if led:
            for limb, goal in led:
                limb.follow(goal)
            self._posture.set_velocity(posture)
            found = self._solve(self._leads)
        v = self.v.copy()
        for limb in self._limbs:
            own = limb.own
            limb.look(found)
            change = found[own] - v[own]
            fastest = float(np.abs(change).max()) / home.acceleration
            v[own] += change * min(1.0, dt / max(fastest, 1e-12))
        v = np.clip(v, (self._lower - self.q) / dt, (self._upper - self.q) / dt)
        self.q, self.v, self.a = self.q + dt * v, v, (v - self.v) / dt
        self._update()

    def _solve(self, controller: DifferentialIK) -> Float64[np.ndarray, " n"]:
        velocity = controller.step(self._dynamics.state).velocity
        return self.v if velocity is None else velocity[self.index]

    def _is_at_rest(self) -> bool:
        """Put limbs that have arrived at rest there to the last bit; return whether they have."""
        if self.rests:
            return True
        off = max(float(np.abs(self.q - self._rest).max()), float(np.abs(self.v).max()))
        if off <= _ARRIVED:
            self.reset()
        return self.rests

    def _update(self) -> None:
        q = self._q_rest.copy()
        q[self._at] = self.q
        self._dynamics.update(RobotState(q, self._still))
        for limb in self._limbs:
            limb.update()
        self.places = [limb.place for limb in self._limbs]
        self.rotations = [limb.rotation for limb in self._limbs]


def _is_stuck(
    asked: Float64[np.ndarray, "3"], found: Float64[np.ndarray, "3"], least: float
) -> bool:
    """Test for joints that reach hardly any of a requested velocity."""
    speed = math.hypot(*asked)
    return speed > least and float(asked @ found) < _HARDLY * speed * speed
