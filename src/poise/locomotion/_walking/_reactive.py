"""`ReactiveWalker`: walks by velocities and footholds that are given while it walks."""

import math
from collections.abc import Mapping, Sequence
from enum import Enum

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise.dynamics import RobotState
from poise.locomotion._pendulum import natural_frequency
from poise.locomotion._support import Point
from poise.locomotion._walking._body import BodyMotion
from poise.locomotion._walking._commands import LegRoom, StepCommands, VelocityLimits, side
from poise.locomotion._walking._dcm_plan import (
    DcmMotion,
    StepTimes,
    hermite_step,
)
from poise.locomotion._walking._feedback import DcmFeedback
from poise.locomotion._walking._flight import Flight, sinking_phase
from poise.locomotion._walking._footsteps import (
    FootstepPlan,
    Gait,
    level_floor,
    stand_of,
    usual_gait,
)
from poise.locomotion._walking._ground import Ground, Placement
from poise.locomotion._walking._leg_momentum import FeetAt, JoinedSupport, LegMomentum, leg_ratios
from poise.locomotion._walking._reach import LegReach
from poise.locomotion._walking._sense import (
    ENGAGE,
    LONGEST_TICK,
    RELEASE,
    WalkSense,
    expect_step,
)
from poise.locomotion._walking._settings import WalkSettings, WalkStatus
from poise.locomotion._walking._stance import Stance
from poise.locomotion._walking._step_planner import QUICK, Lifted, StepPlanner
from poise.locomotion._walking._swing import SwingFoot
from poise.locomotion._walking._swing_shape import led_swing
from poise.locomotion._walking._tasks import CarriedTarget, find_walk_tasks
from poise.locomotion._walking._trouble import RESPONSES, Hanging, Response, TroubleWatch
from poise.robots import Robot
from poise.stack import Stack, Task


class Phase(Enum):
    """What the feet do."""

    STAND = "stand"
    """Both carry the robot, and stay."""
    SHIFT = "shift"
    """Both carry it, and one is about to be lifted."""
    SWING = "swing"
    """One is in the air."""


_WORTH = 0.5
"""A foot stays where it is while both hold the robot and its step would cost more than this."""

_CALM = 0.01
"""The divergent component has to be this far inside what holds it for the feet to stay [m]."""

_HOVERING, _BOUNCE_TIME, _BOUNCES = 0.01, 0.01, 0.15
"""A foot that carries less than this part of the weight for so long [s], not later than this after
it landed [s], has not landed."""

_TURN, _TURN_IN = 0.6, 0.12
"""Most that a foot is turned outwards and inwards against the other one [rad]."""

_WIDE = 0.75
"""Farthest that feet stand apart, over the height of the COM."""

_REACH = 0.85
"""Part of the longest step, both legs straight, that a foot may use."""

_LOWEST = 0.9
"""Part of its height to which the COM goes down so that a leg reaches where it catches the
robot."""

_FALL = 1.0
"""Over a way down, the square of the time that the body takes for it [s^2/m]: with the least jerk,
its weight is never less than 0.4 of what it is."""

_SOONEST = 0.06
"""It takes this long at least [s]."""

_BODY_TIME = 0.25
"""The body turns and rises no faster than it takes for a goal this far away [s]."""


