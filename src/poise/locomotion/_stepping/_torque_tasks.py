"""`TorqueTasks`: the stack of step teleoperation by torques; `AnkleStops`, `TrunkFeedback`."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.locomotion._stepping._biped import Biped
from poise.locomotion._stepping._footing import UPRIGHT, Footing, TrunkPose
from poise.locomotion._stepping._limbs import REST_STIFFNESS
from poise.locomotion._support import Rotation, Vector3
from poise.locomotion._walking import KNEE, mean_angle, stepping_stack
from poise.robots import Robot
from poise.stack import (
    LINEAR_SPEED,
    ComTask,
    FrameTask,
    JointLimit,
    JointTask,
    SurfaceContact,
)

_KP, _KP_FOOT = 100.0, 300.0
"""Stiffness of the CoM's height, of pelvis and torso, and of a swing foot [1/s^2]."""

POSTURE_WEIGHT = 0.03
"""Of arms and posture beside foot and trunk: below them alone the arms would be thrown about by
what little those leave to them. Heavier ones are thrown less, and lean the trunk more."""


class _Weights(NamedTuple):
    com: tuple[float, ...]
    foot: float | tuple[float, ...]
    trunk: tuple[float, ...]
    margin: float  # distance of the pressure from the soles' edges [m]


_LED = _Weights((1e5, 1e5, 1.0), 1.0, (1.0, 1.0, 10.0), 0.002)
"""While the operator leads the feet. Height is no balance: a leg may fold no deeper. Turning about
the vertical balances nothing, but the leg and the arms that do would spin a light torso."""

_CAUGHT = _Weights((1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 0.1, 0.1, 0.1), (0.3, 0.3, 0.3), 0.005)
"""While the robot steps by itself: a foot that is late, or stumbles, costs the balance, too."""

_RIGHTED = 0.2
"""Farthest target of a thrown trunk from where it is: farther, it costs the CoM [rad]."""

_THROWN, _AWAY = 1e3, 0.15
"""Weight of a swing foot that is twice so far from its target [m], beside a narrow sole; no higher
above the ground it can land. Lighter, a push throws it up by 0.5 m."""

_EASED = 0.3
"""Time in which the balance comes to weigh that much after them [s]: a step of the weight throws
over a robot one of whose soles is loaded less than estimated."""

_FRICTION = 0.45
"""Of the soles, as contacts assume it: more lets a swing turn a sole on slippery ground."""


