"""`FootRange`: brings a commanded foot position back to where the foot can go."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from poise.dynamics.dynamics import Dynamics
from poise.robots.robot import Robot
from poise.teleop.parameters import TeleopParameters, leg_joints


class FootRange:
    """Keeps a swing foot within the leg's reach and beside the other foot.

    Reach is a sphere around the hip, with the length of the leg straight, less a margin; a command
    beyond it is shortened along the ground. Beside means: to its own side of the support foot,
    across the heading of the torso, by no less than the
    width of a sole and a gap; legs never cross.

    Args:
        robot: a biped.
        soles: names of the left and the right sole.
        parameters: margins.
    """

    def __init__(self, robot: Robot, soles: tuple[str, str], parameters: TeleopParameters) -> None:
        home = Dynamics(robot)
        self._hips: list[int] = []
        self._lengths: list[float] = []
        for name in soles:
            # Pinocchio counts the world and the floating base before the joints.
            chain = [joint + 2 for joint in leg_joints(robot, name)]
            ends = [home.joint_position(joint) for joint in chain]
            ends.append(home.frame(robot.frame_id(name)).position)
            self._hips.append(chain[2])
            length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(ends[2:]))
            self._lengths.append((1.0 - parameters.reach_margin) * length)
        widths = [robot.soles[name].width for name in soles]
        self._apart = 0.5 * sum(widths) + parameters.feet_gap

    def bring_back(
        self,
        foot: int,
        target: Float64[np.ndarray, "3"],
        support: Float64[np.ndarray, "3"],
        heading: Float64[np.ndarray, "2"],
        dynamics: Dynamics,
    ) -> Float64[np.ndarray, "3"]:
        """The nearest position that the foot can be sent to.

        Args:
            foot: 0 left, 1 right.
            target: commanded [m].
            support: centre of the other sole [m].
            heading: unit vector forward, x and y.
            dynamics: of the estimated state.
        """
        target = target.copy()
        across = np.array([-heading[1], heading[0]]) * (1.0 if foot == 0 else -1.0)
        aside = float((target[:2] - support[:2]) @ across)
        if aside < self._apart:
            target[:2] += (self._apart - aside) * across
        # Across the ground only: how far down a foot gets is for the ground and the knee to say.
        hip = dynamics.joint_position(self._hips[foot])
        drop = float(hip[2] - max(target[2], support[2]))
        room = np.sqrt(max(self._lengths[foot] ** 2 - drop * drop, 0.0))
        way = target[:2] - hip[:2]
        distance = float(np.linalg.norm(way))
        if distance > room:
            target[:2] = hip[:2] + way * (room / distance)
        return target
