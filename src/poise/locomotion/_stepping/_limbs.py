"""`LimbTracking`: task of limbs' joints, by inverse kinematics on a torso at rest."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import all_finite
from poise.control import DifferentialIK
from poise.dynamics import Dynamics, RobotState, rotation_vector
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

_GAIN = 15.0
"""Speed of a frame or of joints over the distance to their goal [1/s]."""

_BRAKING = 0.6
"""Part of the largest acceleration that is counted on near a goal."""

TURN_ACCELERATION, _JOINT_ACCELERATION = 20.0, 50.0
"""Largest angular accelerations of a frame and of joints [rad/s^2]."""

_JOINT_SPEED = 5.0
"""Largest norm of the velocities of a limb's joints towards their goal: an elbow's, whose forearm
of 0.3 m moves the hand by 1.5 m/s [rad/s]."""

_ARRIVED = 1e-3
"""Joints no farther from rest than this, and no faster, are at rest [rad, rad/s]."""

_SPEED_RATIO, _FASTEST = 0.7, 10.0
"""Part of the velocity limits that is used; speed from which joints are braked in time before
their position limits [rad/s]."""

_MARGIN = 0.03
"""Distance between links [m]: more than the stack's own limit keeps, so that limbs come to rest
here and lean on no limit there."""

_JOINT_MARGIN = 0.05
"""Distance of joints from their limits [rad]."""

_SHORT, _HARDLY = 0.05, 0.15
"""Speed below which a frame that gets no nearer is where it shall be [m/s, rad/s], and the part of
the requested velocity below which it gets no nearer."""

_POSTURE, _FREE = 1e-2, 1e-4
"""Weights beside an orientation that counts: of the joints' way to rest, which costs it a
ten-thousandth, and of an orientation that does not count."""

_FADE = 0.5
"""Time in which turning fades out where a frame does not get to its place, and in again; and in
which limbs become stiff in motion, and soft again at rest [s]."""

REST_STIFFNESS, _STIFFNESS, _BY_SERVOS = 25.0, 150.0, 16.0
"""At rest, as soft as the posture, and in motion, by torques; in motion by servos, which follow by
themselves: what ticks that failed have missed is taken back at 2 /s, half the root [1/s^2]."""

_BIAS_MAX = 30.0
"""Largest acceleration that is learned for what a hand carries: of a lag of 0.2 rad [rad/s^2]."""


class Approach(NamedTuple):
    """Bounds of a motion towards a goal."""

    speed: float
    acceleration: float

    def velocity(
        self, way: Float64[np.ndarray, " n"], rate: Float64[np.ndarray, " n"] | None = None
    ) -> Float64[np.ndarray, " n"]:
        """Return the largest velocity towards a moving goal from which it can stop at the goal."""
        far = math.hypot(*way)
        braked = math.sqrt(2.0 * _BRAKING * self.acceleration * far)
        velocity = way * (min(_GAIN * far, braked, self.speed) / max(far, 1e-9))
        if rate is None:
            return velocity
        velocity += rate
        return velocity * min(1.0, self.speed / max(math.hypot(*velocity), 1e-9))

    def step(
        self, wanted: Float64[np.ndarray, " n"], now: Float64[np.ndarray, " n"], dt: float
    ) -> Float64[np.ndarray, " n"]:
        """Return the velocity one tick later, moved towards another by a limited acceleration."""
        change = wanted - now
        return now + change * min(1.0, self.acceleration * dt / max(math.hypot(*change), 1e-12))


class Goal(NamedTuple):
    """Pose of a frame in the torso, each part None for any, and the velocity of its place.

    Or positions and velocities of the limb's joints.
    """

    place: Float64[np.ndarray, "3"] | None = None
    rotation: Float64[np.ndarray, "3 3"] | None = None
    rate: Float64[np.ndarray, " n"] | None = None
    joints: Float64[np.ndarray, " k"] | None = None


class Limb:
    """A chain of joints from the torso to a frame, and the velocities that its tasks request."""

    def __init__(
        self,
        name: str,
        joints: Int64[np.ndarray, " k"],
        own: Int64[np.ndarray, " k"],
        move: Approach | None,
        turn: Approach,
        dt: float,
        dynamics: Dynamics,
    ) -> None:
        robot = dynamics.robot
        self.own, self._move, self._turn = own, move, turn
        self._dt, self._dynamics = dt, dynamics
        self._torso, self._frame = robot.frame_id(robot.torso), robot.frame_id(name)
        self._columns = joints + robot.base_dofs
        self.place_task = RelativeFrameTask(name, robot.torso, "position")
        self.turn_task = RelativeFrameTask(name, robot.torso, "orientation")
        self.reset()
        self.update()
        self.rest_rotation = self.rotation

    def reset(self) -> None:
        """Forget the past: nothing moves."""
        # The frame gets no nearer to its place, and turns no further.
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

    def go(self, v: Float64[np.ndarray, " k"]) -> None:
        """Request the frame velocity of given velocities of its joints."""
        self.reset()
        self._asked = (self._jacobian @ v).reshape(2, 3)
        self._ask(self.place, self.rotation)

    def follow(self, goal: Goal) -> None:
        """Request velocities towards a goal."""
        asked = self._asked
        if self._move is not None and goal.place is not None:
            wanted = self._move.velocity(goal.place - self.place, goal.rate)
            asked[0] = self._move.step(wanted, asked[0], self._dt)
        if goal.rotation is None:
            asked[1] = 0.0
        else:
            way = rotation_vector(goal.rotation, self.rotation)
            if len(self.own) < 3:
                # Two joints have the head look there, and leave how it is held askew.
                looks = self.rotation @ self.rest_rotation[0]
                way -= looks * (looks @ way)
            asked[1] = self._turn.step(self._turn.velocity(way), asked[1], self._dt)
        self._ask(goal.place, goal.rotation)

    def _ask(
        self,
        place: Float64[np.ndarray, "3"] | None,
        rotation: Float64[np.ndarray, "3 3"] | None,
    ) -> None:
        if place is not None:
            self.place_task.overwrite_target()[0] = place
        if rotation is not None:
            self.turn_task.overwrite_target()[1:4] = rotation
        self.place_task.set_velocity(self._asked[0])
        self.turn_task.set_velocity(self._asked[1])
        self.turn_task.set_weight(_FREE ** (1.0 - self._share) if rotation is not None else _FREE)

    def slowed(self, v: Float64[np.ndarray, " k"]) -> Float64[np.ndarray, " k"]:
        """Shorten velocities of its joints to the largest speed of its frame."""
        if self._move is None:
            return v
        return v * min(1.0, self._move.speed / max(math.hypot(*(self._jacobian[:3] @ v)), 1e-9))

    def look(self, v: Float64[np.ndarray, " n"]) -> None:
        """Update `blocked` and `stuck` by the solved joint velocities."""
        found = (self._jacobian @ v[self.own]).reshape(2, 3)
        self.blocked = _is_stuck(self._asked[0], found[0])
        self.stuck = _is_stuck(self._asked[1], found[1])
        self._share = _faded(self._share, self._dt, grows=not self.blocked)


def _is_stuck(asked: Float64[np.ndarray, "3"], found: Float64[np.ndarray, "3"]) -> bool:
    """Test for joints that reach almost none of a requested velocity."""
    speed = math.hypot(*asked)
    return speed > _SHORT and float(asked @ found) < _HARDLY * speed * speed


def _faded(share: float, dt: float, *, grows: bool) -> float:
    return min(max(share + (dt if grows else -dt) / _FADE, 0.0), 1.0)


class LimbTracking:
    """Task of limbs' joints towards goals of their frames: smooth, and stiffer in motion."""

    # By torques the lag of the joints becomes a `bias` within a second.

    def __init__(
        self,
        robot: Robot,
        chains: Mapping[str, Int64[np.ndarray, " k"]],
        q_rest: Float64[np.ndarray, " nq"] | None,
        *,
        move: Approach | None,
        turn: Approach,
        dt: float,
        weight: float,
        name: str,
        servos: bool,
        home_speed: float = 1.2,
    ) -> None:
        q_rest = robot.q_home if q_rest is None else q_rest
        self.names, self._dt, self._move, self._servos = tuple(chains), dt, move, servos
        self._home = Approach(home_speed, _JOINT_ACCELERATION)
        self._by_joints = Approach(_JOINT_SPEED, TURN_ACCELERATION)
        self.index = index = np.sort(np.concatenate([*chains.values(), np.zeros(0, np.int64)]))
        joints = tuple(robot.joint_names[j] for j in index)
        self._q_rest, self._still = q_rest.copy(), np.zeros(robot.nv)
        self._at = index + robot.nq - robot.nj
        self._rest = q_rest[self._at]
        self._lower = np.minimum(robot.q_min[index] + _JOINT_MARGIN, self._rest)
        self._upper = np.maximum(robot.q_max[index] - _JOINT_MARGIN, self._rest)
        self._dynamics = dynamics = Dynamics(robot)
        dynamics.update(RobotState(q_rest, self._still))
        self.limbs = limbs = [
            Limb(name, chain, np.searchsorted(index, chain), move, turn, dt, dynamics)
            for name, chain in chains.items()
        ]
        self.task: JointTask | None = None
        if joints:
            self.task = JointTask(joints, weight=weight, name=name)
            self.task.bind(robot)
            self._posture = JointTask(joints, weight=_POSTURE)
            first = [] if move is None else [[limb.place_task for limb in limbs]]
            second = [*(limb.turn_task for limb in limbs), self._posture]
            self._model = self._controller(joints, [*first, second])
            # Frames come first in the other one: a limb that is blocked would leave its joints'
            # goal so as to have its frame there.
            self._wanted = JointTask(joints)
            self._joint_model = self._controller(joints, [[self._wanted]])
        self.reset()

    def _controller(
        self, joints: tuple[str, ...], levels: Sequence[Sequence[Task]]
    ) -> DifferentialIK:
        robot, move = self._dynamics.robot, self._move
        limit = SelfCollisionLimit(enabled=False)
        if move is not None:
            # In which the fastest frame stops without braking harder than it may.
            time = move.speed / move.acceleration
            limit = SelfCollisionLimit(margin=_MARGIN, approach_time=time)
        ranges = zip(joints, self._lower.tolist(), self._upper.tolist(), strict=True)
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
            joints=joints,
            limit_time=_FASTEST / _JOINT_ACCELERATION,
            dynamics=self._dynamics,
        )

    def start(self, q: Float64[np.ndarray, " nq"]) -> None:
        """Begin where the joints are, at rest; they carry nothing."""
        self.reset()
        self.q, self._arrived = np.clip(q[self._at], self._lower, self._upper), False
        self._update()
        if self.task is not None:
            self.task.set_target(self.q, self.v, self.a)

    def reset(self) -> None:
        """Put all limbs at rest; they carry nothing."""
        self._settle()
        self._stiff, self.bias = 0.0, np.zeros(len(self.q))
        if self.task is not None:
            self.task.set_gains(0.0 if self._servos else REST_STIFFNESS)
            self.task.set_target(self.q, self.v, self.a)

    def _settle(self) -> None:
        self.q, self._arrived = self._rest.copy(), True
        self.v, self.a = np.zeros((2, len(self.q)))
        for limb in self.limbs:
            limb.reset()
        self._update()

    @property
    def rests(self) -> bool:
        """True while the joints are at rest, as soft as there, and nothing is learned."""
        return self._arrived and self._stiff == 0.0

    def follow(
        self, goals: Sequence[Goal | None], q: Float64[np.ndarray, " nq"] | None = None
    ) -> None:
        """Move on by a tick; limbs without a goal go back to rest."""
        led, task, servos = any(goals), self.task, self._servos
        if task is None or (self.rests and not led):
            return
        self.advance(goals)
        # Servos follow all the way to rest; by torques limbs that go there are soft.
        stiffens = led or (servos and bool(self.v.any()))
        before, self._stiff = self._stiff, _faded(self._stiff, self._dt, grows=stiffens)
        rest, most = (0.0, _BY_SERVOS) if servos else (REST_STIFFNESS, _STIFFNESS)
        if self._stiff != before:
            task.set_gains(rest + self._stiff * (most - rest))
        if self._stiff == 0.0:
            self.bias = np.zeros(task.dim)
        elif not (servos or q is None) and all_finite(lag := self.q - q[self._at]):
            bias = self._stiff * (self.bias + self._dt * _STIFFNESS * lag)
            self.bias = np.clip(bias, -_BIAS_MAX, _BIAS_MAX)
        task.set_target(self.q, self.v, self.a + self.bias)

    def advance(self, goals: Sequence[Goal | None]) -> None:
        """Move the model on by a tick; limbs without a goal go back to rest."""
        if not any(goals):
            off = np.abs((self.q - self._rest, self.v))
            if not self._arrived and off.max() <= _ARRIVED:
                # To the last bit.
                self._settle()
            if self._arrived:
                return
        self._arrived, dt, home = False, self._dt, self._home
        # What frames leave to their joints goes back to rest, by what is missing in a second.
        posture = self._rest - self.q
        for limb, goal in zip(self.limbs, goals, strict=True):
            if goal is None:
                posture[limb.own] = home.velocity(posture[limb.own])
                limb.go(posture[limb.own])
            elif goal.joints is not None:
                posture[limb.own] = self._towards(goal.joints, goal.rate, limb)
                limb.go(posture[limb.own])
            else:
                limb.follow(goal)
        found = self._solve(goals, posture)
        v = self.v.copy()
        for limb in self.limbs:
            own = limb.own
            limb.look(found)
            change = found[own] - v[own]
            fastest = float(np.abs(change).max()) / home.acceleration
            v[own] += change * min(1.0, dt / max(fastest, 1e-12))
        v = np.clip(v, (self._lower - self.q) / dt, (self._upper - self.q) / dt)
        self.q, self.v, self.a = self.q + dt * v, v, (v - self.v) / dt
        self._update()

    def _towards(
        self,
        joints: Float64[np.ndarray, " k"],
        rate: Float64[np.ndarray, " k"] | None,
        limb: Limb,
    ) -> Float64[np.ndarray, " k"]:
        """Velocities of a limb's joints towards their goal, which is moved within their limits."""
        own = limb.own
        way = np.clip(joints, self._lower[own], self._upper[own]) - self.q[own]
        wanted = limb.slowed(self._by_joints.velocity(way, rate))
        return self._by_joints.step(wanted, self.v[own], self._dt)

    def _solve(
        self, goals: Sequence[Goal | None], posture: Float64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, " k"]:
        """Velocities of all limbs, off each other: as frames ask, then as joints ask."""
        by_joints = [goal is not None and goal.joints is not None for goal in goals]
        found = posture
        if not any(by_joints) or any(g and g.joints is None for g in goals):
            self._posture.set_velocity(posture)
            found = self._step(self._model)
        if any(by_joints):
            for limb, goal in zip(self.limbs, goals, strict=True):
                if goal is not None and goal.joints is None:
                    posture[limb.own] = found[limb.own]
            self._wanted.set_velocity(posture)
            found = self._step(self._joint_model)
        return found

    def _step(self, model: DifferentialIK) -> Float64[np.ndarray, " k"]:
        velocity = model.step(self._dynamics.state).velocity
        return self.v if velocity is None else velocity[self.index]

    def _update(self) -> None:
        q = self._q_rest.copy()
        q[self._at] = self.q
        self._dynamics.update(RobotState(q, self._still))
        for limb in self.limbs:
            limb.update()
