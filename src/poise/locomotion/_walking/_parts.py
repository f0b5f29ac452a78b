"""`WalkParts`: parts of a walk, constructed once."""

from collections.abc import Sequence
from dataclasses import dataclass

from poise.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.locomotion._pendulum import natural_frequency
from poise.locomotion._support import SingleSupportRegion, single_support_region
from poise.locomotion._walking._body import LOWEST, BodyHeight, BodyMotion, MeasuredPendulum
from poise.locomotion._walking._commands import StepCommands, VelocityLimits
from poise.locomotion._walking._dcm import LegMomentum, StepTimes, leg_ratios
from poise.locomotion._walking._footsteps import FootstepPlan, Gait, Stand
from poise.locomotion._walking._ground import LEVEL, Ground
from poise.locomotion._walking._legs import LegRoom, check_reach, measure_leg
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._settings import WalkSettings
from poise.locomotion._walking._stance import CarryingArea, Stance
from poise.locomotion._walking._step_planner import StepPlanner
from poise.locomotion._walking._tasks import WalkTasks, find_walk_tasks
from poise.robots import Robot
from poise.stack import Stack

_TURN, _TURN_IN = 0.8, 0.12
"""Most that a foot is turned outwards and inwards against the other one [rad]."""

_WIDE = 0.75
"""Farthest that feet stand apart, over the height of the CoM."""

_REACH = 0.85
"""Part of the longest step, both legs straight, that a foot may use."""


@dataclass(frozen=True, kw_only=True)
class WalkParts:
    """Parts of a walk."""

    stand: Stand  # how the robot stands before it begins
    gait: Gait  # timing and shape of a step
    settings: WalkSettings  # feedback and touchdown
    ground: Ground  # what it walks on
    height: float  # of the CoM over the soles while it walks [m]
    room: LegRoom  # where feet may go
    legs: LegMomentum  # the pendulum, with the momentum of its legs
    commands: StepCommands
    tasks: WalkTasks  # what is set of the stack
    sense: WalkSense  # CoM and soles, as they are
    areas: Sequence[CarryingArea]  # what of each sole carries
    planner: StepPlanner  # of the next footholds
    stance: Stance  # where the feet stand
    body: BodyMotion  # where the CoM and the targets that move with it should be
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
    if isinstance(stand, FootstepPlan):
        check_reach(robot, stand, height)
    leg = measure_leg(Dynamics(robot), stand.soles[0], stand.q)
    turns = all(robot.soles[sole].turns for sole in stand.soles)
    room = LegRoom(
        sizes=stand.sizes,
        width=gait.width or stand.width,
        clearance=settings.clearance,
        ahead=_REACH * 2.0 * leg.beside(height),
        far=_REACH * 2.0 * leg.beside(LOWEST * height),
        wide=_WIDE * height,
        turn=_TURN if turns else 0.0,
        turn_in=_TURN_IN if turns else 0.0,
        quickness=leg.quickness,
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
        rise=BodyHeight(sense, stand, leg, gait, height),
        pendulum=MeasuredPendulum(legs, ratios.rise, sense, stance, body),
        region=single_support_region(robot, natural_frequency(height), settings.zmp_margin),
    )


def _check_width(width: float, room: LegRoom, stand: Stand) -> None:
    """Raises ConfigurationError if feet side by side would touch, or never get so far apart."""
    least, most = min(room.near(0.0), stand.width), room.wide
    # Rounded to the millimetre, as in the message.
    if not least - LEVEL <= width <= most + LEVEL:
        raise ConfigurationError(
            "feet as far apart as the gait says touch each other, or are out of reach",
            got=f"width {width:.3f} m",
            wanted=f"{least:.3f} to {most:.3f} m, or None for as they stand",
        )
