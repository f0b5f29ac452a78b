"""`Flight`: a foot in the air, whose place and time of touchdown are still open."""

import math
from dataclasses import replace

import numpy as np

from poise.locomotion._support import Point
from poise.locomotion._walking._commands import StepCommands
from poise.locomotion._walking._footsteps import Gait
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._settings import WalkSettings
from poise.locomotion._walking._step_choice import Pendulum
from poise.locomotion._walking._step_planner import Lifted, StepPlanner
from poise.locomotion._walking._swing import SwingFoot
from poise.locomotion._walking._swing_shape import RISE, SwingShape

_PLACE_RATE, _TIME_RATE = 2.0, 2.0
"""How fast foothold [m/s] and time of touchdown [s/s] change at most."""

_FINAL = 0.05
"""Foothold and time are final when touchdown is this near [s]."""


def sinking_phase(settings: WalkSettings, gait: Gait) -> float:
    """Part of a swing's phase in which the foot goes from the ground to where it aims below it."""
    depth = settings.touchdown_depth
    # At the end a quintic of least jerk is 10 (height) s^3 above where it ends.
    return (1.0 - RISE) * (0.1 * depth / (depth + gait.swing_height)) ** (1 / 3)


class Flight:
    """From lift-off to touchdown: moves the foothold, and the foot to it.

    A foot that meets no ground when it is due goes on down, faster than it would have landed, and
    its foothold moves on with the divergent component: what is late lands farther away.

    Args:
        foot: 0 for the left one, 1 for the right one.
        sense: where it is.
        goal: where it should come down.
        shape: of its swing.
        planner: chooses place and time.
        commands: know where the ground carries it.
        settings: of touchdown.
        sinking: see `sinking_phase`.

    Attributes:
        foot: which.
        goal: where it should come down.
        left: until it is due, zero when it is late [s].
        elapsed: since lift-off [s].
        waited: since it reached the depth at which it aimed [s].
        swing: its trajectory.
    """

    def __init__(
        self,
        foot: int,
        sense: WalkSense,
        goal: Placement,
        shape: SwingShape,
        planner: StepPlanner,
        commands: StepCommands,
        settings: WalkSettings,
        sinking: float,
    ) -> None:
        self.foot, self.goal = foot, goal
        self._planner, self._commands, self._sinking = planner, commands, sinking
        self.left, self.elapsed, self.waited = planner.times.swing, 0.0, 0.0
        self._lands = False
        position, rotation = sense.lower_edge(foot)
        x, y, z = goal.position
        low = replace(goal, position=(x, y, z - settings.touchdown_depth))
        time = self.left / (1.0 - sinking)
        self.swing = SwingFoot(position, rotation, low, shape, time, settings.search_depth)

    def aim(self, lifted: Lifted, pendulum: Pendulum, dt: float) -> None:
        """Chooses place and time of touchdown.

        Args:
            lifted: the foot.
            pendulum: what the next footholds ask for.
            dt: since the last choice, which it stays near to [s].
        """
        late = self.left == 0.0
        if self._lands or (self.left <= _FINAL and not late):
            return
        turned = self.goal.yaw - lifted.stance.yaw
        step, place = self._planner.choose(lifted, pendulum, turned)
        self._move_goal(place, dt)
        if not late:
            most = _TIME_RATE * dt
            self.left += min(max(step.left - self.left, -most), most)

    def _move_goal(self, place: Point, dt: float) -> None:
        """Takes the foothold nearer to a place, on ground that carries all of the sole."""
        (x, y, z), (a, b) = self.goal.position, self.goal.slope
        by_x, by_y = place[0] - x, place[1] - y
        ratio = min(1.0, _PLACE_RATE * dt / max(math.hypot(by_x, by_y), 1e-9))
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

    def count(self, dt: float) -> None:
        """Lets the time pass [s]."""
        self.elapsed += dt
        self.left = max(self.left - dt, 0.0)

    def advance(self, dt: float) -> None:
        """Moves the foot on.

        Args:
            dt: of the tick [s].
        """
        swing = self.swing
        before_ground = 1.0 - self._sinking - swing.phase
        if self.left > 0.0 and before_ground > 0.0:
            swing.retime(self.left * (1.0 - swing.phase) / before_ground)
        elif self.left == 0.0:
            swing.search()
        swing.advance(dt, np.array(self.goal.position[:2]) - np.array(swing.goal.position[:2]))
        if swing.phase >= 1.0:
            self.waited += dt
