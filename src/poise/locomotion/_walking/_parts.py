"""`WalkParts` of a walk, made once, and `LegReach`, which checks a plan before anything moves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import ConfigurationError
from poise.locomotion._pendulum import natural_frequency
from poise.locomotion._support import SingleSupportRegion, single_support_region
from poise.locomotion._walking._body import LOWEST, BodyHeight, BodyMotion, MeasuredPendulum
from poise.locomotion._walking._commands import LegRoom, LegSpan, StepCommands, VelocityLimits
from poise.locomotion._walking._dcm import LegMomentum, StepTimes, leg_ratios
from poise.locomotion._walking._footsteps import FootstepPlan, Gait, Stand
from poise.locomotion._walking._ground import LEVEL, Ground, Placement
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._settings import WalkSettings
from poise.locomotion._walking._stance import CarryingArea, Stance
from poise.locomotion._walking._step_planner import StepPlanner
from poise.locomotion._walking._tasks import WalkTasks, find_walk_tasks
from poise.robots import Robot, frame_error, inverse_kinematics
from poise.stack import Stack

_MISS = 0.01
"""A foot this far from its place, or a joint this far beyond its limit, is out of reach [m, rad]:
the pelvis, taken to go along with the COM, is not known better."""

_STRAIGHT = 0.99
"""Ratio of a straight leg's length that a foothold may use which is moved to catch the robot."""


