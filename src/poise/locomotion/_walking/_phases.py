"""`StepPhases`: double support, weight shift, swing, landing and capture step."""

import math
from collections.abc import Callable
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from poise.locomotion._support import (
    Point,
    Rotation,
    SupportPolygon,
    Vector3,
    sole_rectangle,
)
from poise.locomotion._walking._commands import Foothold
from poise.locomotion._walking._dcm import REST_TIME, DcmMotions, hermite_step
from poise.locomotion._walking._flight import Flight, HeldFlight
from poise.locomotion._walking._ground import Placement, online_swing, turn_to_left
from poise.locomotion._walking._modes import (
    CATCH,
    LIFT,
    Mode,
    ModeEvent,
    StepEnd,
    StepMachine,
)
from poise.locomotion._walking._parts import WalkParts
from poise.locomotion._walking._sense import IDLE, LOADING
from poise.locomotion._walking._step_planner import AHEAD, QUICK, Lifted
from poise.stack import BalanceLimit

_WORTH = 0.5
"""A foot stays where it is while both hold the robot and its step would cost more than this."""

_PATIENCE = 0.5
"""For so long a foot that is to step waits for its step to cost less [s]: with feet far apart
ankles do not let the robot come nearer to the other one, and it steps from where it is."""

_ADJUST = 0.2
"""Distance by which a foothold may still move, for the balance limit [m]."""

_BOUNCES = 0.15
"""A foot that carries nothing for the bounce time of the settings, not later than this after it
landed [s], has not landed."""


T = TypeVar("T")