class TorqueTasks:
    """Accelerations of CoM, feet and trunk, weighted in this order; standing feet are contacts.

    Levels cost balance and smoothness. With CoM and feet strictly above trunk and limbs, above the
    posture, without softening, pushes of 0.5 and 0.65 m/s in 8 directions made 271 and 1,604 ticks
    with a torque step above a quarter of its limit, against 41 and 166, and 1 fall of 16 against
    none.
    """

    def __init__(self, biped: Biped, dt: float, limbs: Sequence[JointTask]) -> None:
        robot, self._dt = biped.robot, dt
        self._com = ComTask(kp=_KP, speed=LINEAR_SPEED)
        self._feet = [FrameTask(sole, kp=_KP_FOOT, name=f"{sole} foot") for sole in biped.soles]
        frames = robot.model.frames
        pelvis, torso = (frames[robot.frame_id(f)].parentJoint for f in (robot.pelvis, robot.torso))
        trunk = (robot.pelvis,) if torso == pelvis else (robot.pelvis, robot.torso)
        self._trunk = [FrameTask(frame, "orientation", kp=_KP) for frame in trunk]
        self._contacts = [
            SurfaceContact(sole, friction=_FRICTION, margin=_LED.margin) for sole in biped.soles
        ]
        led = {joint for task in limbs for joint in task.joints or ()}
        others = [name for name in robot.joint_names if name not in led]
        posture = JointTask(others, kp=REST_STIFFNESS, weight=POSTURE_WEIGHT, name="posture")
        self.stack = stepping_stack(
            robot,
            [[self._com, *self._feet, *self._trunk, *limbs, posture]],
            contacts=self._contacts,
            # A straight leg gets no shorter whatever its knee does: the trunk would bow for it.
            position_range=biped.knees,
        )
        self.stack.bind(robot)
        posture.set_target(
            robot.q_home[[robot.nq - robot.nj + robot.joint_index(name) for name in others]]
        )
        self._pose = TrunkPose(biped.relief, dt, waist_ranges(biped))
        self._lasting = [TrunkFeedback(dt) for _ in trunk]
        self._weights: _Weights | None = None
        self._stops = AnkleStops(robot, self._contacts, self.stack.joint_limit)
        self.reset()

    def reset(self) -> None:
        """Both feet carry."""
        self._pose.reset()
        for feedback in self._lasting:
            feedback.reset()
        self._stops.reset()
        self._eased = 1.0
        self._weigh(_LED)
        for contact in self._contacts:
            contact.engage(0.0)

    def lead(
        self,
        footing: Footing,
        torso: tuple[float, float, float],
        sent: Vector3,
        *,
        upright: bool,
    ) -> None:
        """Set trunk and contacts for a tick in which the operator moves the feet."""
        self._eased = min(self._eased + self._dt / _EASED, 1.0)
        com, _, trunk, _ = _LED
        com = tuple(most**self._eased for most in com)
        trunk = (max(trunk),) * 3 if upright else trunk
        self._weigh(_LED._replace(com=com, foot=_foot_weight(footing, sent), trunk=trunk))
        self._turn_trunk(footing, UPRIGHT if upright else torso, learns=True)

    def accompany(self, footing: Footing, *, walks: bool) -> None:
        """Keep the trunk upright in a tick in which the robot steps autonomously."""
        self._eased = 0.0
        self._weigh(_CAUGHT)
        self._turn_trunk(footing, UPRIGHT, learns=walks, most=_RIGHTED)

    def _weigh(self, weights: _Weights) -> None:
        """Set weights of CoM, feet and trunk, and the margins of a step to edges and legs."""
        if weights == self._weights:
            return
        self._weights = weights
        self._com.set_weight(weights.com)
        for task in self._feet:
            task.set_weight(weights.foot)
        for task in self._trunk:
            task.set_weight(weights.trunk)
        for contact in self._contacts:
            if weights.margin != contact.margin:
                contact.set_margin(weights.margin)
        self.stack.self_collision_limit.let_legs_pass(weights is _CAUGHT)

    def _turn_trunk(
        self,
        footing: Footing,
        torso: tuple[float, float, float],
        *,
        learns: bool,
        most: float = math.inf,
    ) -> None:
        """Turn pelvis and torso to face as the feet, targets no farther than `most` [rad]."""
        self._stops.update(footing)
        goals = self._pose.rotations(footing, mean_angle(*footing.yaws), torso)
        # Not every torso can be bent, so a trunk that is bent may be off for ever.
        learns = learns and self._pose.upright
        places = footing.pelvis, footing.torso
        # A torso without a waist is the pelvis.
        for k in range(-len(self._trunk), 0):
            target, (_, here) = self._trunk[k].overwrite_target().ravel(), places[k]
            target[3:12] = goals[k].ravel()
            self._lasting[k].apply(target, here, learns=learns)
            if most < math.inf:
                left = most - math.hypot(*target[21:].tolist()) / _KP
                target[3:12] = _towards(goals[k], here, max(left, 0.0)).ravel()


def _foot_weight(footing: Footing, sent: Vector3) -> float:
    """Weight of the swing foot, by its distance from the commanded position."""
    if not (footing.region.narrow and footing.mode.single):
        return 1.0
    (x, y, z), (to_x, to_y, to_z) = footing.sole(footing.other).tolist(), sent.tolist()
    up = max(z - max(to_z, footing.highest_ground + _AWAY), 0.0)
    away = math.hypot(x - to_x, y - to_y, up) / _AWAY
    return _THROWN ** min(max(away - 1.0, 0.0), 1.0)


def _towards(goal: Rotation, here: Rotation, most: float) -> Rotation:
    """Rotation from one towards another, by at most an angle [rad]."""
    way = pin.log3(here.T @ goal)
    far = math.hypot(*way.tolist())
    return goal if far <= most else here @ pin.exp3(way * (most / far))