class ReactiveWalker:
    """Walks as it is told, now: a `poise.stack.Leader`.

    Where `Walker` follows a plan that was made before it began, this one is led by `set_velocity`
    and `step_to` while it walks. The next footholds are made anew in every tick from what is asked
    for, and from them, by backward recursion, where the divergent component of motion should be.
    While a foot is in the air, place and time of its touchdown are chosen from the measured one.
    Standing, the robot steps by itself when its feet cannot hold it, and comes back to rest side by
    side.

    It sets the same targets and contacts of a stack as `Walker`, and never raises while it runs:
    what is cut of a command is said by `notice`, what goes wrong by `status`.

    Args:
        robot: on two soles.
        stack: the controller's: a `ComTask` of all axes, a `FrameTask` of the pose of each sole,
            and a contact on each.
        gait: timing and shape of every step; by the robot's size when None.
        settings: feedback and touchdown.
        limits: of velocities.
        q: how the robot stands, in its home posture when None; it may begin anywhere.
        ground: what it walks on; a floor as high as its soles when None.
        carry: names of frame tasks that go along with the body; all that are on no sole when None.

    Attributes:
        stack: what it leads.
        gait: timing and shape of a step.
        settings: feedback and touchdown.
        limits: of velocities.
        status: how the walk stands.
        phase: what the feet do.
        steps_made: how many steps are behind.
        carried: targets that go along with the body, by the name of their task.

    Raises:
        ConfigurationError: the stack lacks something, or the robot does not stand on two soles.
        UnknownNameError: no such frame task to carry.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        gait: Gait | None = None,
        settings: WalkSettings | None = None,
        limits: VelocityLimits | None = None,
        *,
        q: Numbers | None = None,
        ground: Ground | None = None,
        carry: Sequence[str] | None = None,
    ) -> None:
        self.stack, self.settings = stack, settings or WalkSettings()
        self.limits = limits or VelocityLimits()
        stand = self._standing = stand_of(robot, q)
        standing_height = stand.com[2] - stand.middle[2]
        self.gait = gait or usual_gait(standing_height)
        self.height = standing_height - self.gait.crouch
        ratios = leg_ratios(robot, stand.q, stand.soles)
        self._legs = LegMomentum(ratios.ahead, natural_frequency(self.height))
        self._rise_ratio = ratios.rise
        self.ground = ground or level_floor(stand.start)
        reach = LegReach(robot, stand)
        self._span = reach.span
        turns = all(robot.soles[sole].turns for sole in stand.soles)
        self._room = LegRoom(
            sizes=stand.sizes,
            width=self.gait.width or stand.width,
            clearance=FootstepPlan.clearance,
            ahead=_REACH * 2.0 * self._span.beside(self.height),
            far=_REACH * 2.0 * self._span.beside(_LOWEST * self.height),
            wide=_WIDE * self.height,
            turn=_TURN if turns else 0.0,
            turn_in=_TURN_IN if turns else 0.0,
            quickness=reach.quickness,
        )
        self.commands = StepCommands(self.limits, self._room, self.gait.step_time, self.ground)
        stack.bind(robot)
        self._tasks = find_walk_tasks(robot, stand, stack, carry)
        self.carried: dict[str, CarriedTarget] = self._tasks.carried
        self._sense = WalkSense(robot, stand.soles)
        self._feedback = DcmFeedback(self._legs.omega, self.settings.dcm_gain)
        self._sinking = sinking_phase(self.settings, self.gait)
        times = StepTimes(self.gait.swing_time, self.gait.double_support)
        margin = self.settings.zmp_margin
        self._planner = StepPlanner(self.commands, self._room, self._legs, times, margin, stand)
        self._stance = Stance(self._sense, stand, margin)
        self._body = BodyMotion(stand, self.gait.crouch, self._legs.omega, self.carried)
        self.status, self.phase, self.steps_made = WalkStatus.READY, Phase.STAND, 0
        self._time: float | None = None
        self._foot = 0
        self._watch = TroubleWatch(self._sense, self.settings, self.height)
        self._hanging: Hanging | None = None
        self._flight: Flight | None = None
        self._landed: Flight | None = None
        self._hovering = self._stood = 0.0
        self._released = self._hurried = False
        self._left = 0.0
        self._dcm: tuple[DcmMotion, DcmMotion] = ((0.0, 0.0), (0.0, 0.0))

    # What somebody who leads it says --------------------------------------------------------------

    def set_velocity(self, ahead: float, sideways: float = 0.0, turn: float = 0.0) -> None:
        """Walks with a velocity from now on; zero brings the robot to rest, feet side by side.

        Args:
            ahead: [m/s].
            sideways: to the left [m/s].
            turn: to the left [rad/s].
        """
        self.commands.set_velocity(ahead, sideways, turn)

    def step_to(self, sole: str, x: float, y: float, yaw: float) -> None:
        """Makes a step, after those that were asked for before.

        Args:
            sole: its name.
            x: of the sole's centre in the world [m].
            y: likewise [m].
            yaw: its heading [rad].
        """
        if sole not in self._standing.soles:
            self.commands.notice = f"foothold of {sole!r} ignored: no sole of this robot"
            return
        foot = self._standing.soles.index(sole)
        self.commands.add_foothold(foot, Placement(position=(x, y, 0.0), yaw=yaw))

    @property
    def notice(self) -> str:
        """What was cut or ignored of the last command; "" for nothing."""
        return self.commands.notice

    # What a recorder may know ---------------------------------------------------------------------

    @property
    def lifting(self) -> tuple[int, bool] | None:
        """Which foot is being lifted, 0 for the left one, and whether it is in the air."""
        if self.phase is Phase.STAND:
            return None
        return self._foot, self.phase is Phase.SWING

    @property
    def dcm_error(self) -> Float64[np.ndarray, "2"]:
        """How far the divergent component of motion is from its reference [m]."""
        return self._feedback.error

    @property
    def zmp(self) -> Float64[np.ndarray, "2"]:
        """Where the ZMP should be, feedback included [m]."""
        feet, _, _ = self._feet_at()
        x, y = self._feedback.zmp.tolist()
        return np.array(self._legs.parted((x, y), feet))

    def signals(self) -> Mapping[str, Float64[np.ndarray, " n"] | float | str]:
        """What a recorder should know of the last tick."""
        return {
            "zmp_reference": self.zmp.copy(),
            "velocity_command": np.array(self.commands.velocity),
            "mode": f"walk {self.status.value}",
            "notice": self.notice,
        }

    def leads(self, task: Task) -> bool:
        """Whether the walk sets a task's target by itself: the COM's and the feet's."""
        return task is self._tasks.com or task in self._tasks.feet

    def holds(self, contact: str) -> bool:
        """Whether the walk loads and unloads a contact of that name."""
        return any(contact == c.name for c in self._tasks.contacts)

    # A tick ---------------------------------------------------------------------------------------

    def lead(self, state: RobotState) -> None:
        """Sets what the next tick should do.

        Args:
            state: of the robot; one that is not finite is passed over.
        """
        if not math.isfinite(float(state.q.sum()) + float(state.v.sum())):
            return
        dt = 0.0 if self._time is None else min(max(state.time - self._time, 0.0), LONGEST_TICK)
        self._sense.update(state, dt)
        self._time = state.time
        if self.status is WalkStatus.READY:
            self._begin()
        if self._is_stopped_by_trouble(state, dt):
            return
        self.commands.advance(dt)
        if self.phase is Phase.STAND:
            self._stand(dt)
        elif self.phase is Phase.SHIFT:
            self._shift(dt)
        elif self._flight is not None:
            self._fly(self._flight, state, dt)
        if self._landed is not None:
            self._confirm(self._landed, state, dt)
        self._keep_balance(dt)
        if self.status.ok:
            self.status = self._plain_status
        self._announce_step()

    def _is_stopped_by_trouble(self, state: RobotState, dt: float) -> bool:
        """Does what `RESPONSES` says."""
        error = math.hypot(*self._feedback.error)
        trouble = self._watch.look(state, self._flight, error, dt)
        self.status = trouble or self._plain_status
        response = Response() if trouble is None else RESPONSES[trouble]
        self.commands.pace = response.pace
        if response.lands and self._flight is not None:
            self._flight.land()
        if response.hangs:
            self._hang(state)
        elif self._hanging is not None:
            self._hanging.end()
            self._hanging = None
            self._begin()
        return response.hangs

    @property
    def _plain_status(self) -> WalkStatus:
        return WalkStatus.STANDING if self.phase is Phase.STAND else WalkStatus.WALKING

    def _hang(self, state: RobotState) -> None:
        """Asks for nothing but that the robot stays as it is, wherever it is taken."""
        if self._hanging is None:
            self._hanging = Hanging(state, self._sense, self._tasks)
            self.phase, self._flight, self._landed = Phase.STAND, None, None
            self._hurried = False
            # Put down again, it stands until somebody says something else.
            self.commands.stop()
        self._hanging.follow(state, self._body, self._measured()[0])
        self._announce_step()

    def _announce_step(self) -> None:
        """Tells the balance limit of the stack where the next step catches the robot."""
        limit = self.stack.balance_limit
        if not limit.enabled:
            return
        if self.phase is Phase.STAND:
            limit.expect_step(None)
            return
        if self._flight is not None:
            goal = self._flight.goal
        else:
            goal = self.commands.steps(self._foot, self._standing_foot, 1)[0]
        size = self._standing.sizes[self._foot]
        expect_step(limit, goal.position, goal.yaw, size, self.settings.adjust)

    def _feet_at(self) -> tuple[FeetAt, FeetAt, FeetAt]:
        """Positions [m], velocities [m/s] and accelerations [m/s^2] of both feet."""
        still = (0.0, 0.0)
        rows = [[place.position[:2], still, still] for place in self._stance.feet]
        if self._flight is not None:
            rows[self._foot] = self._swing_motion(self._flight.swing)
        (a, va, aa), (b, vb, ab) = rows
        return (a, b), (va, vb), (aa, ab)

    def _swing_motion(self, swing: SwingFoot) -> list[Point]:
        """Position, velocity and acceleration of the foot in the air; see `LegRatios.rise`."""
        c, s = (self._rise_ratio * f(self._body.heading[0]) for f in (math.cos, math.sin))
        x, y, z = swing.position.tolist()
        z -= self._standing_foot.position[2]
        motion = [(x + c * z, y + s * z)]
        for rate in (swing.velocity, swing.acceleration):
            x, y, z = rate[:3].tolist()
            motion.append((x + c * z, y + s * z))
        return motion

    def _measured(self) -> tuple[Point, Point]:
        """C and its velocity, see `LegMomentum`."""
        feet, velocities, _ = self._feet_at()
        (x, y, _), (vx, vy, _) = self._sense.com.tolist(), self._sense.com_velocity.tolist()
        return self._legs.joined((x, y), feet), self._legs.joined((vx, vy), velocities)

    def _xi(self) -> Point:
        """The measured divergent component [m]."""
        (x, y), (vx, vy) = self._measured()
        return x + vx / self._legs.omega, y + vy / self._legs.omega

    def _is_held(self, margin: float = 0.0) -> bool:
        """Whether the feet as they stand can bring the divergent component to rest.

        Args:
            margin: how far inside the soles' edges, and the margin of the ZMP, it has to be [m].
        """
        feet, _, _ = self._feet_at()
        return self._stance.support.depth(self._legs.parted(self._xi(), feet)) >= margin

    def _begin(self) -> None:
        self.status = WalkStatus.STANDING
        self._feedback.error = np.zeros(2)
        stance = self._stance
        stance.stand_on((0, 1), self._sense.placement(0).yaw)
        mass, _ = self._measured()
        self._dcm = ((mass[0], 0.0), (mass[1], 0.0))
        self._body.begin(mass, float(self._sense.com[2]), stance.heading)
        self._left = self.gait.shift_time

    def _stand_on(self, *feet: int) -> None:
        """These feet carry the robot from now on."""
        self._stance.stand_on(feet, self._body.heading[0])

    # Both feet on the ground ----------------------------------------------------------------------

    def _stand(self, dt: float) -> None:
        self._left = max(self._left - dt, 0.0)
        x, y = self._standing.rest(self._stance.feet)
        self._lead_dcm(((x, 0.0), (y, 0.0)), self._left, dt)
        if not self._is_held():
            self._hurry()
        elif self.commands.moving:
            self._go(self.commands.first_foot(), self.gait.shift_time)
        elif self.commands.closes and not self._is_closed() and self._left == 0.0:
            self._go(0, self.gait.shift_time)

    def _is_closed(self) -> bool:
        return self._stance.closed(self._room.width)

    def _go(self, foot: int, time: float) -> None:
        """A foot is to be lifted in a while [s]."""
        self.phase, self._foot, self._left, self._released = Phase.SHIFT, foot, time, False

    def _hurry(self) -> None:
        """A foot is to be lifted at once, so that the robot does not fall."""
        left, right = self._stance.feet
        self._go(self._planner.better_foot((left, right), self._xi()), QUICK)
        self._hurried = True
        # The ZMP has to be in the foot that stays; going there evenly would take too long.
        self._stand_on(1 - self._foot)

    def _shift(self, dt: float) -> None:
        """Takes the load off a foot, and lifts it when it is due."""
        self._left -= dt
        foot, contact = self._foot, self._tasks.contacts[self._foot]
        if self._left > QUICK and not self._released and not self._is_held():
            self._hurry()
            foot, contact = self._foot, self._tasks.contacts[self._foot]
        if not self._hurried:
            planner = self._planner
            lift_off = planner.on_the_way(planner.plan(self._next_foot()), planner.times.swing)
            self._lead_dcm(lift_off, self._left, dt)
        ramp = min(RELEASE * self.gait.double_support, QUICK)
        if not self._released and self._left <= ramp:
            if self._is_held() and self._planner.cost(self._next_foot()) > _WORTH:
                self._left = ramp
                return
            contact.release(ramp)
            self._released = True
            # The tick that finds the contact gone comes before the next state: it holds the foot.
            self._tasks.feet[foot].set_target(*self._sense.sole(foot))
        if self._left <= 0.0 and not contact.active:
            self._lift(foot)

    def _next_foot(self) -> Lifted:
        """The foot that comes down next, in the air or not yet."""
        x, y, _ = self._stance.feet[self._foot].position
        elapsed = 0.0
        if self._flight is not None:
            elapsed = self._flight.elapsed
            x, y, _ = self._flight.swing.position.tolist()
        return Lifted(self._foot, (x, y), self._standing_foot, self._xi(), elapsed)

    @property
    def _standing_foot(self) -> Placement:
        """Where the foot stands that stays."""
        return self._stance.feet[1 - self._foot]

    def _lead_dcm(self, goal: tuple[DcmMotion, DcmMotion], left: float, dt: float) -> None:
        """Moves the reference on, to be at a goal in a while."""
        x, y = (hermite_step(a, b, left, dt) for a, b in zip(self._dcm, goal, strict=True))
        self._dcm = (x, y)

    # One foot in the air --------------------------------------------------------------------------

    def _lift(self, foot: int) -> None:
        self._landed = None
        self._stand_on(1 - foot)
        goal = self.commands.steps(foot, self._standing_foot, 1)[0]
        begin, size = self._sense.placement(foot), self._standing.sizes[foot]
        shape = led_swing(begin, goal, size, self.gait.swing_height, self.ground, self._sinking)
        self._flight = Flight(
            foot,
            self._sense,
            goal,
            shape,
            self._planner,
            self.commands,
            self.settings,
            self._sinking,
        )
        self.phase = Phase.SWING
        if self._hurried:
            self._aim(self._flight, math.inf)
        self._hurried = False

    def _fly(self, flight: Flight, state: RobotState, dt: float) -> None:
        flight.count(dt)
        self._aim(flight, dt)
        flight.advance(dt)
        swing = flight.swing
        if self._sense.is_down(swing, state, flight.foot, self.settings):
            self._land(flight.foot)
            return
        self._tasks.lead_foot(self._sense, flight.foot, swing)

    def _confirm(self, flight: Flight, state: RobotState, dt: float) -> None:
        """A foot that has bounced off what it met looks for the ground again."""
        self._stood += dt
        if self._stood > _BOUNCES:
            self._landed = None
            return
        load = self._sense.load(state, flight.foot)
        self._hovering = 0.0 if load > _HOVERING else self._hovering + dt
        if self._hovering < _BOUNCE_TIME:
            return
        self._tasks.contacts[flight.foot].release(0.0)
        self._tasks.contacts[1 - flight.foot].engage(0.0)
        self._foot, self._flight, self._landed = flight.foot, flight, None
        self.phase, self._released, self._hurried = Phase.SWING, False, False
        flight.swing.search_again()
        self.steps_made -= 1
        self._stand_on(1 - flight.foot)

    def _aim(self, flight: Flight, dt: float) -> None:
        """Chooses the touchdown, and where the divergent component should be now."""
        planner, lifted = self._planner, self._next_foot()
        pendulum = planner.plan(lifted, self._swing_motion(flight.swing)[0])
        flight.aim(lifted, pendulum, dt)
        pendulum = planner.moved(lifted, pendulum, flight.goal.position[:2])
        self._dcm = planner.on_the_way(pendulum, flight.left)

    def _land(self, foot: int) -> None:
        self._tasks.contacts[foot].engage(ENGAGE * self.gait.double_support)
        self._landed, self._hovering, self._stood = self._flight, 0.0, 0.0
        self._flight = None
        self.steps_made += 1
        commands = self.commands
        if commands.footholds and commands.footholds[0][0] == foot:
            commands.footholds.popleft()
        self._stand_on(0, 1)
        opened = commands.closes and not self._is_closed()
        if commands.moving or opened or not self._is_held(_CALM):
            following = commands.next_foot(foot)
            again = following == foot
            self._go(following, self.gait.shift_time if again else self.gait.double_support)
        else:
            self.phase, self._left = Phase.STAND, self.gait.settle_time

    # Balance and body -----------------------------------------------------------------------------

    def _keep_balance(self, dt: float) -> None:
        self._move_body(dt)
        com = self._body.follow(self._dcm, dt)
        feet, velocities, accelerations = self._feet_at()
        joined, velocity = self._measured()
        x, y = self._feedback.acceleration(
            np.array(joined),
            np.array(velocity),
            com,
            JoinedSupport(self._legs, self._stance.support, feet),
        ).tolist()
        rows = zip(com.tolist(), (feet, velocities, accelerations), self._body.rise, strict=True)
        com = np.array([(*self._legs.parted((a, b), f), z) for (a, b), f, z in rows])
        asked = self._legs.parted((x, y), accelerations)
        self._tasks.lead_com(self._sense, com, np.array(asked))
        self._body.carry(com)

    def _move_body(self, dt: float) -> None:
        """Height and heading of the body, towards what the next stand asks for."""
        left, right = self._stance.feet
        low, yaw, time = min(left.position[2], right.position[2]), self._stance.heading, 0.0
        feet = [left, right]
        if self._flight is not None:
            foot, flight = self._standing_foot, self._flight
            # A foot that looks for the ground takes the body down with it.
            sought = min(flight.goal.position[2], float(flight.swing.position[2]))
            low, yaw = min(foot.position[2], sought), 0.5 * (foot.yaw + flight.goal.yaw)
            time, feet[self._foot] = flight.left, flight.goal
        height = self._reached_height(feet, low, yaw, time)
        drop = self._body.rise[0] - height
        if drop > 0.0 and height < low + self.height:
            time = max(time, math.sqrt(_FALL * drop), _SOONEST)
        else:
            time = max(time + 0.5 * self.gait.double_support, _BODY_TIME)
            if self.steps_made == 0:
                time = max(time, self.gait.shift_time)
        self._body.move(height, yaw, time, dt)

    def _reached_height(
        self, feet: Sequence[Placement], low: float, yaw: float, time: float
    ) -> float:
        """Height of the COM in the world at which both legs will reach their feet [m].

        Args:
            feet: where they stand then.
            low: height of the lower one [m].
            yaw: of the body then [rad].
            time: until then [s].
        """
        (x, y, _), (vx, vy, _) = self._sense.com.tolist(), self._sense.com_velocity.tolist()
        x, y, out = x + time * vx, y + time * vy, 0.5 * self._standing.width
        height = low + self.height
        for foot, place in enumerate(feet):
            aside = side(foot) * out
            hip = (x - math.sin(yaw) * aside, y + math.cos(yaw) * aside)
            highest = self._span.highest(math.dist(hip, place.position[:2]))
            height = min(height, place.position[2] + highest)
        return max(height, low + _LOWEST * self.height)
