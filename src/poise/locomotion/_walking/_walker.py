"""`Walker`: walks along a plan, or by velocities and footholds that are given while it walks."""

import math
from collections.abc import Mapping, Sequence
from enum import Enum

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.locomotion._pendulum import natural_frequency
from poise.locomotion._support import SolePart
from poise.locomotion._walking._body import BodyMotion
from poise.locomotion._walking._body_height import LOWEST, BodyHeight
from poise.locomotion._walking._carrying import CarryingArea
from poise.locomotion._walking._commands import (
    Foothold,
    LegRoom,
    StepCommands,
    VelocityLimits,
)
from poise.locomotion._walking._dcm_plan import (
    REST_TIME,
    DcmMotion,
    StepTimes,
    hermite_step,
)
from poise.locomotion._walking._feedback import DcmFeedback
from poise.locomotion._walking._flight import Flight
from poise.locomotion._walking._footsteps import (
    FootstepPlan,
    Gait,
    level_floor,
    stand_of,
    usual_gait,
)
from poise.locomotion._walking._ground import Ground, Placement
from poise.locomotion._walking._leg_momentum import JoinedSupport, LegMomentum, leg_ratios
from poise.locomotion._walking._measured_pendulum import MeasuredPendulum
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
from poise.locomotion._walking._step_planner import AHEAD, QUICK, Lifted, StepPlanner
from poise.locomotion._walking._swing_shape import led_swing
from poise.locomotion._walking._tasks import CarriedTarget, find_walk_tasks
from poise.locomotion._walking._trouble import RESPONSES, Hanging, HangWatch, Response, TroubleWatch
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


_MISPLACED = 0.03
"""How far a sole may be from where a plan begins [m]."""