def waist_ranges(biped: Biped) -> Float64[np.ndarray, "3 2"]:
    """Least and largest roll, pitch and yaw of the torso against the pelvis, from home [rad]."""
    robot, dynamics = biped.robot, Dynamics(biped.robot)
    dynamics.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    pelvis, torso = (dynamics.frame(f) for f in (biped.pelvis, biped.torso))
    axes = pelvis.rotation.T @ (torso.jacobian - pelvis.jacobian)[3:, robot.base_dofs :]
    limits = np.array((robot.model.lowerPositionLimit, robot.model.upperPositionLimit))
    room = (limits - robot.q_home)[:, robot.nq - robot.nj :]
    # Zero about axes for which the waist has no joint: there only the pelvis turns the torso.
    ranges = np.zeros((3, 2))
    for joint in np.flatnonzero(axes.any(axis=0)).tolist():
        axis = int(np.abs(axes[:, joint]).argmax())
        ranges[axis] += np.sort(axes[axis, joint] * room[:, joint])
    return ranges


_NEAR, _BACK = 0.005, 0.03
"""Distances from a limit at which an ankle is left to its stop, and at which the limit holds again
[rad]."""

_GROUND = 0.1
"""Sine of the largest tilt of a sole that may be flat on the ground: a slope of 3 degrees with an
attitude off by 1, or a bump."""


class AnkleStops:
    """Leave an ankle to its stop while its sole leans on an edge: the sole turns with the shank."""

    def __init__(self, robot: Robot, contacts: list[SurfaceContact], limit: JointLimit) -> None:
        self._contacts, self._limit = contacts, limit
        self._first = robot.nq - robot.nj
        # Pinocchio counts the world and the floating base before the joints.
        self._ankles = [
            [joint - 2 for joint in robot.leg_joints(contact.frame)[KNEE + 1 :]]
            for contact in contacts
        ]
        self._least, self._most = limit.q_min.tolist(), limit.q_max.tolist()
        self._at_stop = dict[int, tuple[bool, bool]]()
        self.reset()

    def reset(self) -> None:
        """All limits hold."""
        for ankles in self._ankles:
            for ankle in ankles:
                self._leave(ankle, False, False)

    def update(self, footing: Footing) -> None:
        for foot, contact in enumerate(self._contacts):
            up_x, up_y, _ = footing.soles[foot][1][2].tolist()
            tilted = math.hypot(up_x, up_y) > _GROUND
            for ankle in self._ankles[foot]:
                at_lower, at_upper = self._at_stop[ankle]
                if not (tilted or at_lower or at_upper):
                    continue
                angle = float(footing.dynamics.q[self._first + ankle])
                below, above = angle - self._least[ankle], self._most[ankle] - angle
                self._leave(
                    ankle,
                    contact.active and (below < _BACK if at_lower else tilted and below < _NEAR),
                    contact.active and (above < _BACK if at_upper else tilted and above < _NEAR),
                )

    def _leave(self, ankle: int, at_lower: bool, at_upper: bool) -> None:
        if self._at_stop.get(ankle) != (at_lower, at_upper):
            self._at_stop[ankle] = at_lower, at_upper
            self._limit.leave_to_stop(ankle, at_lower=at_lower, at_upper=at_upper)


_LEARNING = 50.0
"""Rate at which a lasting error becomes an acceleration [1/s^3]: with the trunk's stiffness of
100 /s^2 within some 2 s."""

_LASTING = 0.3
"""Largest lasting lean: a trunk farther off has been thrown [rad]."""


class TrunkFeedback:
    """Integrate one frame's orientation error about its own x and y: a moment the model lacks."""

    def __init__(self, dt: float) -> None:
        self._step = _LEARNING * dt
        self.reset()

    def reset(self) -> None:
        """Nothing is known."""
        self._learned = 0.0, 0.0

    def apply(
        self, target: Float64[np.ndarray, "24"], here: Float64[np.ndarray, "3 3"], *, learns: bool
    ) -> None:
        """Take a tick, and write the acceleration into a pose target beside its rotation."""
        if learns:
            x, y, _ = pin.log3(here.T.dot(target[3:12].reshape(3, 3))).tolist()
            if math.hypot(x, y) < _LASTING:
                (roll, pitch), step, most = self._learned, self._step, _KP * _LASTING
                roll = min(max(roll + step * x, -most), most)
                self._learned = roll, min(max(pitch + step * y, -most), most)
        target[21:] = here[:, :2].dot(self._learned)