class LegReach:
    """Puts a foot where it should stand, with the base where the walk has it."""

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

    def check(self, plan: FootstepPlan, height: float) -> None:
        """Check both feet of a plan at each touchdown and the next lift-off."""
        leaves = 0.5 + plan.gait.double_support / plan.gait.step_time
        for done in range(plan.count + 1):
            places = plan.placements(done)
            landed = plan.steps[max(done - 1, 0)].foot
            for way in (0.5, leaves):
                base = self._base_between(places, landed, way, height)
                for foot, name in enumerate(plan.soles):
                    problem = self._miss(foot, places[foot], base)
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
        """Acceleration of a foot by the joint that moves it most, at its torque limit [m/s^2]."""
        model, robot, chain = self._model, self._robot, self._chains[0]
        data, frame = model.createData(), self._frames[0]
        inertia = pin.crba(model, data, self._stand.q)
        pin.computeJointJacobians(model, data, self._stand.q)
        J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
        column = max((model.joints[j].idx_v for j in chain), key=lambda k: abs(float(J[0, k])))
        torque = float(robot.tau_max[column - robot.base_dofs])
        return abs(float(J[0, column])) * torque / float(inertia[column, column])

    def _base_between(
        self, places: tuple[Placement, Placement], landed: int, way: float, height: float
    ) -> pin.SE3:
        """Return the base pose with the CoM between two feet."""
        behind, ahead = places[1 - landed].position, places[landed].position
        x, y = (a + way * (b - a) for a, b in zip(behind[:2], ahead[:2], strict=True))
        com = np.array((x, y, min(behind[2], ahead[2]) + height))
        before = 0.5 * sum(place.yaw for place in self._stand.start)
        turn = pin.utils.rotate("z", 0.5 * (places[0].yaw + places[1].yaw) - before)
        return pin.SE3(turn @ self._base.rotation, com + turn @ self._base_from_com)

    def _miss(self, foot: int, place: Placement, base: pin.SE3) -> str:
        """Return the fault of a foot's place at one moment; "" for none."""
        model, data, frame = self._model, self._data, self._frames[foot]
        goal = pin.SE3(pin.utils.rotate("z", place.yaw), np.array(place.position))
        sole = self._robot.soles[self._stand.soles[foot]]
        led = list(sole.controlled)

        def linearize(
            q: Float64[np.ndarray, " nq"],
        ) -> list[tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, "m nv"]]]:
            pin.computeJointJacobians(model, data, q)
            error, J = frame_error(model, data, frame, goal)
            return [(error[led], J[led])]

        q = self._stand.q.copy()
        q[:7] = pin.SE3ToXYZQUAT(base)
        q, ((error, _),) = inverse_kinematics(
            model,
            q,
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
        turn = pin.log3(base.rotation @ self._base.rotation.T)[2]
        aside = 0.0 if sole.turns else abs(place.yaw - self._stand.start[foot].yaw - float(turn))
        return f"{aside:.3f} rad aside" if aside > _MISS else self._beyond_limits(foot, q)

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


_TURN, _TURN_IN = 0.8, 0.12
"""Most that a foot is turned outwards and inwards against the other one [rad]."""

_WIDE = 0.75
"""Farthest that feet stand apart, over the height of the COM."""

_REACH = 0.85
"""Part of the longest step, both legs straight, that a foot may use."""


@dataclass(frozen=True, kw_only=True)
class WalkParts:
    """Parts of a walk."""

    stand: Stand  # how the robot stands before it begins
    gait: Gait  # timing and shape of a step
    settings: WalkSettings  # feedback and touchdown
    ground: Ground  # what it walks on
    height: float  # of the COM over the soles while it walks [m]
    room: LegRoom  # where feet may go
    legs: LegMomentum  # the pendulum, with the momentum of its legs
    commands: StepCommands
    tasks: WalkTasks  # what is set of the stack
    sense: WalkSense  # COM and soles, as they are
    areas: Sequence[CarryingArea]  # what of each sole carries
    planner: StepPlanner  # of the next footholds
    stance: Stance  # where the feet stand
    body: BodyMotion  # where the COM and what goes along with it should be
    rise: BodyHeight  # how high the body goes
    pendulum: MeasuredPendulum  # as it is
    region: SingleSupportRegion  # of one foot, while the other one is held


def make_parts(
    robot: Robot,
    stack: Stack,
    stand: Stand,
    gait: Gait,
    settings: WalkSettings,
    limits: VelocityLimits,
    ground: Ground,
    carry: Sequence[str] | None,
    sense: WalkSense | None = None,
) -> WalkParts:
    """The parts of a walk, for one robot and stack, with a sense of its own if none is given."""
    height = stand.com[2] - stand.middle[2] - gait.crouch
    ratios = leg_ratios(robot, stand.q, stand.soles)
    legs = LegMomentum(ratios.ahead, natural_frequency(height))
    reach = LegReach(robot, stand)
    if isinstance(stand, FootstepPlan):
        reach.check(stand, height)
    turns = all(robot.soles[sole].turns for sole in stand.soles)
    room = LegRoom(
        sizes=stand.sizes,
        width=gait.width or stand.width,
        clearance=settings.clearance,
        ahead=_REACH * 2.0 * reach.span.beside(height),
        far=_REACH * 2.0 * reach.span.beside(LOWEST * height),
        wide=_WIDE * height,
        turn=_TURN if turns else 0.0,
        turn_in=_TURN_IN if turns else 0.0,
        quickness=reach.quickness,
    )
    if gait.width is not None:
        _check_width(gait.width, room, stand)
    commands = StepCommands(limits, room, gait.step_time, ground)
    tasks = find_walk_tasks(robot, stand, stack, carry)
    sense = WalkSense(robot, stand.soles) if sense is None else sense
    areas = [CarryingArea(sense, foot, contact) for foot, contact in enumerate(tasks.contacts)]
    times = StepTimes(gait.swing_time, gait.double_support)
    stance = Stance(sense, stand, settings.zmp_margin, areas)
    body = BodyMotion(stand, gait.crouch, gait.shift_time, legs.omega, tasks.carried)
    return WalkParts(
        stand=stand,
        gait=gait,
        settings=settings,
        ground=ground,
        height=height,
        room=room,
        legs=legs,
        commands=commands,
        tasks=tasks,
        sense=sense,
        areas=areas,
        planner=StepPlanner(commands, room, legs, times, settings.zmp_margin, stand),
        stance=stance,
        body=body,
        rise=BodyHeight(sense, stand, reach.span, gait, height),
        pendulum=MeasuredPendulum(legs, ratios.rise, sense, stance, body),
        region=single_support_region(robot, natural_frequency(height), settings.zmp_margin),
    )


def _check_width(width: float, room: LegRoom, stand: Stand) -> None:
    """Raises ConfigurationError if feet side by side would touch, or never get so far apart."""
    least, most = min(room.near(0.0), stand.width), room.wide
    # To the millimetre, as it is said.
    if not least - LEVEL <= width <= most + LEVEL:
        raise ConfigurationError(
            "feet as far apart as the gait says touch each other, or are out of reach",
            got=f"width {width:.3f} m",
            wanted=f"{least:.3f} to {most:.3f} m, or None for as they stand",
        )
