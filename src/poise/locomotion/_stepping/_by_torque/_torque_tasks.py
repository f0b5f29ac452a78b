"""`TorqueTasks`: the stack that the step teleoperator leads where torques are commanded."""

import math
from collections.abc import Sequence

import pinocchio as pin

from poise.locomotion._stepping._by_torque._departures import (
    AnkleStops,
    TrunkFeedback,
    waist_ranges,
)
from poise.locomotion._stepping._stance import UPRIGHT, Biped, Footing, TrunkPose
from poise.locomotion._support import Rotation, Vector3
from poise.locomotion._walking import mean_angle, stepping_stack
from poise.stack import LINEAR_SPEED, ComTask, FrameTask, JointTask, SurfaceContact

_KP_COM, _KP_FOOT, _KP_TRUNK = 100.0, 300.0, 100.0
"""Stiffness of the COM's height, of the foot in the air, of pelvis and torso [1/s^2]."""

POSTURE_WEIGHT = 0.03
"""Of arms and posture beside foot and trunk: below them alone the arms would be thrown about by
what little those leave to them. Heavier ones are thrown less, and lean the trunk more."""

_KP_POSTURE = 25.0
"""Stiffness of the posture [1/s^2]."""

_BALANCE, _CATCHING, _CAUGHT_TRUNK = (1e5, 1e5, 1.0), 1.0, (0.3, 0.3, 0.3)
"""Weight of the CoM beside foot and trunk while the operator leads the feet; and of CoM and trunk
while the robot steps by itself. Height is no balance: a leg may fold no deeper."""

_RIGHTED = 0.2
"""Farthest target of a thrown trunk from where it is: farther, it costs the CoM [rad]."""

_THROWN, _AWAY, _HIGH = 1e3, 0.15, 0.1
"""Weight of a swing foot that is twice so far from its target [m], beside a narrow sole; so far
above the ground [m] it is not too high for landing. Lighter, a push throws it up by 0.5 m."""

_CAUGHT_FOOT = (1.0, 1.0, 1.0, 0.1, 0.1, 0.1)
"""Weight of the feet meanwhile: a foot that is late, or stumbles, costs the balance, too."""

_Weights = tuple[float | tuple[float, ...], float | tuple[float, ...], tuple[float, ...]]
"""Of CoM, feet and trunk."""

_EASED = 0.3
"""Time in which the balance comes to weigh that much after them [s]: a step of the weight throws
over a robot one of whose soles is loaded less than estimated."""

_TRUNK, _URGENT_TRUNK = (1.0, 1.0, 10.0), (10.0, 10.0, 10.0)
"""Weights of the trunk while the operator leads, and while they ask for an upright torso as well:
turning about the vertical balances nothing, but the leg and the arms that do would spin a light
torso by two radians."""

_FRICTION = 0.45
"""Of the soles, as contacts assume it: more lets a swing turn a sole on slippery ground."""

_MARGIN, _CAUGHT_MARGIN = 0.002, 0.005
"""Distance of the pressure from the soles' edges, while the operator leads the feet and while the
robot steps by itself [m]."""


class TorqueTasks:
    """Accelerations of CoM, feet and trunk, weighted in this order; standing feet are contacts.

    Levels cost balance and smoothness. With CoM and feet strictly above trunk and limbs, above the
    posture, without softening, pushes of 0.5 and 0.65 m/s in 8 directions made 271 and 1,604 ticks
    with a torque step above a quarter of its limit, against 41 and 166, and 1 fall of 16 against
    none.
    """

    def __init__(self, biped: Biped, dt: float, limbs: Sequence[JointTask]) -> None:
        robot, self._dt = biped.robot, dt
        self._com = ComTask(kp=_KP_COM, weight=_BALANCE, speed=LINEAR_SPEED)
        self._feet = [FrameTask(sole, kp=_KP_FOOT, name=f"{sole} foot") for sole in biped.soles]
        frames = robot.model.frames
        pelvis, torso = (frames[robot.frame_id(f)].parentJoint for f in (robot.pelvis, robot.torso))
        trunk = (robot.pelvis,) if torso == pelvis else (robot.pelvis, robot.torso)
        self._trunk = [FrameTask(frame, "orientation", kp=_KP_TRUNK) for frame in trunk]
        self._contacts = [
            SurfaceContact(sole, friction=_FRICTION, margin=_MARGIN) for sole in biped.soles
        ]
        led = {joint for task in limbs for joint in task.joints or ()}
        others = [name for name in robot.joint_names if name not in led]
        posture = JointTask(others, kp=_KP_POSTURE, weight=POSTURE_WEIGHT, name="posture")
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
        self._weigh((_BALANCE, 1.0, _TRUNK), caught=False)
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
        """Set trunk and contacts for a tick in which the operator leads the feet."""
        self._eased = min(self._eased + self._dt / _EASED, 1.0)
        com = tuple(_CATCHING * (most / _CATCHING) ** self._eased for most in _BALANCE)
        trunk = _URGENT_TRUNK if upright else _TRUNK
        self._weigh((com, _foot_weight(footing, sent), trunk), caught=False)
        self._turn_trunk(footing, UPRIGHT if upright else torso, learns=True)

    def accompany(self, footing: Footing, *, walks: bool) -> None:
        """Keep the trunk upright in a tick in which the robot steps by itself."""
        self._eased = 0.0
        self._weigh((_CATCHING, _CAUGHT_FOOT, _CAUGHT_TRUNK), caught=True)
        self._turn_trunk(footing, UPRIGHT, learns=walks, most=_RIGHTED)

    def _weigh(self, weights: _Weights, *, caught: bool) -> None:
        """Set weights of CoM, feet and trunk, and how near to edges and legs a step may go."""
        if weights == self._weights:
            return
        self._weights, (com, foot, trunk) = weights, weights
        self._com.set_weight(com)
        for task in self._feet:
            task.set_weight(foot)
        for task in self._trunk:
            task.set_weight(trunk)
        margin = _CAUGHT_MARGIN if caught else _MARGIN
        if margin != self._contacts[0].margin:
            for contact in self._contacts:
                contact.set_margin(margin)
        self.stack.self_collision_limit.let_legs_pass(caught)

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
                left = most - math.hypot(*target[21:].tolist()) / _KP_TRUNK
                target[3:12] = _towards(goals[k], here, max(left, 0.0)).ravel()


def _foot_weight(footing: Footing, sent: Vector3) -> float:
    """Weight of the swing foot, by how far it has been thrown from where it is sent."""
    if not (footing.region.narrow and footing.mode.single):
        return 1.0
    (x, y, z), (to_x, to_y, to_z) = footing.sole(footing.other).tolist(), sent.tolist()
    up = max(z - max(to_z, footing.highest_ground + _HIGH), 0.0)
    away = math.hypot(x - to_x, y - to_y, up) / _AWAY
    return _THROWN ** min(max(away - 1.0, 0.0), 1.0)


def _towards(goal: Rotation, here: Rotation, most: float) -> Rotation:
    """A rotation on the way from one to another, no farther than that [rad]."""
    way = pin.log3(here.T @ goal)
    far = math.hypot(*way.tolist())
    return goal if far <= most else here @ pin.exp3(way * (most / far))