_Part = Callable[[int, Vector3, Rotation], T]
"""Part of a `SingleSupportRegion`, of a foot and the pose of its sole."""


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
    """Lift, move and put down the feet, and move the DCM reference with them."""

    # A step is timed, along footholds of `StepCommands`, or held by a `FootMotion`. In either
    # case, once the feet do not hold the DCM the swing foot, or the better one of two, makes a
    # capture step, and timed steps go on until both feet hold it again.

    def __init__(self, parts: WalkParts) -> None:
        self._parts, self._commands, self._tasks = parts, parts.commands, parts.tasks
        self._sense, self._stance, self._planner = parts.sense, parts.stance, parts.planner
        self._pendulum, self._gait, self._region = parts.pendulum, parts.gait, parts.region
        # Depth of the DCM inside what holds it for feet to stay that would else come side by side.
        self._calm = parts.settings.zmp_margin
        self._machine, self._time = StepMachine(), 0.0
        self.foot, self.steps_made = 0, 0  # swing foot, now, next or last; touchdowns
        self.flight: HeldFlight | None = None  # of the swing foot; None in double support
        # Reference of C, see `LegMomentum`, by its DCM along x and y.
        self.dcm: DcmMotions = ((0.0, 0.0), (0.0, 0.0))
        self.motion: FootMotion | None = None  # holds the feet
        self.held = False  # whether it holds the step under way
        # How the last held step ended; None while one goes on, and before the first.
        self.ended: StepEnd | None = None
        self._landed: Flight | None = None  # that may still bounce
        self._released = self._hurried = False  # load of the foot to lift; capture step
        self._left = self._waited = 0.0  # until lift-off or rest, and of patience spent [s]

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
        self.dcm = _resting(self._pendulum.mass(self.flight)[0])
        self._left = self._gait.shift_time

    def put_down(self, foot: int) -> None:
        """Make a capture step with the swing foot."""
        self._overrule()
        # A step to side by side would cost time, and its leg would add momentum.
        self._commands.insert(Foothold(foot, self._sense.placement(foot)))
        self._release(foot, 0.0)
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
        self._tasks.contacts[1 - foot].engage(0.0)
        self.put_down(foot)

    # A tick ---------------------------------------------------------------------------------------

    def advance(self, time: float, dt: float) -> None:
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
        if self.held:
            limit.expect_step(self._of_stance(self._region.caught) if self.mode.single else None)
        elif self.mode is Mode.D:
            # The last foot of a plan does not carry at once: it is still the one that catches.
            if self._landed is None or self._commands.closes:
                limit.expect_step(None)
        else:
            goal = self._next_foothold if self.flight is None else self.flight.goal
            length, width = self._parts.stand.sizes[self.foot]
            size = (length + 2.0 * _ADJUST, width + 2.0 * _ADJUST)
            corners = sole_rectangle(np.array(goal.position), turn_to_left(goal.yaw), size)
            limit.expect_step(np.array(corners))

    # Both feet on the ground ----------------------------------------------------------------------

    def _stand(self, dt: float) -> None:
        commands = self._commands
        self._left = max(self._left - dt, 0.0)
        self._stance.follow(self._parts.body.heading[0])
        self._lead_dcm(_resting(self._parts.stand.rest(self._stance.feet)), self._left, dt)
        if not self.is_held(self._calm if self._closes else 0.0):
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
        return self._stance.closed(self._parts.room.width)

    def is_held(self, margin: float = 0.0) -> bool:
        """Return whether the DCM can be brought to rest with the feet where they are."""
        return self._pendulum.depth(self.flight, self._holding(self._region.held)) >= margin

    @property
    def asked(self) -> SupportPolygon:
        """Region of the commanded ZMP."""
        return self._holding(self._region.asked)

    def _holding(self, part: _Part[SupportPolygon]) -> SupportPolygon:
        """Return the region of a foot that carries alone while the other one is held."""
        alone = self.held and self.mode.single
        return self._of_stance(part) if alone else self._stance.support

    def _of_stance(self, part: _Part[T]) -> T:
        """Return a part of the region of the foot that carries alone, now or next."""
        stance = 1 - self.foot
        return part(stance, *self._sense.sole(stance))

    def _stand_on(self, *feet: int) -> None:
        self._stance.stand_on(feet, self._parts.body.heading[0])

    def _go(self, foot: int, time: float) -> None:
        """Lift a foot in a while [s]."""
        self._machine.advance(LIFT[foot], self._time)
        self.foot, self._left, self._released, self._waited = foot, time, False, 0.0

    def _overrule(self) -> None:
        """End the hold of the feet."""
        if self.held:
            self.held, self.ended = False, StepEnd.OVERRULED

    def _hurry(self) -> None:
        """Make a capture step with the better foot."""
        self._overrule()
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
        if self.held and self.motion is not None:
            self._left = max(self._left, 0.0)
            since = self._time - self._machine.since
            ended = None if self._released else self.motion.end_of_shift(self.foot, since)
            if ended is not None:
                self._give_back(ended)
                return
            self._lead_dcm(self._over_stance(self._region.arriving), self._left, dt)
        elif not self._hurried:
            planner = self._planner
            lift_off = planner.on_the_way(planner.plan(self._next_foot()), planner.times.swing)
            self._lead_dcm(lift_off, self._left, dt)
        ramp = min(LOADING * self._gait.double_support, QUICK)
        if not self._released and self._left <= ramp:
            if self.held:
                if not self._has_shifted():
                    return
            elif self._waited < _PATIENCE and self._can_wait():
                self._left, self._waited = ramp, self._waited + dt
                self._calm_down()
                return
            self._release(self.foot, ramp)
            self._released = True
        if self._left <= 0.0 and not self._tasks.contacts[self.foot].active:
            self._lift(self.foot)

    def _release(self, foot: int, ramp: float) -> None:
        """Take the load off a foot in a time [s], and hold its sole where it is."""
        self._tasks.contacts[foot].release(ramp)
        # The tick that finds the contact gone comes before the next state: it holds the foot.
        self._tasks.feet[foot].set_target(*self._sense.sole(foot))

    def _give_back(self, ended: StepEnd) -> None:
        """Stand on both feet again."""
        self._machine.advance(ModeEvent.CANCEL, self._time)
        self.held, self.ended, self._left = False, ended, self._gait.settle_time

    def _has_shifted(self) -> bool:
        """Return True once the DCM rests over the next stance foot."""
        xi = self._parts.legs.parted(self._pendulum.xi(None), self._pendulum.places(None))
        return math.dist(xi, self._of_stance(self._region.arriving)) < self._region.arrived

    def _can_wait(self) -> bool:
        """Return True while both feet hold the robot and a step now would cost much."""
        return self.is_held() and self._planner.cost(self._next_foot()) > _WORTH

    def _calm_down(self) -> None:
        """Continue from the measured DCM after a hurried step, once both feet can hold it."""
        if self._hurried:
            self._hurried = False
            self._stand_on(0, 1)
            self.dcm = _resting(self._pendulum.xi(self.flight))

    def _next_foot(self) -> Lifted:
        """The foot of the next touchdown, in the air or not yet."""
        x, y, _ = self._stance.feet[self.foot].position
        elapsed = 0.0
        if self.flight is not None:
            elapsed = self.flight.elapsed
            x, y, _ = self.flight.position.tolist()
        bearing, xi = self._stance.bearing(1 - self.foot), self._pendulum.xi(self.flight)
        return Lifted(self.foot, (x, y), self._standing_foot, bearing, xi, elapsed)

    @property
    def _standing_foot(self) -> Placement:
        return self._stance.feet[1 - self.foot]

    @property
    def _next_foothold(self) -> Placement:
        return self._commands.steps(self.foot, self._standing_foot, AHEAD)[0]

    def _over_stance(self, rest: _Part[Point]) -> DcmMotions:
        """Reference of the DCM at rest over the foot that carries alone."""
        feet = self._pendulum.places(self.flight)
        return _resting(self._parts.legs.joined(self._of_stance(rest), feet))

    def _lead_dcm(self, goal: DcmMotions, left: float, dt: float) -> None:
        """Move the reference on, to be at a goal in a while [s]."""
        (x, y), (to_x, to_y) = self.dcm, goal
        self.dcm = hermite_step(x, to_x, left, dt), hermite_step(y, to_y, left, dt)

    # One foot in the air --------------------------------------------------------------------------

    def _lift(self, foot: int, *, airborne: bool = False) -> None:
        parts, sense, planner = self._parts, self._sense, self._planner
        self._landed = None
        self._stand_on(1 - foot)
        self._machine.advance(CATCH[foot] if airborne else ModeEvent.SHIFTED, self._time)
        pose, begin = sense.lower_edge(foot), sense.placement(foot)
        if self.held and self.motion is not None:
            self.flight = HeldFlight(foot, *pose, begin)
            self.motion.take_off(foot)
            return
        goal, rise, swung = self._next_foothold, self._gait.swing_height, None
        if airborne:
            rise, swung = 0.0, planner.swung(begin.position[2] - goal.position[2])
        size, depth = parts.stand.sizes[foot], parts.settings.touchdown_depth
        shape = online_swing(begin, goal, size, rise, parts.ground, depth)
        self.flight = Flight(foot, *pose, goal, shape, planner.times.swing, parts.settings, swung)
        self.flight.given = self._commands.asks_for(foot)
        if self._hurried:
            self._aim(self.flight, math.inf)
        self._hurried = False

    def _follow(self, flight: HeldFlight, dt: float) -> None:
        """Follow the holder of the swing foot, until touchdown or a capture step."""
        foot, motion = flight.foot, self.motion
        if motion is None or not self.is_held():
            self.put_down(foot)
            return
        motion.move(flight, dt)
        ended = motion.end_of_swing(foot, self._sense.load(foot))
        if ended is not None:
            self.held, self.ended = False, ended
            self._touch_down(flight, 1.0)
            self._left = self._gait.settle_time
            return
        self._tasks.lead_foot(self._sense, flight)
        self._lead_dcm(self._over_stance(self._region.rest), self._gait.step_time, dt)

    def _fly(self, flight: Flight, dt: float) -> None:
        flight.count(dt)
        if not flight.given and self._commands.asks_for(flight.foot):
            # A foothold that was given for the swing foot since lift-off is its next step's.
            self._commands.insert(Foothold(flight.foot, flight.goal, checked=True))
            flight.given = True
        self._aim(flight, dt)
        flight.get_clear(self._sense)
        flight.retime()
        flight.advance(dt)
        if flight.is_down(self._sense):
            self._land(flight)
        else:
            self._tasks.lead_foot(self._sense, flight)

    def _aim(self, flight: Flight, dt: float) -> None:
        """Chooses the touchdown, and where the DCM should be now."""
        planner, lifted = self._planner, self._next_foot()
        pendulum = planner.plan(lifted, self._pendulum.swing_place(flight))
        if flight.is_open:
            turned = flight.goal.yaw - lifted.stance.yaw
            step, place = planner.choose(lifted, pendulum, turned)
            flight.aim(place, step.left, self._commands.carries, dt)
        pendulum = planner.moved(pendulum, flight.goal.position[:2])
        self.dcm = planner.on_the_way(pendulum, flight.left)

    # Touchdown ------------------------------------------------------------------------------------

    def _touch_down(self, flight: HeldFlight, ramp: float) -> None:
        """Stand on both feet from now on, with a part of the usual ramp of load on the new one."""
        self._machine.advance(ModeEvent.LANDED, self._time)
        self._tasks.contacts[flight.foot].engage(ramp * LOADING * self._gait.double_support)
        self.flight = None
        self.steps_made += 1
        self._stand_on(0, 1)

    def _land(self, flight: Flight) -> None:
        foot, commands = flight.foot, self._commands
        # What came down in a hurry has to carry as soon.
        self._touch_down(flight, min(max(flight.elapsed / self._planner.times.swing, 0.0), 1.0))
        self._landed = flight
        flight.hovering = flight.stood = 0.0
        flight.made = commands.footholds.popleft() if commands.asks_for(foot) else None
        opened = commands.closes and not self.is_closed
        # Who steps only in order not to fall keeps any stand that holds.
        calm = self._calm if commands.closes else 0.0
        if commands.moving or opened or not self.is_held(calm):
            following = commands.next_foot(foot)
            again = following == foot
            self._go(following, self._gait.shift_time if again else self._gait.double_support)
        else:
            # The DCM goes over to where it rests as it was planned to, or in peace.
            self._left = self._gait.settle_time if commands.closes else REST_TIME

    def _confirm(self, flight: Flight, dt: float) -> None:
        """Continue the search for the ground after a bounce."""
        flight.stood += dt
        if flight.stood > _BOUNCES:
            self._landed = None
            return
        load = self._sense.load(flight.foot)
        flight.hovering = 0.0 if load > IDLE else flight.hovering + dt
        if flight.hovering < self._parts.settings.bounce_time:
            return
        self._tasks.contacts[flight.foot].release(0.0)
        self._tasks.contacts[1 - flight.foot].engage(0.0)
        self.foot, self.flight, self._landed = flight.foot, flight, None
        self._machine.advance(CATCH[flight.foot], self._time)
        self._released = self._hurried = self.held = False
        flight.search_again()
        self.steps_made -= 1
        flight.given = flight.made is not None
        if flight.made is not None:
            self._commands.insert(flight.made)
        self._stand_on(1 - flight.foot)


def _resting(at: Point) -> DcmMotions:
    return (at[0], 0.0), (at[1], 0.0)
