"""`Flight`: swing foot whose place and time of touchdown are still open.

`HeldFlight`: swing foot that is held for any time.
"""

import math
from dataclasses import replace

from poise.locomotion._support import Point, Rotation, Vector3
from poise.locomotion._walking._commands import StepCommands
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._settings import WalkSettings
from poise.locomotion._walking._step_choice import Pendulum
from poise.locomotion._walking._step_planner import Lifted, StepPlanner
from poise.locomotion._walking._swing import (
    RISE,
    SwingFoot,
    SwingPose,
    SwingShape,
    sinking_phase,
)

_FINAL = 0.05
"""Time before touchdown from which foothold and time are final [s]."""

_RATE = 2.0
"""Largest rates of foothold [m/s] and time of touchdown [s/s]."""

_HELD, _BACK = 0.04, 0.015
"""A foot that rises and is pushed aside with more than this part of the weight, more than upwards,
is held by something; it goes so far back from it [m]."""

_SHORT, _EARLY = 0.08, 0.03
"""Contact so far from the foothold [m], and earlier than this before it is due [s], is with
something on its way."""


class Flight:
    """From lift-off to touchdown: moves the foothold, and the foot to it."""

    def __init__(
        self,
        foot: int,
        sense: WalkSense,
        goal: Placement,
        shape: SwingShape,
        planner: StepPlanner,
        commands: StepCommands,
        settings: WalkSettings,
        swung: float | None = None,
    ) -> None:
        self.foot, self.goal = foot, goal
        self._sense, self._planner, self._commands = sense, planner, commands
        self._sinking = sinking_phase(settings.touchdown_depth, shape.apex - goal.position[2])
        # Since lift-off, and since it reached the depth at which it aimed [s].
        self.elapsed, self.waited = swung or 0.0, 0.0
        self.left = planner.times.swing - self.elapsed  # until it is due; zero when late [s]
        self._lands = False
        position, rotation = sense.lower_edge(foot)
        x, y, z = goal.position
        low = replace(goal, position=(x, y, z - settings.touchdown_depth))
        time = self.left / (1.0 - self._sinking)
        self.swing = SwingFoot(position, rotation, low, shape, time, settings.search_depth)
        if swung is not None:
            self.swing.elapsed = RISE * self.swing.duration

    def aim(self, lifted: Lifted, pendulum: Pendulum, dt: float) -> None:
        """Chooses place and time of touchdown."""
        late = self.left == 0.0
        if self._lands or (self.left <= _FINAL and not late):
            return
        turned = self.goal.yaw - lifted.stance.yaw
        step, place = self._planner.choose(lifted, pendulum, turned)
        self._move_goal(place, dt)
        if not late:
            most = _RATE * dt
            self.left += min(max(step.left - self.left, -most), most)

    def _move_goal(self, place: Point, dt: float) -> None:
        """Takes the foothold nearer to a place, on ground that carries all of the sole."""
        (x, y, z), (a, b) = self.goal.position, self.goal.slope
        by_x, by_y = place[0] - x, place[1] - y
        if by_x == by_y == 0.0:
            return
        ratio = min(1.0, _RATE * dt / max(math.hypot(by_x, by_y), 1e-9))
        by_x, by_y = ratio * by_x, ratio * by_y
        position = (x + by_x, y + by_y, z + a * by_x + b * by_y)
        moved = replace(self.goal, position=position)
        if self._commands.carries(self.foot, moved):
            self.goal = moved

    def land(self) -> None:
        """Comes straight down from where the foot is now."""
        if not self._lands:
            x, y, _ = self.swing.position.tolist()
            self.goal = replace(self.goal, position=(x, y, self.goal.position[2]))
            self._lands, self.left = True, 0.0

    @property
    def on_its_way(self) -> bool:
        """True while contact cannot be with the ground at the foothold."""
        if self.left <= _EARLY:
            return False
        x, y, _ = self._sense.lower_edge(self.foot)[0].tolist()
        return math.dist((x, y), self.goal.position[:2]) > _SHORT

    def count(self, dt: float) -> None:
        """Lets the time pass [s]."""
        self.elapsed += dt
        self.left = max(self.left - dt, 0.0)

    def get_clear(self) -> None:
        """A foot that is held on its way up goes back from what holds it, and straight up."""
        if self.swing.phase >= RISE:
            return
        x, y, up = self._sense.felt(self.foot)
        aside = math.hypot(x, y)
        if aside > _HELD and aside > up:
            place = self._sense.lower_edge(self.foot)[0].tolist()
            self.swing.rise_at(place[0] + _BACK * x / aside, place[1] + _BACK * y / aside)

    def advance(self, dt: float) -> None:
        """Moves the foot on."""
        swing = self.swing
        before_ground = 1.0 - self._sinking - swing.phase
        if self.left > 0.0 and before_ground > 0.0:
            swing.retime(self.left * (1.0 - swing.phase) / before_ground)
        elif self.left == 0.0:
            swing.search()
        (x, y, _), (x0, y0, _) = self.goal.position, swing.goal.position
        swing.advance(dt, (x - x0, y - y0))
        if swing.phase >= 1.0:
            self.waited += dt


class HeldFlight:
    """Swing foot that a `FootMotion` leads, from lift-off to touchdown.

    Args:
        foot: 0 for the left one, 1 for the right one.
        sense: of the robot.

    Attributes:
        foot: which.
        swing: its pose.
        goal: where it is now, which is where it would come down.
        left: zero: it may come down in any tick [s].
        elapsed: zero: it may last for any time [s].
        waited: zero: nobody expects it to be down [s].
    """

    def __init__(self, foot: int, sense: WalkSense) -> None:
        self.foot = foot
        self.left = self.elapsed = self.waited = 0.0
        self.swing = SwingPose(*sense.lower_edge(foot))
        self.goal = sense.placement(foot)

    def move(self, position: Vector3, velocity: Vector3, rotation: Rotation, yaw: float) -> None:
        """Set the pose of a tick.

        Args:
            position: of the sole in the world [m].
            velocity: of the sole in the world [m/s].
            rotation: world_R_sole.
            yaw: heading of the sole in the world [rad].
        """
        self.swing.position, self.swing.rotation = position, rotation
        self.swing.velocity[:3] = velocity
        x, y, z = position.tolist()
        self.goal = Placement(position=(x, y, z), yaw=yaw)

    def land(self) -> None:
        """Do nothing: who holds the foot puts it down."""
