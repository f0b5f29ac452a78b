"""`FootVelocity`: how fast the foot goes that is not the stance.

`FootTarget`: where the foot is sent that is not the stance.
"""

import math

import numpy as np
from jaxtyping import Float64

from poise.locomotion._stepping._operator import OperatorSample, Vector
from poise.locomotion._stepping._stance import (
    POSITION_GAIN,
    Footing,
    FootRange,
    TeleopParameters,
    wrapped,
)

_AT_REST: Vector = (0.0, 0.0, 0.0)

_THERE = 1e-6
"""A foot is sent no nearer than this to where the operator says, whatever is rounded [m]."""

_HANGS, _COMES = 0.005, 0.002
"""So far above where it is sent down to a foot has not got there; and so much lower it is when it
still comes [m]."""

_PATIENCE, _DRAWN = 0.4, 0.05
"""How long a foot may hang, and how fast it is led nearer then [s, m/s]."""


class FootTarget:
    """Eq. (15d): after the device while in the air, and held while on the ground.

    Attributes:
        rescuing: whether the foot in the air is put down, whatever the operator commands.
        rate: how fast the operator moves the place where it is sent [m/s]; zero where it is sent
            elsewhere than they say, or they do not say how fast.
    """

    def __init__(self, reach: FootRange, parameters: TeleopParameters) -> None:
        self._range, self._parameters = reach, parameters
        self.restart()
        self.rate = _AT_REST

    def restart(self) -> None:
        """Another mode has begun."""
        self.rescuing = False
        self._comes()

    def _comes(self) -> None:
        """The foot does not hang."""
        self._least, self._hung = math.inf, 0.0

    def place(
        self,
        footing: Footing,
        device: OperatorSample | None,
        *,
        room_below: float,
        falling: bool = False,
    ) -> Float64[np.ndarray, "3"]:
        """The place [m]."""
        here = footing.sole(footing.other)
        self.rate = _AT_REST
        if not footing.mode.single:
            x, y, z = footing.anchors[footing.other].tolist()
            return np.array([x, y, z - footing.pressed])
        self.rescuing = self.rescuing or falling
        lowest = footing.lowest_ground - self._parameters.press_depth
        if device is None or self.rescuing:
            # Nobody commands, or nobody may: straight down, until the ground is felt.
            sent = np.array([here[0], here[1], lowest])
        else:
            # One that has not left the ground yet would push the robot over.
            down = lowest if footing.has_left else float(here[2])
            sent = self._followed(footing, device, down, room_below)
        if self._hangs(footing, float(sent[2])):
            self.rate = _AT_REST
            return self._nearer(footing, float(sent[2]), room_below)
        return sent

    def _hangs(self, footing: Footing, sent: float) -> bool:
        """Whether the foot is to stand on the ground and has not got lower for a while.

        Then its leg is at its end, and the one that stands folds no deeper than that.
        """
        height = float(footing.sole(footing.other)[2])
        if sent > min(height - _HANGS, footing.highest_ground) or not footing.has_left:
            self._comes()
            return False
        if self._hung < _PATIENCE:
            if height < self._least - _COMES:
                self._least, self._hung = height, 0.0
            self._hung += self._parameters.dt
        return self._hung >= _PATIENCE

    def _nearer(
        self, footing: Footing, height: float, room_below: float
    ) -> Float64[np.ndarray, "3"]:
        """Towards the hip from where the foot is: straight down it would hang for ever [m]."""
        swing = footing.other
        x, y, _ = footing.sole(swing).tolist()
        to_x, to_y = self._range.below_hip(swing, footing.dynamics)
        far = math.hypot(to_x - x, to_y - y)
        part = min(1.0, _DRAWN / POSITION_GAIN / max(far, _THERE))
        target = x + part * (to_x - x), y + part * (to_y - y), height
        return self._within_reach(footing, target, room_below)

    def _followed(
        self, footing: Footing, device: OperatorSample, lowest: float, room_below: float
    ) -> Float64[np.ndarray, "3"]:
        """The operator's device, where a foot can be and no lower than it may [m]."""
        swing = footing.other
        (x, y, z), (here_x, here_y, _) = device.place(swing), footing.sole(swing).tolist()
        # A foot that still touches would be dragged over the ground.
        clear = footing.clearance(footing.ground_below)
        target = here_x + clear * (x - here_x), here_y + clear * (y - here_y), max(z, lowest)
        found = self._within_reach(footing, target, room_below)
        part = device.feet[swing]
        if part is not None and part.velocity and math.dist(found.tolist(), (x, y, z)) < _THERE:
            self.rate = part.velocity
        return found

    def _within_reach(
        self, footing: Footing, target: Vector, room_below: float
    ) -> Float64[np.ndarray, "3"]:
        """The nearest place where the foot in the air can be [m]."""
        swing = footing.other
        faces = math.atan2(footing.heading[1], footing.heading[0])
        left, right = footing.yaws
        return self._range.bring_back(
            swing,
            target,
            footing.anchors[footing.stance],
            self._range.hip(swing, footing.dynamics),
            footing.heading,
            lower=room_below,
            turns=(wrapped(left - faces), wrapped(right - faces)),
        )