class Walker:
    """Walks as it is told, now: a `poise.stack.Leader`.

    Its steps come from a plan that was made before it began, or it is led by `set_velocity` and
    `step_to` while it walks. The next footholds are made anew in every tick from what is asked
    for, and from them, by backward recursion, where the divergent component of motion should be.
    While a foot is in the air, place and time of its touchdown are chosen from the measured one.
    Standing, the robot steps by itself when its feet cannot hold it, and comes back to rest side by
    side.

    It only sets targets of tasks and loads of contacts of the stack: the COM task (its target, and
    the acceleration that keeps the balance), the frame task of the foot in the air, the contacts of
    both soles, and every other frame task, which goes along with the body. It never raises while it
    runs: what is cut of a command is said by `notice`, what goes wrong by `status`.

    Args:
        robot: on two soles.
        stack: the controller's: a `ComTask` of all axes, a `FrameTask` of the pose of each sole,
            and a contact on each.
        gait: timing and shape of every step; by the robot's size when None.
        settings: feedback and touchdown.
        limits: of velocities.
        plan: footholds to begin with, each of them exact unless the robot has to be caught. It has
            its own gait, posture and ground, and the robot has to stand where it begins.
        q: how the robot stands, in its home posture when None; it may begin anywhere.
        ground: what it walks on; a floor as high as its soles when None.
        carry: names of frame tasks that go along with the body; all that are on no sole when None.

    Attributes:
        stack: what it leads.
        plan: with which it began.
        gait: timing and shape of a step.
        settings: feedback and touchdown.
        limits: of velocities.
        status: how the walk stands.
        phase: what the feet do.
        steps_made: how many steps are behind.
        carried: targets that go along with the body, by the name of their task.

    Raises:
        ConfigurationError: the stack lacks something, the robot does not stand on two soles, or a
            leg does not reach where the plan wants it.
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
        plan: FootstepPlan | None = None,
        q: Numbers | None = None,
        ground: Ground | None = None,
        carry: Sequence[str] | None = None,
    ) -> None:
        self.stack, self.settings = stack, settings or WalkSettings()
        self.limits = limits or VelocityLimits()
        if plan is not None:
            _check_alone(gait, q, ground)
            gait, ground = plan.gait, plan.ground
        self.plan = plan
        stand = self._standing = plan or stand_of(robot, q)
        standing_height = stand.com[2] - stand.middle[2]
        self.gait = gait or usual_gait(standing_height)
        self.height = standing_height - self.gait.crouch
        ratios = leg_ratios(robot, stand.q, stand.soles)
        self._legs = LegMomentum(ratios.ahead, natural_frequency(self.height))
        self.ground = ground or level_floor(stand.start)
        reach = LegReach(robot, stand)
        if plan is not None:
            reach.check(plan, self.height)
        turns = all(robot.soles[sole].turns for sole in stand.soles)
        self._room = LegRoom(
            sizes=stand.sizes,
            width=self.gait.width or stand.width,
            clearance=FootstepPlan.clearance,
            ahead=_REACH * 2.0 * reach.span.beside(self.height),
            far=_REACH * 2.0 * reach.span.beside(LOWEST * self.height),
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
        contacts = enumerate(self._tasks.contacts)
        self._areas = [CarryingArea(self._sense, foot, contact) for foot, contact in contacts]
        self._feedback = DcmFeedback(self._legs.omega, self.settings.dcm_gain)
        times = StepTimes(self.gait.swing_time, self.gait.double_support)
        margin = self.settings.zmp_margin
        self._planner = StepPlanner(self.commands, self._room, self._legs, times, margin, stand)
        self._stance = Stance(self._sense, stand, margin, self._areas)
        self._body = BodyMotion(
            stand, self.gait.crouch, self.gait.shift_time, self._legs.omega, self.carried
        )
        self._height = BodyHeight(self._sense, stand, reach.span, self.gait, self.height)
        self._pendulum = MeasuredPendulum(
            self._legs, ratios.rise, self._sense, self._stance, self._body
        )
        self.status, self.phase, self.steps_made = WalkStatus.READY, Phase.STAND, 0
        self._time: float | None = None
        self._foot = 0
        self._hang_watch = HangWatch(self._sense, self._tasks.contacts)
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

    def take_over(self, state: RobotState, airborne: int | None = None) -> None:
        """Begins anew from what somebody else has led the robot to, who may take it back at rest.

        It makes no step but those that the robot needs in order not to fall: feet stay where they
        are as long as they hold it.

        Args:
            state: of the robot.
            airborne: the foot that is in the air, which comes down where that helps; 0 for the left
                one, None for none.
        """
        self._sense.update(state)
        self._time, self.phase = state.time, Phase.STAND
        self._flight = self._landed = self._hanging = None
        self.commands.stop()
        self.commands.closes = self._hurried = False
        self._begin()
        if airborne is not None:
            self._put_down(airborne)

    def feel(self, state: RobotState) -> None:
        """Learns what soles carry on, and whether one hangs, while somebody else leads two feet.

        Contacts are not told: who leads them takes the ZMP to what carries by itself, and a sole
        that rocks for a moment has another area in every tick.

        Args:
            state: of the robot.
        """
        dt = self._since_last(state)
        self._time = state.time
        self._sense.update(state)
        for area in self._areas:
            area.learn(state, dt)
        self._hang_watch.update(state, dt)

    def forget(self) -> None:
        """All of both soles carries, for all that is known, and no foot hangs."""
        self._time = None
        for area in self._areas:
            area.forget()
        self._hang_watch.forget()

    @property
    def parts(self) -> list[SolePart | None]:
        """What of each sole carries, left then right; None for all of it."""
        return self._stance.parts

    @property
    def hanging(self) -> int | None:
        """A foot that should stand and hangs in the air, 0 for the left one; None for none."""
        return self._hang_watch.foot

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
        self.commands.add_foothold(Foothold(foot, Placement(position=(x, y, 0.0), yaw=yaw)))

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
    def landing(self) -> Placement | None:
        """Where the foot in the air comes down; None with both on the ground."""
        return None if self._flight is None else self._flight.goal

    @property
    def held(self) -> bool:
        """Whether the feet as they stand hold the robot, on what carries of their soles."""
        return self.phase is Phase.STAND and self._is_held()

    @property
    def dcm_error(self) -> Float64[np.ndarray, "2"]:
        """How far the divergent component of motion is from its reference [m]."""
        return self._feedback.error

    @property
    def zmp(self) -> Float64[np.ndarray, "2"]:
        """Where the ZMP should be, feedback included [m]."""
        feet, _, _ = self._pendulum.feet(self._flight)
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
        dt = self._since_last(state)
        self._sense.update(state)
        for area in self._areas:
            area.update(state, dt)
        self._stance.feel()
        self._hang_watch.update(state, dt)
        self._time = state.time
        if self.status is WalkStatus.READY:
            self._start()
        if self.status is WalkStatus.MISPLACED or self._is_stopped_by_trouble(state, dt):
            return
        self.commands.advance(dt)
        self._catch_hanging()
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

    def _since_last(self, state: RobotState) -> float:
        """Since the last state [s]."""
        return 0.0 if self._time is None else min(max(state.time - self._time, 0.0), LONGEST_TICK)

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
        self._hanging.follow(state, self._body, self._pendulum.mass(self._flight)[0])
        self._announce_step()

    def _announce_step(self) -> None:
        """Tells the balance limit of the stack where the next step catches the robot."""
        limit = self.stack.balance_limit
        if not limit.enabled:
            return
        if self.phase is Phase.STAND:
            # The last foot of a plan does not carry at once: it is still the one that catches.
            if self._landed is None or self.commands.closes:
                limit.expect_step(None)
            return
        if self._flight is not None:
            goal = self._flight.goal
        else:
            goal = self.commands.steps(self._foot, self._standing_foot, AHEAD)[0]
        size = self._standing.sizes[self._foot]
        expect_step(limit, goal.position, goal.yaw, size, self.settings.adjust)

    def _is_held(self, margin: float = 0.0) -> bool:
        """Whether the feet as they stand can bring the divergent component to rest.

        Args:
            margin: how far inside the soles' edges, and the margin of the ZMP, it has to be [m].
        """
        return self._pendulum.depth(self._flight) >= margin

    def _start(self) -> None:
        """Begins where the robot stands, which is where its plan begins if it has one."""
        if self.plan is not None:
            for foot, place in enumerate(self.plan.start):
                if math.dist(self._sense.sole(foot)[0].tolist(), place.position) > _MISPLACED:
                    self.status = WalkStatus.MISPLACED
                    return
            self.commands.follow(self.plan)
        self._begin()

    def _begin(self) -> None:
        self.status = WalkStatus.STANDING
        self._feedback.error = np.zeros(2)
        stance = self._stance
        stance.stand_on((0, 1), self._sense.placement(0).yaw)
        mass, _ = self._pendulum.mass(self._flight)
        self._dcm = ((mass[0], 0.0), (mass[1], 0.0))
        self._body.begin(mass, float(self._sense.com[2]), stance.heading)
        self._left = self.gait.shift_time

    def _stand_on(self, *feet: int) -> None:
        """These feet carry the robot from now on."""
        self._stance.stand_on(feet, self._body.heading[0])

    def _catch_hanging(self) -> None:
        """A foot that should stand, and hangs, is one in the air."""
        foot = self.hanging
        lifted = self._foot if self.phase is Phase.SHIFT and self._released else None
        if foot is None or foot == lifted or self.phase is Phase.SWING:
            return
        self._landed = None
        self._tasks.contacts[1 - foot].engage(0.0)
        self._put_down(foot)

    def _put_down(self, foot: int) -> None:
        """A foot in the air comes down where that helps."""
        # On its way to be side by side it would cost time, and its leg momentum.
        self.commands.add_foothold(Foothold(foot, self._sense.placement(foot)))
        self._tasks.contacts[foot].release(0.0)
        self._tasks.feet[foot].set_target(*self._sense.sole(foot))
        self._foot, self._hurried = foot, True
        self._lift(foot, airborne=True)

    # Both feet on the ground ----------------------------------------------------------------------

    def _stand(self, dt: float) -> None:
        self._left = max(self._left - dt, 0.0)
        self._stance.follow(self._body.heading[0])
        x, y = self._standing.rest(self._stance.feet)
        self._lead_dcm(((x, 0.0), (y, 0.0)), self._left, dt)
        if not self._is_held(_CALM if self.commands.closes else 0.0):
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
        stance = self._stance
        bearings = [stance.bearing(foot) for foot in (0, 1)]
        xi = self._pendulum.xi(self._flight)
        self._go(self._planner.better_foot(stance.feet, bearings, xi), QUICK)
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
        return Lifted(
            self._foot,
            (x, y),
            self._standing_foot,
            self._stance.bearing(1 - self._foot),
            self._pendulum.xi(self._flight),
            elapsed,
        )

    @property
    def _standing_foot(self) -> Placement:
        """Where the foot stands that stays."""
        return self._stance.feet[1 - self._foot]

    def _lead_dcm(self, goal: tuple[DcmMotion, DcmMotion], left: float, dt: float) -> None:
        """Moves the reference on, to be at a goal in a while."""
        x, y = (hermite_step(a, b, left, dt) for a, b in zip(self._dcm, goal, strict=True))
        self._dcm = (x, y)

    # One foot in the air --------------------------------------------------------------------------

    def _lift(self, foot: int, *, airborne: bool = False) -> None:
        self._landed = None
        self._stand_on(1 - foot)
        goal = self.commands.steps(foot, self._standing_foot, AHEAD)[0]
        begin, size = self._sense.placement(foot), self._standing.sizes[foot]
        rise, swung = self.gait.swing_height, None
        if airborne:
            rise, swung = 0.0, self._planner.swung(begin.position[2] - goal.position[2])
        depth = self.settings.touchdown_depth
        shape = led_swing(begin, goal, size, rise, self.ground, depth)
        self._flight = Flight(
            foot,
            self._sense,
            goal,
            shape,
            self._planner,
            self.commands,
            self.settings,
            swung,
        )
        self.phase = Phase.SWING
        if self._hurried:
            self._aim(self._flight, math.inf)
        self._hurried = False

    def _fly(self, flight: Flight, state: RobotState, dt: float) -> None:
        flight.count(dt)
        self._aim(flight, dt)
        flight.get_clear(state)
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
        pendulum = planner.plan(lifted, self._pendulum.swing_motion(flight.swing)[0])
        flight.aim(lifted, pendulum, dt)
        pendulum = planner.moved(lifted, pendulum, flight.goal.position[:2])
        self._dcm = planner.on_the_way(pendulum, flight.left)

    def _land(self, foot: int) -> None:
        # What came down in a hurry has to carry as soon.
        hurry = min(self._flight.elapsed / self._planner.times.swing, 1.0) if self._flight else 1.0
        self._tasks.contacts[foot].engage(hurry * ENGAGE * self.gait.double_support)
        self._landed, self._hovering, self._stood = self._flight, 0.0, 0.0
        self._flight = None
        self.steps_made += 1
        commands = self.commands
        if commands.footholds and commands.footholds[0].foot == foot:
            commands.footholds.popleft()
        self._stand_on(0, 1)
        opened = commands.closes and not self._is_closed()
        # Who steps only in order not to fall keeps any stand that holds.
        calm = _CALM if commands.closes else 0.0
        if commands.moving or opened or not self._is_held(calm):
            following = commands.next_foot(foot)
            again = following == foot
            self._go(following, self.gait.shift_time if again else self.gait.double_support)
        else:
            # The divergent component goes over to where it rests as it was planned to, or in peace.
            planned = not commands.closes
            self._left = REST_TIME if planned else self.gait.settle_time
            self.phase = Phase.STAND

    # Balance and body -----------------------------------------------------------------------------

    def _keep_balance(self, dt: float) -> None:
        begins = self.steps_made == 0
        goal = self._height.goal(self._stance, self._flight, self._body.rise[0], begins=begins)
        self._body.move(*goal, dt)
        com = self._body.follow(self._dcm, dt)
        feet, velocities, accelerations = self._pendulum.feet(self._flight)
        joined, velocity = self._pendulum.mass(self._flight)
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


def _check_alone(gait: Gait | None, q: Numbers | None, ground: Ground | None) -> None:
    """Raises ConfigurationError if something is given that a plan has of its own."""
    for name, value in (("gait", gait), ("q", q), ("ground", ground)):
        if value is not None:
            raise ConfigurationError(
                f"{name} of a walker that has a plan",
                got=type(value).__name__,
                wanted=f"the plan's own: give {name} when the plan is made",
            )
