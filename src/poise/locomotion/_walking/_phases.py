"""`StepPhases`: double support, weight shift, swing, landing and capture step."""

import math
from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.locomotion._support import Point, SupportPolygon, sole_rectangle
from poise.locomotion._walking._commands import Foothold
from poise.locomotion._walking._dcm import REST_TIME, DcmMotion, hermite_step
from poise.locomotion._walking._flight import Flight, HeldFlight
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._modes import (
    CATCH,
    LIFT,
    Mode,
    ModeEvent,
    StepEnd,
    StepMachine,
)
from poise.locomotion._walking._parts import WalkParts
from poise.locomotion._walking._sense import ENGAGE, RELEASE
from poise.locomotion._walking._step_planner import AHEAD, QUICK, Lifted
from poise.locomotion._walking._swing import led_swing
from poise.stack import BalanceLimit

_WORTH = 0.5
"""A foot stays where it is while both hold the robot and its step would cost more than this."""

_PATIENCE = 0.5
"""For so long a foot that is to step waits for its step to cost less [s]: with feet far apart
ankles do not let the robot come nearer to the other one, and it steps from where it is."""

_CALM = 0.01
"""The divergent component has to be this far inside what holds it for the feet to stay [m]."""

_TIPPED = math.cos(0.1)
"""A stance sole that has turned by more than 0.1 rad since lift-off stands on an edge; one that
lies turns by less than 0.01 rad."""

_ADJUST = 0.2
"""Distance by which a foothold may still move, for the balance limit [m]."""

_HOVERING, _BOUNCES = 0.01, 0.15
"""A foot that carries less than this part of the weight for the bounce time of the settings, not
later than this after it landed [s], has not landed."""


_Rest = Callable[[int, Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]], Point]
_Region = Callable[[int, Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]], SupportPolygon]


@runtime_checkable
class FootMotion(Protocol):
    """Intent that lifts, holds and puts down feet: two foot devices, or a policy."""

    def lifted(self) -> int | None:
        """Return the foot to lift in this tick of double support, 0 left, 1 right."""
        ...

    def end_of_shift(self, foot: int, since: float) -> StepEnd | None:
        """Return why a foot that is about to be lifted stays on the ground; None to go on."""
        ...

    def take_off(self, foot: int) -> None:
        """Begin to hold a foot, 0 left, 1 right."""
        ...

    def end_of_swing(self, foot: int, load: float) -> StepEnd | None:
        """Return how the swing has ended; None while it goes on."""
        ...

    def move(self, flight: HeldFlight, dt: float) -> None:
        """Move the swing foot, by `HeldFlight.move`."""
        ...