_CALM = 0.8
"""Depth of the divergent component in the sole, over the deepest place's, for full speed."""

_TOUCH_SPEED = 0.15
"""Largest speed of a foot downwards at the height of the ground, for the paper's soles [m/s]."""

_SWING_TIME = 0.05
"""Time constant with which the swing foot's velocity is smoothed [s]."""


class FootVelocity:
    """Eq. (17c), gently down and smoothed; and as fast as the operator says that they are.

    With (17c) alone the foot is behind a device that moves by 1 / k_v: where its velocity is known,
    that is added.
    """

    def __init__(self, parameters: TeleopParameters) -> None:
        self._lower_speed = parameters.lower_speed
        self._gain = parameters.dt / (_SWING_TIME + parameters.dt)
        self.restart()

    def restart(self) -> None:
        """Another mode has begun."""
        self._smoothed = _AT_REST

    def towards(
        self,
        footing: Footing,
        target: Float64[np.ndarray, "3"],
        rate: Vector = _AT_REST,
        *,
        hurry: bool = False,
    ) -> Float64[np.ndarray, "3"]:
        """The velocity [m/s]."""
        (x, y, z), (rate_x, rate_y, rate_z) = target.tolist(), rate
        here_x, here_y, here_z = footing.sole(footing.other).tolist()
        x = POSITION_GAIN * (x - here_x) + rate_x
        y = POSITION_GAIN * (y - here_y) + rate_y
        z = POSITION_GAIN * (z - here_z) + rate_z
        # v_lim: 1 m/s for the paper's robot.
        fastest = footing.biped.size.tall
        part = fastest / max(fastest, math.hypot(x, y, z))
        x, y, z = part * x, part * y, part * z
        if not hurry:
            z = max(z, -self._lowering_speed(footing))
        if not footing.mode.single:
            return np.array([x, y, z])
        # Who is falling already has nothing to save by a slow foot.
        calm = 1.0 if hurry else _calm(footing)
        # Where the foot's velocity jumps, as with a device that jitters, the ZMP jumps too.
        (old_x, old_y, old_z), gain = self._smoothed, self._gain
        self._smoothed = (
            old_x + gain * (calm * x - old_x),
            old_y + gain * (calm * y - old_y),
            old_z + gain * (z - old_z),
        )
        return np.array(self._smoothed)

    def _lowering_speed(self, footing: Footing) -> float:
        """How fast the foot may come down: slowly where the ground may be [m/s]."""
        clear = footing.clearance(footing.highest_ground)
        touching = _TOUCH_SPEED * footing.biped.size.wide
        return touching + clear * (self._lower_speed - touching)


def _calm(footing: Footing) -> float:
    """Factor of the swing foot's speed along the ground: less the nearer the robot is to tipping.

    Swinging a leg takes angular momentum, which is then missing for the balance.
    """
    x, y, _ = footing.anchors[footing.stance].tolist()
    most = footing.support.depth((x, y))
    if most <= 0.0:
        # A sole tilted so far that no ground is left under it.
        return 0.0
    return min(1.0, max(0.0, footing.capture_depth / (_CALM * most)))
