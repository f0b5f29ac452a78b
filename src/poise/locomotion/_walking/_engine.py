"""`SteppingEngine`: steps of a plan, of a velocity or of held feet, and the balance meanwhile."""

import math
from collections.abc import Callable

import numpy as np

from poise._checks import all_finite, is_time
from poise.dynamics import RobotState
from poise.locomotion._support import Point, Vector2
from poise.locomotion._walking._body import LOWEST
from poise.locomotion._walking._dcm import DcmFeedback
from poise.locomotion._walking._footsteps import FootstepPlan
from poise.locomotion._walking._modes import Mode
from poise.locomotion._walking._parts import WalkParts
from poise.locomotion._walking._phases import FootMotion, StepPhases
from poise.locomotion._walking._sense import LONGEST_TICK
from poise.locomotion._walking._settings import WalkStatus
from poise.locomotion._walking._trouble import (
    NO_RESPONSE,
    RESPONSES,
    Hanging,
    HangWatch,
    TroubleWatch,
)
from poise.stack import Stack

_MISPLACED = 0.03
"""Distance of a sole from the start of a plan beyond which nothing moves [m]."""


class SteppingEngine:
    """Set CoM, feet and contacts of a stack, tick by tick, for any source of steps."""

    def __init__(self, stack: Stack, make: Callable[[], WalkParts]) -> None:
        self._stack, self._make = stack, make
        # While feet are held: CoM height over that of the walk [m] and its least ratio to that.
        self.rise, self.lowest = 0.0, LOWEST
        self.held_gain: float | None = None  # of the DCM feedback then [1/s]; None: the walk's
        self.parts = make()
        self.reset()

    def reset(self) -> None:
        """Restart at the next state: both feet stand, and the ground is unknown."""
        for area in self.parts.areas:
            area.forget()
        parts = self.parts = self._make()
        self.commands, self.status = parts.commands, WalkStatus.READY
        self.steps = StepPhases(parts)
        self._feedback = DcmFeedback(parts.legs.omega, parts.settings.dcm_gain)
        self._hang_watch = HangWatch(parts.sense, parts.tasks.contacts)
        self._watch = TroubleWatch(parts.sense, parts.settings, parts.height)
        self._hanging: Hanging | None = None
        self._time: float | None = None

    def hold(self, motion: FootMotion | None) -> None:
        """Set the motion of feet; without one, a foot that is held makes a capture step."""
        self.steps.motion = motion

    @property
    def mode(self) -> Mode:
        return self.steps.mode

    @property
    def overrules(self) -> bool:
        """True while the engine steps by itself, or no foot carries the robot."""
        return self._hanging is not None or (self.mode is not Mode.D and not self.steps.held)

    @property
    def at_rest(self) -> bool:
        """True while both feet stand and hold the DCM, and nothing is wrong."""
        return self.status.ok and self.mode is Mode.D and self.steps.is_held()

    @property
    def dcm_error(self) -> Vector2:
        """Deviation of the DCM from its reference [m]."""
        return np.array(self._feedback.error)

    @property
    def zmp(self) -> Vector2:
        """Reference of the ZMP, feedback included [m]."""
        feet = self.parts.pendulum.places(self.steps.flight)
        return np.array(self.parts.legs.parted(self._feedback.zmp, feet))

    def lead(self, state: RobotState) -> None:
        """Set targets and contacts for the next tick; a state that is not finite is ignored."""
        if not (is_time(state.time) and all_finite(state.q) and all_finite(state.v)):
            return
        parts, steps = self.parts, self.steps
        dt = 0.0 if self._time is None else min(max(state.time - self._time, 0.0), LONGEST_TICK)
        self._time = state.time
        parts.sense.update(state)
        holds = steps.motion is not None and not self.overrules
        for area in parts.areas:
            area.update(dt, settled=holds)
        parts.stance.refresh()
        self._hang_watch.update(dt)
        if self.status is WalkStatus.READY:
            self._begin()
        if self.status is WalkStatus.MISPLACED or self._is_stopped_by_trouble(state, dt):
            return
        self.commands.advance(dt)
        if self._hang_watch.foot is not None:
            steps.catch(self._hang_watch.foot)
        if steps.held and self.commands.moving:
            steps.let_go()
            self._feedback.continue_from(self._feedback.zmp)
        steps.advance(state.time, dt)
        self._keep_balance(dt, holds=holds)
        if self.status.ok:
            self.status = self._plain_status
        self._announce_step()

    def _is_stopped_by_trouble(self, state: RobotState, dt: float) -> bool:
        error = math.hypot(*self._feedback.error)
        flight = self.steps.flight
        trouble = self._watch.look(flight, error, dt)
        self.status = trouble or self._plain_status
        response = NO_RESPONSE if trouble is None else RESPONSES[trouble]
        self.commands.pace = response.pace
        if response.lands and flight is not None:
            flight.land()
        if response.hangs:
            self._hang(state)
        elif self._hanging is not None:
            self._hanging.end()
            self._hanging = None
            self._begin()
        return response.hangs

    @property
    def _plain_status(self) -> WalkStatus:
        return WalkStatus.STANDING if self.mode is Mode.D else WalkStatus.WALKING

    def _hang(self, state: RobotState) -> None:
        """Keep the posture, wherever the robot is taken."""
        parts = self.parts
        if self._hanging is None:
            self._hanging = Hanging(state, parts.sense, parts.tasks)
            self.steps.stand()
            # Put down again, it stands until another command.
            self.commands.stop()
        mass, _ = parts.pendulum.mass(self.steps.flight)
        self._hanging.follow(state, parts.body, mass)
        self._announce_step()

    def _announce_step(self) -> None:
        limit = self._stack.balance_limit
        if limit.enabled:
            self.steps.announce(limit)

    def _begin(self) -> None:
        parts = self.parts
        if self.status is WalkStatus.READY and isinstance(parts.stand, FootstepPlan):
            for foot, place in enumerate(parts.stand.start):
                if math.dist(parts.sense.positions[foot], place.position) > _MISPLACED:
                    self.status = WalkStatus.MISPLACED
                    return
        self.status = WalkStatus.STANDING
        self._feedback.begin()
        self.steps.begin()
        mass, _ = parts.pendulum.mass(self.steps.flight)
        parts.body.begin(mass, parts.sense.com[2], parts.stance.heading)

    def _keep_balance(self, dt: float, *, holds: bool) -> None:
        """Move the CoM, and the targets that move with it, along the DCM reference."""
        parts, steps = self.parts, self.steps
        goal = parts.rise.goal(
            parts.stance,
            steps.flight,
            parts.body.rise[0],
            slow=holds or steps.steps_made == 0,
            offset=self.rise if holds else 0.0,
            lowest=self.lowest if holds else LOWEST,
        )
        parts.body.move(*goal, dt)
        com = parts.body.follow(steps.dcm, dt)
        feet = parts.pendulum.places(steps.flight)
        rates, accelerations = parts.pendulum.rates(steps.flight)
        parted, (height, rising, faster) = parts.legs.parted, parts.body.rise
        asked = steps.asked

        def nearest(zmp: Point) -> Point:
            return parts.legs.joined(asked.nearest(parted(zmp, feet)), feet)

        acceleration = self._feedback.acceleration(
            *parts.pendulum.mass(steps.flight), com, nearest, dt, self.held_gain if holds else None
        )
        motion = (
            (*parted(com[0], feet), height),
            (*parted(com[1], rates), rising),
            (*parted(com[2], accelerations), faster),
        )
        parts.tasks.lead_com(parts.sense, motion, parted(acceleration, accelerations))
        parts.body.carry(motion)