class StepPhases:
    """Lift, lead and put down the feet, and move the DCM reference with them.

    A step is timed, along footholds of `StepCommands`, or held by a `FootMotion`. Whoever leads,
    once the feet do not hold the DCM the swing foot, or the better one of two, makes a capture
    step, and timed steps go on until both feet hold it again.

    Attributes:
        foot: swing foot, now, next or last; 0 for the left one.
        flight: of the swing foot; None in double support.
        dcm: reference of C, see `LegMomentum`, by its DCM and that one's velocity along x and y
            [m, m/s].
        steps_made: number of touchdowns.
        motion: holds the feet; None for nobody.
        held: whether it holds the step under way.
        ended: end of the last step that was held; None while one goes on, and before the first.
    """

    def __init__(self, parts: WalkParts) -> None:
        self._parts, self._commands, self._tasks = parts, parts.commands, parts.tasks
        self._sense, self._stance, self._planner = parts.sense, parts.stance, parts.planner
        self._pendulum, self._gait, self._region = parts.pendulum, parts.gait, parts.region
        self._machine, self._time = StepMachine(), 0.0
        self.foot, self.steps_made = 0, 0
        self.flight: HeldFlight | None = None
        self.dcm: tuple[DcmMotion, DcmMotion] = ((0.0, 0.0), (0.0, 0.0))
        self.motion: FootMotion | None = None
        self.held = False
        self.ended: StepEnd | None = None
        self._landed: Flight | None = None
        self._made: Foothold | None = None
        self._hovering = self._stood = 0.0
        self._released = self._hurried = self._given = False
        self._left = self._waited = 0.0
        self._flat: Float64[np.ndarray, "3"] = np.zeros(3)
        self._announced: tuple[Placement | None, Float64[np.ndarray, "4 2"]] = (
            None,
            np.zeros((4, 2)),
        )

    @property
    def mode(self) -> Mode:
        """Feet that carry the robot."""
        return self._machine.mode

    # Beginnings -----------------------------------------------------------------------------------

    def stand(self) -> None:
        """Stand on both feet from now on, wherever they are."""
        self._machine.stand(self._time)
        self.flight, self._landed = None, None
        self._hurried = self.held = False

    def begin(self) -> None:
        """Begin the DCM reference where the robot is."""
        self._stance.stand_on((0, 1), self._sense.placement(0).yaw)
        mass, _ = self._pendulum.mass(self.flight)
        self.dcm = ((mass[0], 0.0), (mass[1], 0.0))
        self._left = self._gait.shift_time

    def put_down(self, foot: int) -> None:
        """Make a capture step with a foot in the air, whoever lifted it."""
        if self.held:
            self.held, self.ended = False, StepEnd.OVERRULED
        # On its way to be side by side it would cost time, and its leg momentum.
        self._commands.insert(Foothold(foot, self._sense.placement(foot)))
        self._tasks.contacts[foot].release(0.0)
        self._tasks.feet[foot].set_target(*self._sense.sole(foot))
        self.foot, self._hurried = foot, True
        self._lift(foot, airborne=True)

    def let_go(self) -> None:
        """End the step that is held: the swing foot makes a capture step, both others stay."""
        if self.mode.single:
            self.put_down(self.foot)
        elif not self._released:
            self._give_back(StepEnd.OVERRULED)

    def catch(self, foot: int) -> None:
        """Make a capture step with a foot that should stand, and hangs, unless it is lifted now."""
        if self.mode.single or (self._released and foot == self.foot and self.mode is not Mode.D):
            return
        self._landed = None
        self._tasks.contacts[1 - foot].engage(0.0)
        self.put_down(foot)

    # A tick ---------------------------------------------------------------------------------------

    def advance(self, time: float, dt: float) -> None:
        """Go on by a tick."""
        self._time = time
        if self.mode is Mode.D:
            self._stand(dt)
        elif not self.mode.single:
            self._shift(dt)
        elif isinstance(self.flight, Flight):
            self._fly(self.flight, dt)
        elif self.flight is not None:
            self._follow(self.flight, dt)
        if self._landed is not None:
            self._confirm(self._landed, dt)

    def announce(self, limit: BalanceLimit) -> None:
        """Announce the next foothold to a balance limit."""
        if self.held:
            stance = 1 - self.foot
            caught = self._region.caught(stance, *self._sense.sole(stance))
            limit.expect_step(caught if self.mode.single else None)
            return
        if self.mode is Mode.D:
            # The last foot of a plan does not carry at once: it is still the one that catches.
            if self._landed is None or self._commands.closes:
                limit.expect_step(None)
            return
        if self.flight is not None:
            goal = self.flight.goal
        else:
            goal = self._commands.steps(self.foot, self._standing_foot, AHEAD)[0]
        if goal is not self._announced[0]:
            ends = 2.0 * _ADJUST
            length, width = self._parts.stand.sizes[self.foot]
            rotation = pin.utils.rotate("z", goal.yaw)
            corners = sole_rectangle(
                np.array(goal.position), rotation, (length + ends, width + ends)
            )
            self._announced = goal, np.array(corners)
        limit.expect_step(self._announced[1])

    # Both feet on the ground ----------------------------------------------------------------------

    def _stand(self, dt: float) -> None:
        commands = self._commands
        self._left = max(self._left - dt, 0.0)
        self._stance.follow(self._parts.body.heading[0])
        x, y = self._parts.stand.rest(self._stance.feet)
        self._lead_dcm(((x, 0.0), (y, 0.0)), self._left, dt)
        if not self.is_held(_CALM if self._closes else 0.0):
            self._hurry()
        elif self.motion is not None and (lifted := self.motion.lifted()) is not None:
            self.held, self.ended = True, None
            self._go(lifted, self._gait.shift_time)
        elif commands.moving:
            self._go(commands.first_foot(), self._gait.shift_time)
        elif self._closes and not self.is_closed and self._left == 0.0:
            self._go(0, self._gait.shift_time)

    @property
    def _closes(self) -> bool:
        """True where feet at rest come side by side; those of a `FootMotion` stay."""
        return self._commands.closes and self.motion is None

    @property
    def is_closed(self) -> bool:
        """Whether the feet are side by side."""
        return self._stance.closed(self._parts.room.width)

    def is_held(self, margin: float = 0.0) -> bool:
        """Return whether the feet as they stand can bring the DCM to rest."""
        return self._pendulum.depth(self.flight, self._holding(self._region.held)) >= margin

    @property
    def asked(self) -> SupportPolygon:
        """Region of the commanded ZMP."""
        return self._holding(self._region.asked)

    def _holding(self, region: _Region) -> SupportPolygon:
        """Return the region of a foot that carries alone while the other one is held."""
        if not (self.held and self.mode.single):
            return self._stance.support
        stance = 1 - self.foot
        return region(stance, *self._sense.sole(stance))

    def _stand_on(self, *feet: int) -> None:
        self._stance.stand_on(feet, self._parts.body.heading[0])

    def _go(self, foot: int, time: float) -> None:
        """Lift a foot in a while [s]."""
        self._machine.advance(LIFT[foot], self._time)
        self.foot, self._left, self._released, self._waited = foot, time, False, 0.0

    def _hurry(self) -> None:
        """Make a capture step with the better foot."""
        if self.held:
            self.held, self.ended = False, StepEnd.OVERRULED
        stance = self._stance
        bearings = [stance.bearing(foot) for foot in (0, 1)]
        xi = self._pendulum.xi(self.flight)
        self._go(self._planner.better_foot(stance.feet, bearings, xi), QUICK)
        self._hurried = True
        # The ZMP has to be in the foot that stays; going there evenly would take too long.
        self._stand_on(1 - self.foot)

    def _shift(self, dt: float) -> None:
        """Take the load off a foot, and lift it when it is due."""
        self._left -= dt
        quick = not self.held and self._left <= QUICK
        if not quick and not self._released and not self.is_held():
            self._hurry()
        foot, contact = self.foot, self._tasks.contacts[self.foot]
        if self.held and self.motion is not None:
            self._left = max(self._left, 0.0)
            if not self._released and self._stays(self.motion):
                return
            self._lead_dcm(self._over(1 - foot, self._region.arriving), self._left, dt)
        elif not self._hurried:
            planner = self._planner
            lift_off = planner.on_the_way(planner.plan(self._next_foot()), planner.times.swing)
            self._lead_dcm(lift_off, self._left, dt)
        ramp = min(RELEASE * self._gait.double_support, QUICK)
        if not self._released and self._left <= ramp:
            if self.held:
                if not self._has_shifted():
                    return
            elif self._waited < _PATIENCE and self._can_wait():
                self._left, self._waited = ramp, self._waited + dt
                self._calm_down()
                return
            contact.release(ramp)
            self._released = True
            # The tick that finds the contact gone comes before the next state: it holds the foot.
            self._tasks.feet[foot].set_target(*self._sense.sole(foot))
        if self._left <= 0.0 and not contact.active:
            if self.held and self.motion is not None:
                self._take_off(foot, self.motion)
            else:
                self._lift(foot)

    # A held foot ----------------------------------------------------------------------------------

    def _stays(self, motion: FootMotion) -> bool:
        """Give both feet back where the lift is called off."""
        ended = motion.end_of_shift(self.foot, self._time - self._machine.since)
        if ended is None:
            return False
        self._give_back(ended)
        return True

    def _give_back(self, ended: StepEnd) -> None:
        """Stand on both feet again."""
        self._machine.advance(ModeEvent.CANCEL, self._time)
        self.held, self.ended, self._left = False, ended, self._gait.settle_time

    def _has_shifted(self) -> bool:
        """Return whether the DCM rests over the foot that shall carry."""
        stance = 1 - self.foot
        goal = self._region.arriving(stance, *self._sense.sole(stance))
        feet = self._pendulum.places(None)
        xi = self._parts.legs.parted(self._pendulum.xi(None), feet)
        return math.dist(xi, goal) < self._region.arrived

    def _over(self, stance: int, rest: _Rest) -> tuple[DcmMotion, DcmMotion]:
        """Reference of the DCM at rest over a foot."""
        feet = self._pendulum.places(self.flight)
        x, y = self._parts.legs.joined(rest(stance, *self._sense.sole(stance)), feet)
        return (x, 0.0), (y, 0.0)

    def _take_off(self, foot: int, motion: FootMotion) -> None:
        self._landed = None
        self._stand_on(1 - foot)
        self._flat = self._sense.sole(1 - foot)[1][:, 2].copy()
        self._machine.advance(ModeEvent.SHIFTED, self._time)
        self.flight = HeldFlight(foot, *self._sense.lower_edge(foot), self._sense.placement(foot))
        motion.take_off(foot)

    def _follow(self, flight: HeldFlight, dt: float) -> None:
        """Follow whoever holds the swing foot, until touchdown or a capture step."""
        foot, motion = flight.foot, self.motion
        if motion is None or not self.is_held() or self._tips(1 - foot):
            self.put_down(foot)
            return
        motion.move(flight, dt)
        ended = motion.end_of_swing(foot, self._sense.load(foot))
        if ended is not None:
            self._machine.advance(ModeEvent.LANDED, self._time)
            self._tasks.contacts[foot].engage(ENGAGE * self._gait.double_support)
            self.flight, self.held, self.ended = None, False, ended
            self.steps_made += 1
            self._stand_on(0, 1)
            self._left = self._gait.settle_time
            return
        self._tasks.lead_foot(self._sense, flight)
        self._lead_dcm(self._over(1 - foot, self._region.rest), self._gait.step_time, dt)

    def _tips(self, stance: int) -> bool:
        """Return whether the stance sole has turned over an edge since lift-off."""
        return float(self._flat @ self._sense.sole(stance)[1][:, 2]) < _TIPPED

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
            x, y, _ = self.flight.position.tolist()
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
        (x, y), (to_x, to_y) = self.dcm, goal
        self.dcm = hermite_step(x, to_x, left, dt), hermite_step(y, to_y, left, dt)

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
        pose, time = self._sense.lower_edge(foot), self._planner.times.swing
        self.flight = Flight(foot, *pose, goal, shape, time, parts.settings, swung)
        self._machine.advance(CATCH[foot] if airborne else ModeEvent.SHIFTED, self._time)
        if self._hurried:
            self._aim(self.flight, math.inf)
        self._hurried = False

    def _fly(self, flight: Flight, dt: float) -> None:
        flight.count(dt)
        self._keep(flight)
        self._aim(flight, dt)
        flight.get_clear(self._sense)
        flight.retime()
        flight.advance(dt)
        if flight.is_down(self._sense):
            self._land(flight)
        else:
            self._tasks.lead_foot(self._sense, flight)

    def _keep(self, flight: Flight) -> None:
        """A foothold that was given for the foot in the air since lift-off is its next step's."""
        if not self._given and self._commands.asks_for(flight.foot):
            self._commands.insert(Foothold(flight.foot, flight.goal, checked=True))
            self._given = True

    def _aim(self, flight: Flight, dt: float) -> None:
        """Chooses the touchdown, and where the divergent component should be now."""
        planner, lifted = self._planner, self._next_foot()
        pendulum = planner.plan(lifted, self._pendulum.swing_place(flight))
        if flight.is_open:
            turned = flight.goal.yaw - lifted.stance.yaw
            step, place = planner.choose(lifted, pendulum, turned)
            flight.aim(place, step.left, self._commands.carries, dt)
        pendulum = planner.moved(pendulum, flight.goal.position[:2])
        self.dcm = planner.on_the_way(pendulum, flight.left)

    # Touchdown ------------------------------------------------------------------------------------

    def _land(self, flight: Flight) -> None:
        foot, commands = flight.foot, self._commands
        self._machine.advance(ModeEvent.LANDED, self._time)
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

    def _confirm(self, flight: Flight, dt: float) -> None:
        """A foot that has bounced off what it met looks for the ground again."""
        self._stood += dt
        if self._stood > _BOUNCES:
            self._landed = None
            return
        load = self._sense.load(flight.foot)
        self._hovering = 0.0 if load > _HOVERING else self._hovering + dt
        if self._hovering < self._parts.settings.bounce_time:
            return
        self._tasks.contacts[flight.foot].release(0.0)
        self._tasks.contacts[1 - flight.foot].engage(0.0)
        self.foot, self.flight, self._landed = flight.foot, flight, None
        self._machine.advance(CATCH[flight.foot], self._time)
        self._released = self._hurried = self.held = False
        flight.search_again()
        self.steps_made -= 1
        self._given = self._made is not None
        if self._made is not None:
            self._commands.insert(self._made)
        self._stand_on(1 - flight.foot)
