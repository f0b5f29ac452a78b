"""Whether the legs reach where a walk needs them: inverse kinematics before anything moves."""

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import ConfigurationError
from poise.locomotion._walking._footsteps import FootstepPlan, Stand
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._reference import ReferencePoint, WalkReference
from poise.robots import Robot, frame_error, inverse_kinematics

_MISS = 0.01
"""A foot this far from its place, or a joint this far beyond its limit, is out of reach [m, rad]:
the pelvis, taken to go along with the COM, is not known better."""

_STRAIGHT = 0.99
"""Ratio of a straight leg's length that a foothold may use which is moved to catch the robot."""


class LegSpan(NamedTuple):
    """How far a leg goes from its hip to its ankle.

    Attributes:
        length: of the leg, nearly straight [m].
        hip: height of the hip over the ankle, less that of the COM over the sole [m].
    """

    length: float
    hip: float

    def beside(self, height: float) -> float:
        """How far beside its hip a foot stands at most [m].

        Args:
            height: of the COM above that foot [m].
        """
        return math.sqrt(max(self.length**2 - (height + self.hip) ** 2, 0.0))

    def highest(self, beside: float) -> float:
        """How high the COM is above a foot at most [m].

        Args:
            beside: how far that foot is beside its hip [m].
        """
        return math.sqrt(max(self.length**2 - beside**2, 0.0)) - self.hip


class LegReach:
    """Puts a foot where it should stand, with the base where the walk has it.

    Args:
        robot: the robot.
        stand: how it stands at the beginning.
    """

    def __init__(self, robot: Robot, stand: Stand) -> None:
        self._robot, self._stand = robot, stand
        self._model, self._data = robot.model, robot.model.createData()
        pin.framesForwardKinematics(self._model, self._data, stand.q)
        self._frames = [robot.frame_id(name) for name in stand.soles]
        self._chains = [robot.leg_joints(name) for name in stand.soles]
        self._base = pin.XYZQUATToSE3(stand.q[:7])
        self._base_from_com = self._base.translation - np.array(stand.com)
        hip, ankle = (float(self._data.oMi[self._chains[0][k]].translation[2]) for k in (0, -1))
        self._hip_over_com = hip - stand.com[2]
        self._ankle_over_sole = ankle - stand.start[0].position[2]

    def check(self, plan: FootstepPlan, reference: WalkReference) -> None:
        """Looks at every foot of a plan when it comes down and when it leaves.

        Raises:
            ConfigurationError: a foot is out of reach; the message says after which step, and of
                which joint.
        """
        for foot, name in enumerate(plan.soles):
            for begin, end, done in _stands(plan, foot):
                place = plan.placements(done)[foot]
                for time in (begin, end):
                    problem = self._miss(foot, place, reference.at(time))
                    if problem:
                        raise ConfigurationError(
                            f"{name} of robot {self._robot.name!r} is out of reach"
                            f" {f'after step {done}' if done else 'before its first step'}",
                            got=problem,
                            wanted="shorter steps, another width, or more crouch",
                        )

    @property
    def span(self) -> LegSpan:
        """Of the left leg, at the body's posture."""
        neutral = self._model.createData()
        pin.framesForwardKinematics(self._model, neutral, pin.neutral(self._model))
        hip, ankle = (self._chains[0][k] for k in (0, -1))
        straight = np.linalg.norm(neutral.oMi[ankle].translation - neutral.oMi[hip].translation)
        return LegSpan(_STRAIGHT * float(straight), self._hip_over_com - self._ankle_over_sole)

    @property
    def quickness(self) -> float:
        """Acceleration of a foot by the joint that moves it most, at its torque limit [m/s^2].

        With the lever r of that joint and the inertia I of all that it moves, r tau / I.
        """
        model, robot, chain = self._model, self._robot, self._chains[0]
        data, frame = model.createData(), self._frames[0]
        inertia = pin.crba(model, data, self._stand.q)
        pin.computeJointJacobians(model, data, self._stand.q)
        J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
        column = max((model.joints[j].idx_v for j in chain), key=lambda k: abs(float(J[0, k])))
        torque = float(robot.tau_max[column - robot.base_dofs])
        return abs(float(J[0, column])) * torque / float(inertia[column, column])

    def longest_step(self, com_height: float) -> float:
        """How far ahead of the other a foot may come down with the COM half way between [m].

        Args:
            com_height: of the COM above the ground [m].
        """
        return 2.0 * self.span.beside(com_height)

    def _miss(self, foot: int, place: Placement, point: ReferencePoint) -> str:
        """What is wrong with a foot's place at one moment; "" if nothing is."""
        model, data, frame = self._model, self._data, self._frames[foot]
        goal = pin.SE3(pin.utils.rotate("z", place.yaw), np.array(place.position))
        sole = self._robot.soles[self._stand.soles[foot]]
        led = list(sole.controlled)

        def linearize(
            q: Float64[np.ndarray, " nq"],
        ) -> tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, "m nv"]]:
            pin.computeJointJacobians(model, data, q)
            error, J = frame_error(model, data, frame, goal)
            return error[led], J[led]

        q, error = inverse_kinematics(
            model,
            self._with_base_at(point),
            linearize,
            [model.joints[j].idx_v for j in self._chains[foot]],
            tolerance=1e-3,
            damping=1e-6,
            step_max=0.3,
            iterations=25,
        )
        short = float(np.linalg.norm(error[:3]))
        if short > _MISS:
            return f"{short:.3f} m short"
        # A sole that its leg does not turn points where the body does.
        turned = place.yaw - self._stand.start[foot].yaw - float(point.displacement[0, 3])
        aside = 0.0 if sole.turns else abs(turned)
        return f"{aside:.3f} rad aside" if aside > _MISS else self._beyond_limits(foot, q)

    def _with_base_at(self, point: ReferencePoint) -> Float64[np.ndarray, " nq"]:
        """The configuration at the beginning, its base moved with the COM and turned."""
        turn = pin.utils.rotate("z", float(point.displacement[0, 3]))
        position = point.com[0] + turn @ self._base_from_com
        q = self._stand.q.copy()
        q[:7] = pin.SE3ToXYZQUAT(pin.SE3(turn @ self._base.rotation, position))
        return q

    def _beyond_limits(self, foot: int, q: Float64[np.ndarray, " nq"]) -> str:
        """Which joint of a leg is beyond its limits; "" for none."""
        robot, first = self._robot, self._robot.nq - self._robot.nj
        for j in self._chains[foot]:
            k = self._model.joints[j].idx_q - first
            angle, low, high = float(q[first + k]), robot.q_min[k], robot.q_max[k]
            if not low - _MISS <= angle <= high + _MISS:
                name = robot.joint_names[k]
                return f"joint {name!r} at {angle:.2f} of {low:.2f} to {high:.2f} rad"
        return ""


def _stands(plan: FootstepPlan, foot: int) -> list[tuple[float, float, int]]:
    """When a foot stands: from, until, and after how many steps of the plan."""
    stands: list[tuple[float, float, int]] = []
    begin, done = 0.0, 0
    for i, step in enumerate(plan.steps):
        if step.foot == foot:
            stands.append((begin, plan.lift_off(i), done))
            begin, done = plan.touchdown(i), i + 1
    stands.append((begin, plan.duration, done))
    return stands
