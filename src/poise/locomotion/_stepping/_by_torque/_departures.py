"""Departures from plain tasks and contacts: ankles at their stops, a lasting lean."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled
from poise.dynamics import Dynamics, RobotState
from poise.locomotion._stepping._stance import Biped, Footing
from poise.locomotion._walking import KNEE
from poise.robots import Robot
from poise.stack import JointLimit, SurfaceContact

_ALONG = 0.7
"""A joint turns about an axis along which its own has this part at home."""


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
    for axis, joint in np.argwhere(np.abs(axes) > _ALONG).tolist():
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

_MOST = 30.0
"""Largest acceleration that is learned: at its stiffness, a lean of 0.3 rad [rad/s^2]."""

_THROWN = 0.3
"""A trunk so far off has been thrown: no lasting error [rad]."""


class TrunkFeedback:
    """Integrate one frame's orientation error about its own x and y: a moment the model lacks."""

    def __init__(self, dt: float) -> None:
        self._step = _LEARNING * dt
        self._learned: Float64[np.ndarray, "2"] = np.zeros(2)
        # What is compiled is compiled now, not in the first tick.
        self.apply(np.zeros(24), np.eye(3), learns=False)

    def reset(self) -> None:
        """Nothing is known."""
        self._learned[:] = 0.0

    def apply(
        self, target: Float64[np.ndarray, "24"], here: Float64[np.ndarray, "3 3"], *, learns: bool
    ) -> None:
        """Take a tick, and write the acceleration into a pose target beside its rotation."""
        _apply(target, here, self._step if learns else 0.0, self._learned)


@compiled
def _apply(
    target: Float64[np.ndarray, "24"],
    here: Float64[np.ndarray, "3 3"],
    step: float,
    learned: Float64[np.ndarray, "2"],
) -> None:
    """Integrate roll and pitch of log(here^T goal), with the goal from the fourth number on."""
    # Trace and antisymmetric part of the rotation, 1 + 2 cos and 2 sin of its angle.
    trace = x = y = z = 0.0
    for k in range(3):
        a, b, c = here[k, 0], here[k, 1], here[k, 2]
        to_a, to_b, to_c = target[3 + 3 * k], target[4 + 3 * k], target[5 + 3 * k]
        trace += a * to_a + b * to_b + c * to_c
        x, y, z = x + c * to_b - b * to_c, y + a * to_c - c * to_a, z + b * to_a - a * to_b
    sine = math.sqrt(x * x + y * y + z * z)
    if sine > 0.0:
        ratio = math.atan2(sine, trace - 1.0) / sine
        if ratio * math.hypot(x, y) < _THROWN:
            learned[0] = min(max(learned[0] + step * ratio * x, -_MOST), _MOST)
            learned[1] = min(max(learned[1] + step * ratio * y, -_MOST), _MOST)
    for k in range(3):
        target[21 + k] = here[k, 0] * learned[0] + here[k, 1] * learned[1]
