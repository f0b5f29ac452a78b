"""`OwnSteps`: steps that nobody commands, so that a robot which torques move does not fall."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from poise.dynamics import RobotState
from poise.locomotion._stepping._by_torque._torque_tasks import TorqueTasks
from poise.locomotion._stepping._operator import DeviceStatus
from poise.locomotion._stepping._stance import Footing, Mode, SoleTipping
from poise.locomotion._support import SolePart
from poise.locomotion._walking import Walker, WalkSettings, stand_of, usual_gait
from poise.robots import Robot

_REST = 0.3
"""So long the robot stands still, its divergent component inside its soles, before it is given back
[s]."""

_STILL = 0.1
"""A COM that is faster than this does not stand still [m/s]."""

_ROCKING = 2.0
"""For so long at most it waits for that: on an edge it may rock for ever [s]."""

_CLOSING = 6.0
"""For so long at most it goes on stepping only to have its feet nearer together [s]."""

_CAUGHT_MARGIN = 0.005
"""How far inside the soles' edges the ZMP stays in order not to fall [m]."""

_APART = 0.03
"""Least distance of the soles' edges: a foot that is caught by the other one comes down no more
[m]."""

_BOUNCE_TIME = 0.03
"""For how long a foot that has just landed carries nothing when it is let go again [s].

One that catches the robot lies long before it carries: the other one does, load cells have noise of
as much as counts here, and a sole that came down on an edge turns over it. After the 0.01 s of a
walk nearly every foot was let go, up to twelve times a step, and each time the ZMP was to be in the
other one again.
"""

_HIGHER = 1.6
"""How high a foot is lifted, over what a walk does: what stumbles over a bump catches nobody."""


class OwnSteps:
    """Catches the robot with its own steps where the feet as they are led cannot hold it.

    Once the divergent component has left what carries, no ZMP brings it back: only a foot somewhere
    else does; and where the only sole that carries tips, it soon will have. A `Walker` on the same
    stack chooses where and when, the one in the air first, foot after foot, until both hold the
    robot at rest; and on, towards side by side, where they would be farther apart than the operator
    can lead them. It also walks with a velocity that the operator asks for, and comes back to rest,
    feet side by side, when that is zero again.

    Args:
        robot: a biped.
        tasks: those of COM and feet, and contacts, are the walker's meanwhile.
        q_start: how the robot stands at the start.
        dt: length of a tick [s].

    Attributes:
        acting: whether the feet are led by it, and not by the operator.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: TorqueTasks,
        q_start: Float64[np.ndarray, " nq"],
        dt: float,
    ) -> None:
        settings = WalkSettings(
            zmp_margin=_CAUGHT_MARGIN, clearance=_APART, bounce_time=_BOUNCE_TIME
        )
        stand = stand_of(robot, q_start)
        gait = usual_gait(stand.com[2] - stand.middle[2])
        gait = replace(gait, swing_height=_HIGHER * gait.swing_height)
        # Trunk and arms stay whose they are.
        self._walker = Walker(robot, tasks.stack, gait, settings, q=q_start, carry=())
        self._tasks, self._dt = tasks, dt
        self._tipping = SoleTipping()
        self._give_back()

    def reset(self) -> None:
        """Forgets the past: the operator leads, and all of both soles carries."""
        self._walker.forget_everything()
        self._give_back()

    def _give_back(self) -> None:
        """The operator leads."""
        self._tipping.reset()
        self.acting, self._rested, self._held = False, 0.0, 0.0
        self._closing: float | None = None
        self._velocity, self._driven = (0.0, 0.0, 0.0), False

    @property
    def status(self) -> DeviceStatus:
        """Why the operator's devices hold no foot meanwhile."""
        return DeviceStatus.WALKING if self._driven else DeviceStatus.OVERRULED

    @property
    def driven(self) -> bool:
        """Whether it has walked with a velocity since it began to act."""
        return self._driven

    @property
    def mode(self) -> Mode:
        """Which feet carry the robot."""
        lifting = self._walker.lifting
        if lifting is None or not lifting[1]:
            return Mode.D
        return Mode.SR if lifting[0] == 0 else Mode.SL

    @property
    def zmp(self) -> Float64[np.ndarray, "2"]:
        """Where the ZMP should be [m]."""
        return self._walker.zmp

    @property
    def target(self) -> Float64[np.ndarray, "3"]:
        """Where the foot in the air comes down; not a number with both on the ground [m]."""
        place = self._walker.landing
        return np.full(3, np.nan) if place is None else np.array(place.position)

    def drive(self, velocity: tuple[float, float, float]) -> None:
        """Says with which velocity the robot shall walk.

        Args:
            velocity: ahead, to the left [m/s], turning to the left [rad/s]; all zero for not.
        """
        self._velocity = velocity
        self._driven = self._driven or any(velocity)
        if self.acting and self._driven:
            self._walker.set_velocity(*velocity)

    def feel(self, state: RobotState, mode: Mode) -> None:
        """Learns what the soles carry on, while the operator leads and both stand.

        Args:
            state: of the robot.
            mode: which feet carry the robot.
        """
        if mode.single:
            self._walker.forget()
        else:
            self._walker.feel(state)

    @property
    def parts(self) -> Sequence[SolePart | None]:
        """What of each sole carries, left then right; None for all of it."""
        return self._walker.parts

    def takes_over(
        self, footing: Footing, state: RobotState, zmp: Float64[np.ndarray, "2"]
    ) -> bool:
        """Begins to act if it shall walk, or the feet do not hold the robot as they are.

        Args:
            footing: of the tick.
            state: of the robot.
            zmp: as the operator's side has asked for last [m].
        """
        held = footing.capture_depth >= 0.0 and not self._tipping.update(footing)
        airborne = footing.other if footing.mode.single else self._walker.hanging
        # One that is about to be lifted may hang.
        hangs = airborne is not None and footing.mode.support in (None, airborne)
        if held and not any(self._velocity) and not hangs:
            return False
        # A robot that falls has no time to go on from there.
        self._walker.take_over(state, airborne, zmp if held and not hangs else None)
        self.acting, self._rested, self._held, self._closing = True, 0.0, 0.0, None
        self.drive(self._velocity)
        return True

    def lead(self, state: RobotState) -> None:
        """Sets COM, feet and their contacts for a tick.

        Args:
            state: of the robot.
        """
        self._walker.lead(state)

    def accompany(self, footing: Footing, *, fits: bool) -> None:
        """Sets the trunk; gives the robot back once it has come to rest.

        Args:
            footing: of the tick.
            fits: whether the operator could have led the feet to where they are.
        """
        self._tasks.accompany(footing, walks=self._driven)
        rests = self._walker.held and self._walker.status.ok
        rests = rests and footing.capture_depth > 0.0 and not any(self._velocity)
        self._held = self._held + self._dt if rests else 0.0
        rests = rests and (_is_still(footing) or self._held > _ROCKING)
        self._rested = self._rested + self._dt if rests else 0.0
        if self._closing is not None:
            self._closing += self._dt
            if not any(self._velocity):
                # Each step is another chance to stumble: near enough is enough.
                self._walker.close(not fits and self._closing <= _CLOSING)
        if self._rested <= _REST:
            return
        if not fits and self._closing is None:
            self._walker.close(True)
            self._closing = 0.0
        if fits or (self._closing or 0.0) > _CLOSING:
            self._give_back()


def _is_still(footing: Footing) -> bool:
    x, y, z = footing.dynamics.com_velocity.tolist()
    return x * x + y * y + z * z < _STILL * _STILL
