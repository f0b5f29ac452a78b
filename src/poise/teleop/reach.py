"""`FootRange`: where the feet can go, and how far the body must come down for them to."""

import numpy as np
from jaxtyping import Float64

from poise.dynamics.dynamics import Dynamics
from poise.dynamics.state import RobotState
from poise.robots.robot import Robot
from poise.teleop.parameters import TeleopParameters, knee_limits, leg_joints

_ROLL_SHARE = 0.8
"""Share of the ankle's roll that may be used for standing with the feet apart."""

_HIP = 2
"""The third joint of a leg has the hip's other two at or near its origin."""


class FootRange:
    """Keeps a swing foot within the leg's reach and beside the other foot.

    Reach is a sphere around the hip for the ankle, whose place follows from the sole's, which is
    kept level. Its radius is the leg's length with the knee as straight as it may be, less a
    margin; a command beyond it is shortened along the ground. Beside means: to its own side of the
    support foot, across the heading of the torso, by no less than the width of a sole and a gap, so
    that legs never cross, and by no more than `step_max`, which also holds along the heading, nor
    than the ankles' roll allows.

    Args:
        robot: a biped.
        soles: names of the left and the right sole.
        parameters: margins.
    """

    def __init__(self, robot: Robot, soles: tuple[str, str], parameters: TeleopParameters) -> None:
        self._hips: list[int] = []
        self._reach: list[float] = []
        self._ankles: list[Float64[np.ndarray, "3"]] = []
        sides: list[float] = []
        for name in soles:
            joints = leg_joints(robot, name)
            # Pinocchio counts the world and the floating base before the joints.
            hip, ankle = joints[_HIP] + 2, joints[-1] + 2
            straight = _with_straight_leg(robot, joints, parameters.knee_min)
            length = np.linalg.norm(straight.joint_position(ankle) - straight.joint_position(hip))
            sole = straight.frame(robot.frame_id(name))
            arm = straight.joint_position(ankle) - sole.position
            self._hips.append(hip)
            self._reach.append((1.0 - parameters.reach_margin) * float(length))
            self._ankles.append(sole.rotation.T @ arm)
            # A level sole beside the hip takes as much roll of the ankle as the leg leans.
            roll = _ROLL_SHARE * float(min(-robot.q_min[joints[-1]], robot.q_max[joints[-1]]))
            lean = self._reach[-1] * float(np.sin(min(max(roll, 0.0), 0.5 * np.pi)))
            sides.append(lean + abs(float(straight.joint_position(hip)[1])))
        widths = [robot.soles[name].width for name in soles]
        self._apart = 0.5 * sum(widths) + parameters.feet_gap
        self._step_max = parameters.step_max
        self._aside_max = max(self._apart, min(parameters.step_max, *sides))

    def bring_back(
        self,
        foot: int,
        target: Float64[np.ndarray, "3"],
        support: Float64[np.ndarray, "3"],
        heading: Float64[np.ndarray, "2"],
        dynamics: Dynamics,
        *,
        lower: float = 0.0,
    ) -> Float64[np.ndarray, "3"]:
        """The nearest position that the foot can be sent to.

        Args:
            foot: 0 left, 1 right.
            target: commanded [m].
            support: centre of the other sole [m].
            heading: unit vector forward, x and y.
            dynamics: of the estimated state.
            lower: how far the body may still come down for it [m].
        """
        target = target.copy()
        across = np.array([-heading[1], heading[0]]) * (1.0 if foot == 0 else -1.0)
        way = target[:2] - support[:2]
        aside, ahead = float(way @ across), float(way @ heading)
        aside = min(max(aside, self._apart), self._aside_max)
        ahead = min(max(ahead, -self._step_max), self._step_max)
        target[:2] = support[:2] + aside * across + ahead * heading
        # Across the ground only: how far down a foot gets is for the ground and the knee to say.
        hip, arm = dynamics.joint_position(self._hips[foot]), self._ankles[foot]
        drop = float(hip[2] - arm[2] - max(target[2], support[2])) - lower
        room = np.sqrt(max(self._reach[foot] ** 2 - drop * drop, 0.0))
        way = target[:2] + arm[:2] - hip[:2]
        distance = float(np.linalg.norm(way))
        if distance > room:
            target[:2] -= way * (1.0 - room / distance)
        return target

    def too_high(
        self,
        foot: int,
        place: Float64[np.ndarray, "3"],
        dynamics: Dynamics,
        shift: Float64[np.ndarray, "2"],
    ) -> float:
        """How far the hip is too high for the foot to be at a place; negative for room left [m].

        Args:
            foot: 0 left, 1 right.
            place: of the sole [m].
            dynamics: of the estimated state.
            shift: how far the hip will have gone along the ground [m].
        """
        way = place + self._ankles[foot] - dynamics.joint_position(self._hips[foot])
        way[:2] -= shift
        across = float(way[:2] @ way[:2])
        return float(-way[2]) - float(np.sqrt(max(self._reach[foot] ** 2 - across, 0.0)))


def _with_straight_leg(robot: Robot, joints: list[int], knee_min: float) -> Dynamics:
    q = robot.q_home.copy()
    lower, upper = knee_limits(robot, joints, knee_min)
    q[7 + np.array(joints)] = np.clip(0.0, lower, upper)
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    return dynamics
