"""`StepCycle`: what the feet do, tick by tick: both stand, one is about to be lifted, one flies."""

import math
from enum import Enum

from poise.dynamics import RobotState
from poise.locomotion._walking._commands import Foothold
from poise.locomotion._walking._dcm_plan import REST_TIME, DcmMotion, hermite_step
from poise.locomotion._walking._flight import Flight
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._parts import WalkParts
from poise.locomotion._walking._sense import ENGAGE, RELEASE, expect_step
from poise.locomotion._walking._step_planner import AHEAD, QUICK, Lifted
from poise.locomotion._walking._swing_shape import led_swing
from poise.stack import BalanceLimit


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

_PATIENCE = 0.5
"""For so long a foot that is to step waits for its step to cost less [s]: with feet far apart
ankles do not let the robot come nearer to the other one, and it steps from where it is."""

_CALM = 0.01
"""The divergent component has to be this far inside what holds it for the feet to stay [m]."""

_HOVERING, _BOUNCES = 0.01, 0.15
"""A foot that carries less than this part of the weight for the bounce time of the settings, not
later than this after it landed [s], has not landed."""


class StepCycle:
    """Lifts, leads and puts down the feet, and leads the divergent component meanwhile.

    Args:
        parts: of the walk.

    Attributes:
        phase: what the feet do.
        foot: the one that is lifted next, in the air, or was last; 0 for the left one.
        flight: of the foot in the air; None where both stand.
        dcm: where C should be, see `LegMomentum`, by its divergent component and that one's
            velocity along x and y [m, m/s].
        steps_made: how many steps are behind.
    """

    def __init__(self, parts: WalkParts) -> None:
        self._parts, self._commands, self._tasks = parts, parts.commands, parts.tasks
        self._sense, self._stance, self._planner = parts.sense, parts.stance, parts.planner
        self._pendulum, self._gait = parts.pendulum, parts.gait
        self.phase, self.foot, self.steps_made = Phase.STAND, 0, 0
        self.flight: Flight | None = None
        self.dcm: tuple[DcmMotion, DcmMotion] = ((0.0, 0.0), (0.0, 0.0))
        self._landed: Flight | None = None
        self._made: Foothold | None = None
        self._hovering = self._stood = 0.0
        self._released = self._hurried = self._given = False
        self._left = self._waited = 0.0

    # Beginnings -----------------------------------------------------------------------------------

    def stand(self) -> None:
        """Both feet stand from now on, wherever they are."""
        self.phase, self.flight, self._landed = Phase.STAND, None, None
        self._hurried = False

    def begin(self) -> None:
        """The divergent component begins where it is."""
        self._stance.stand_on((0, 1), self._sense.placement(0).yaw)
        mass, _ = self._pendulum.mass(self.flight)
        self.dcm = ((mass[0], 0.0), (mass[1], 0.0))
        self._left = self._gait.shift_time

    def put_down(self, foot: int) -> None:
        """A foot in the air, whoever lifted it, comes down where that helps.

        Args:
            foot: 0 for the left one, 1 for the right one.
        """
        # On its way to be side by side it would cost time, and its leg momentum.
        self._commands.insert(Foothold(foot, self._sense.placement(foot)))
        self._tasks.contacts[foot].release(0.0)
        self._tasks.feet[foot].set_target(*self._sense.sole(foot))
        self.foot, self._hurried = foot, True
        self._lift(foot, airborne=True)

    def catch(self, foot: int) -> None:
        """A foot that should stand, and hangs, is one in the air, unless it is about to be lifted.

        Args:
            foot: 0 for the left one, 1 for the right one.
        """
        lifted = self.foot if self.phase is Phase.SHIFT and self._released else None
        if foot == lifted or self.phase is Phase.SWING:
            return
        self._landed = None
        self._tasks.contacts[1 - foot].engage(0.0)
        self.put_down(foot)

    # A tick ---------------------------------------------------------------------------------------

    def advance(self, state: RobotState, dt: float) -> None:
        """Goes on by a tick.

        Args:
            state: of the robot.
            dt: of the tick [s].
        """
        if self.phase is Phase.STAND:
            self._stand(dt)
        elif self.phase is Phase.SHIFT:
            self._shift(dt)
        elif self.flight is not None:
            self._fly(self.flight, state, dt)
        if self._landed is not None:
            self._confirm(self._landed, state, dt)

    def announce(self, limit: BalanceLimit) -> None:
        """Tells a balance limit where the next step catches the robot.

        Args:
            limit: of the stack.
        """
        if self.phase is Phase.STAND:
            # The last foot of a plan does not carry at once: it is still the one that catches.
            if self._landed is None or self._commands.closes:
                limit.expect_step(None)
            return
        if self.flight is not None:
            goal = self.flight.goal
        else:
            goal = self._commands.steps(self.foot, self._standing_foot, AHEAD)[0]
        size = self._parts.stand.sizes[self.foot]
        expect_step(limit, goal.position, goal.yaw, size, self._parts.settings.adjust)

    # Both feet on the ground ----------------------------------------------------------------------

    def _stand(self, dt: float) -> None:
        commands = self._commands
        self._left = max(self._left - dt, 0.0)
        self._stance.follow(self._parts.body.heading[0])
        x, y = self._parts.stand.rest(self._stance.feet)
        self._lead_dcm(((x, 0.0), (y, 0.0)), self._left, dt)
        if not self.is_held(_CALM if commands.closes else 0.0):
            self._hurry()
        elif commands.moving:
            self._go(commands.first_foot(), self._gait.shift_time)
        elif commands.closes and not self.is_closed and self._left == 0.0:
            self._go(0, self._gait.shift_time)

    @property
    def is_closed(self) -> bool:
        """Whether the feet are side by side."""
        return self._stance.closed(self._parts.room.width)

    def is_held(self, margin: float = 0.0) -> bool:
        """Whether the feet as they stand can bring the divergent component to rest.

        Args:
            margin: how far inside the soles' edges, and the margin of the ZMP, it has to be [m].
        """
        return self._pendulum.depth(self.flight) >= margin

    def _stand_on(self, *feet: int) -> None:
        """These feet carry the robot from now on."""
        self._stance.stand_on(feet, self._parts.body.heading[0])

    def _go(self, foot: int, time: float) -> None:
        """A foot is to be lifted in a while [s]."""
        self.phase, self.foot, self._left, self._released = Phase.SHIFT, foot, time, False
        self._waited = 0.0

    def _hurry(self) -> None:
        """A foot is to be lifted at once, so that the robot does not fall."""
        stance = self._stance
        bearings = [stance.bearing(foot) for foot in (0, 1)]
        xi = self._pendulum.xi(self.flight)
        self._go(self._planner.better_foot(stance.feet, bearings, xi), QUICK)
        self._hurried = True
        # The ZMP has to be in the foot that stays; going there evenly would take too long.
        self._stand_on(1 - self.foot)

    def _shift(self, dt: float) -> None:
        """Takes the load off a foot, and lifts it when it is due."""
        self._left -= dt
        if self._left > QUICK and not self._released and not self.is_held():
            self._hurry()
        foot, contact = self.foot, self._tasks.contacts[self.foot]
        if not self._hurried:
            planner = self._planner
            lift_off = planner.on_the_way(planner.plan(self._next_foot()), planner.times.swing)
            self._lead_dcm(lift_off, self._left, dt)
        ramp = min(RELEASE * self._gait.double_support, QUICK)
        if not self._released and self._left <= ramp:
            if self._waited < _PATIENCE and self._can_wait():
                self._left, self._waited = ramp, self._waited + dt
                self._calm_down()
                return
            contact.release(ramp)
            self._released = True
            # The tick that finds the contact gone comes before the next state: it holds the foot.
            self._tasks.feet[foot].set_target(*self._sense.sole(foot))
        if self._left <= 0.0 and not contact.active:
            self._lift(foot)

    def _can_wait(self) -> bool:
        """Whether both feet hold the robot, and a step now would cost it much."""
        return self.is_held() and self._planner.cost(self._next_foot()) > _WORTH

    def _calm_down(self) -> None:
        """Who was in a hurry, and is held again, leads the divergent component on from here."""
        if self._hurried:
            self._hurried = False
            self._stand_on(0, 1)
            x, y = self._pendulum.xi(self.flight)
            self.dcm = ((x, 0.0), (y, 0.0))

    def _next_foot(self) -> Lifted:
        """The foot that comes down next, in the air or not yet."""
        x, y, _ = self._stance.feet[self.foot].position
        elapsed = 0.0
        if self.flight is not None:
            elapsed = self.flight.elapsed
            x, y, _ = self.flight.swing.position.tolist()
        return Lifted(
            self.foot,
            (x, y),
            self._standing_foot,
            self._stance.bearing(1 - self.foot),
            self._pendulum.xi(self.flight),
            elapsed,
        )

    @property
    def _standing_foot(self) -> Placement:
        """Where the foot stands that stays."""
        return self._stance.feet[1 - self.foot]

    def _lead_dcm(self, goal: tuple[DcmMotion, DcmMotion], left: float, dt: float) -> None:
        """Moves the reference on, to be at a goal in a while."""
        x, y = (hermite_step(a, b, left, dt) for a, b in zip(self.dcm, goal, strict=True))
        self.dcm = (x, y)

    # One foot in the air --------------------------------------------------------------------------

    def _lift(self, foot: int, *, airborne: bool = False) -> None:
        parts = self._parts
        self._landed = None
        self._stand_on(1 - foot)
        self._given = self._commands.asks_for(foot)
        goal = self._commands.steps(foot, self._standing_foot, AHEAD)[0]
        begin, size = self._sense.placement(foot), parts.stand.sizes[foot]
        rise, swung = self._gait.swing_height, None
        if airborne:
            rise, swung = 0.0, self._planner.swung(begin.position[2] - goal.position[2])
        depth = parts.settings.touchdown_depth
        shape = led_swing(begin, goal, size, rise, parts.ground, depth)
        self.flight = Flight(
            foot,
            self._sense,
            goal,
            shape,
            self._planner,
            self._commands,
            parts.settings,
            swung,
        )
        self.phase = Phase.SWING
        if self._hurried:
            self._aim(self.flight, math.inf)
        self._hurried = False

    def _fly(self, flight: Flight, state: RobotState, dt: float) -> None:
        flight.count(dt)
        self._keep(flight)
        self._aim(flight, dt)
        flight.get_clear(state)
        flight.advance(dt)
        swing = flight.swing
        down = self._sense.is_down(swing, state, flight.foot, self._parts.settings)
        if down and not flight.on_its_way:
            self._land(flight)
            return
        self._tasks.lead_foot(self._sense, flight.foot, swing)

    def _keep(self, flight: Flight) -> None:
        """A foothold that was given for the foot in the air since lift-off is its next step's."""
        if not self._given and self._commands.asks_for(flight.foot):
            self._commands.insert(Foothold(flight.foot, flight.goal, checked=True))
            self._given = True

    def _aim(self, flight: Flight, dt: float) -> None:
        """Chooses the touchdown, and where the divergent component should be now."""
        planner, lifted = self._planner, self._next_foot()
        pendulum = planner.plan(lifted, self._pendulum.swing_motion(flight.swing)[0])
        flight.aim(lifted, pendulum, dt)
        pendulum = planner.moved(lifted, pendulum, flight.goal.position[:2])
        self.dcm = planner.on_the_way(pendulum, flight.left)

    # Touchdown ------------------------------------------------------------------------------------

    def _land(self, flight: Flight) -> None:
        foot, commands = flight.foot, self._commands
        # What came down in a hurry has to carry as soon.
        hurry = min(max(flight.elapsed / self._planner.times.swing, 0.0), 1.0)
        self._tasks.contacts[foot].engage(hurry * ENGAGE * self._gait.double_support)
        self._landed, self._hovering, self._stood = flight, 0.0, 0.0
        self.flight = None
        self.steps_made += 1
        self._made = commands.footholds.popleft() if commands.asks_for(foot) else None
        self._stand_on(0, 1)
        opened = commands.closes and not self.is_closed
        # Who steps only in order not to fall keeps any stand that holds.
        calm = _CALM if commands.closes else 0.0
        if commands.moving or opened or not self.is_held(calm):
            following = commands.next_foot(foot)
            again = following == foot
            self._go(following, self._gait.shift_time if again else self._gait.double_support)
        else:
            # The divergent component goes over to where it rests as it was planned to, or in peace.
            planned = not commands.closes
            self._left = REST_TIME if planned else self._gait.settle_time
            self.phase = Phase.STAND

    def _confirm(self, flight: Flight, state: RobotState, dt: float) -> None:
        """A foot that has bounced off what it met looks for the ground again."""
        self._stood += dt
        if self._stood > _BOUNCES:
            self._landed = None
            return
        load = self._sense.load(state, flight.foot)
        self._hovering = 0.0 if load > _HOVERING else self._hovering + dt
        if self._hovering < self._parts.settings.bounce_time:
            return
        self._tasks.contacts[flight.foot].release(0.0)
        self._tasks.contacts[1 - flight.foot].engage(0.0)
        self.foot, self.flight, self._landed = flight.foot, flight, None
        self.phase, self._released, self._hurried = Phase.SWING, False, False
        flight.swing.search_again()
        self.steps_made -= 1
        self._given = self._made is not None
        if self._made is not None:
            self._commands.insert(self._made)
        self._stand_on(1 - flight.foot)
