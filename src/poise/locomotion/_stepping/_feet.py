"""Feet by an operator's devices: `FootDevices`, and `SteppingLevel`, a leader by them."""

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from poise.locomotion._stepping._biped import Biped, TeleopParameters
from poise.locomotion._stepping._estimator import (
    LANDED,
    POSITION_GAIN,
    TOUCH_SPEED,
    StanceEstimator,
)
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._sample import OperatorSample, Vector
from poise.locomotion._support import SingleSupportRegion, Vector2, Vector3
from poise.locomotion._walking import (
    CLEAR,
    GIVES,
    FootRange,
    HeldFlight,
    StepEnd,
    turn_to_left,
    wrapped,
)
from poise.stack import Stack

_THERE = 1e-6
"""Least distance of a foot's target from the operator's, against rounding [m]."""

_COMES = 0.002
"""Height over its target of a foot that has not arrived; descent of one that comes [m]."""

_PATIENCE, _DRAWN = 0.3, 0.05
"""Time for which a foot may carry that should have been lifted, or hang that should come down [s];
speed at which it is drawn nearer then [m/s]."""

_CALM = 0.8
"""Depth of the DCM in the sole, over the deepest place's, for full speed."""

_SWING_TIME = 0.05
"""Time constant with which the swing foot's velocity is smoothed [s]."""

_UNLOADED = 0.02
"""Time without load after which a foot has left the ground [s]."""

_SHIFT_TIMEOUT = 3.0
"""A weight shift that takes longer gives both feet back [s]."""

FARTHEST = 0.03
"""Largest distance of the reference of a foot or hand from it [m]: when the device comes back, so
does the hand."""

_TURN_RATE = 1.0
"""Turning of a swing foot [rad/s]."""

FOOT_TURNS = (0.12, 0.6)
"""Largest turn of a foot inwards and outwards against the other one [rad]."""


class FootDevices:
    """`FootMotion` by two devices: events (14), and (15d) and (17c) of the swing foot."""

    def __init__(self, reach: FootRange, parameters: TeleopParameters) -> None:
        self._range, self._parameters, self._dt = reach, parameters, parameters.dt
        self.turns, self._yaw = (0.0, 0.0), 0.0
        self.room_below, self.falling = 0.0, False
        # A device that is up at the start has to come down first.
        self._up = [True, True]
        self.sent: Vector3 = np.full(3, np.nan)  # where the foot that is not the stance goes [m]
        self._restart()

    def _restart(self) -> None:
        self.rescuing = self.foot_has_left = False
        self._unloaded = self._since = 0.0
        # Velocity of the device, where the foot is sent to its place [m/s].
        self.rate: Vector = (0.0, 0.0, 0.0)
        self._smoothed = self.rate
        self._comes()

    def _comes(self) -> None:
        """The foot does not hang."""
        self._least, self._hung = math.inf, 0.0

    def update(
        self, command: OperatorSample | None, held: tuple[bool, bool], footing: Footing
    ) -> None:
        """Take one tick."""
        self._command, self._held, self._footing = command, held, footing

    def limit_descent(self, lowest: float) -> float:
        """Raise the lowest height of the CoM over the ground to what the stance knee holds [m]."""
        footing, reach, stance = self._footing, self._range, self._footing.stance
        hip = reach.hip(stance, footing.dynamics)
        too_weak = reach.too_weak(stance, footing.anchors[stance], hip, footing.heading)
        height = float(footing.com[2]) - footing.ground
        lowest = max(lowest, height + too_weak)
        self.room_below = max(height - lowest, 0.0)
        self.falling = footing.mode.single and too_weak > GIVES
        return lowest

    # Events ---------------------------------------------------------------------------------------

    def stand(self) -> None:
        """Begin double support; the feet's places are known."""
        self._restart()
        self._up = [self._height(foot) > self._parameters.lift_height for foot in (0, 1)]

    def lifted(self) -> int | None:
        """Return the foot whose device was lifted, eqs (14a) and (14b); once a tick."""
        lifted, loads = [foot for foot in (0, 1) if self._rises(foot)], self._footing.sense.loads
        # Both in one tick: the foot that carries less goes first, the other has to ask again.
        return min(lifted, key=lambda foot: (loads[foot], -foot), default=None)

    def _rises(self, foot: int) -> bool:
        """Return the rising edge of a device's height, with hysteresis."""
        p, before, height = self._parameters, self._up[foot], self._height(foot)
        high = height > p.lift_height
        self._up[foot] = high or (before and not height < p.lower_height)
        return high and not before

    def end_of_shift(self, foot: int, since: float) -> StepEnd | None:
        """Return why a foot that is about to be lifted stays on the ground; None to go on."""
        if since > _SHIFT_TIMEOUT:
            return self._end(StepEnd.LATE, foot)
        return self._end(StepEnd.LOWERED, foot) if self._is_lowered(foot) else None

    def take_off(self, foot: int) -> None:
        """Begin the swing of a foot, 0 left, 1 right."""
        self._restart()
        self._yaw, self.sent = self._footing.yaws[foot], self._footing.sole(foot).copy()

    def end_of_swing(self, foot: int, load: float) -> StepEnd | None:
        """Return the end of the swing, by the load over the weight; None while it goes on."""
        self._since += self._dt
        if self.foot_has_left:
            landed = load > LANDED and (self.rescuing or not self._is_sent_up(foot))
        else:
            self._unloaded = self._unloaded + self._dt if load < 0.5 * LANDED else 0.0
            self.foot_has_left = self._unloaded >= _UNLOADED
            landed = load > LANDED and self._since > _PATIENCE
        if self.foot_has_left and not landed:
            return None
        if self.rescuing:
            return StepEnd.RESCUED
        if landed:
            return self._end(StepEnd.LANDED if self.foot_has_left else StepEnd.STUCK, foot)
        return self._end(StepEnd.LOWERED, foot) if self._is_lowered(foot) else None

    def _end(self, ended: StepEnd, foot: int) -> StepEnd:
        return ended if self._held[foot] else StepEnd.LOST

    def _is_lowered(self, foot: int) -> bool:
        return self._height(foot) < self._parameters.lower_height

    def _is_sent_up(self, foot: int) -> bool:
        if self._command is None:
            return False
        above = self._command.place(foot)[2] - float(self._footing.sole(foot)[2])
        return above > self._parameters.lower_height

    def _height(self, foot: int) -> float:
        """Height of a device above its foot's place on the ground; zero without a command [m]."""
        if self._command is None:
            return 0.0
        return self._command.place(foot)[2] - float(self._footing.anchors[foot][2])

    # The swing foot -------------------------------------------------------------------------------

    def move(self, flight: HeldFlight, dt: float) -> None:
        """Move the swing foot to where its device is, never far ahead of one that cannot follow."""
        footing, foot = self._footing, flight.foot
        if footing.mode.support != 1 - foot or not footing.mode.single:
            # The tick of lift-off.
            return
        self.aim()
        velocity = self.velocity()
        (x, y, z), (vx, vy, vz) = flight.position.tolist(), velocity.tolist()
        here_x, here_y, here_z = footing.sole(foot).tolist()
        x, y, z = x + dt * vx, y + dt * vy, z + dt * vz
        gap_x, gap_y, gap_z = x - here_x, y - here_y, z - here_z
        far = math.hypot(gap_x, gap_y, gap_z)
        if far > FARTHEST:
            part = FARTHEST / far
            x, y, z = here_x + part * gap_x, here_y + part * gap_y, here_z + part * gap_z
        if here_z - footing.ground_below > CLEAR:
            self._turn(foot, footing, dt)
        flight.move(np.array([x, y, z]), velocity, turn_to_left(self._yaw), self._yaw)

    def _turn(self, foot: int, footing: Footing, dt: float) -> None:
        """Turn a foot as far as it may be against the other one."""
        other, (inwards, outwards) = footing.yaws[1 - foot], FOOT_TURNS
        least, most = (-inwards, outwards) if foot == 0 else (-outwards, inwards)
        goal = other + min(max(wrapped(self.turns[foot] - other), least), most)
        change, step = wrapped(goal - self._yaw), dt * _TURN_RATE
        self._yaw += max(-step, min(step, change))

    def aim(self) -> Vector3:
        """Eq. (15d): send the foot after its device in the air, hold it on the ground [m]."""
        footing, self.rate = self._footing, (0.0, 0.0, 0.0)
        if footing.mode.single:
            self.sent = self._swing_place(footing)
        else:
            self.sent = footing.anchors[footing.other] - np.array([0.0, 0.0, footing.pressed])
        return self.sent

    def _swing_place(self, footing: Footing) -> Vector3:
        swing = footing.other
        x, y, height = footing.sole(swing).tolist()
        lowest = footing.lowest_ground - self._parameters.press_depth
        self.rescuing = self.rescuing or self.falling
        if self._command is None or self.rescuing:
            # Without a command straight down, until touchdown.
            sent = np.array([x, y, lowest])
        else:
            # One that has not left the ground yet would push the robot over.
            sent = self._followed(footing, lowest if footing.has_left else height)
        down = float(sent[2])
        if not self._hangs(footing, down):
            return sent
        # Towards the hip from where the foot is: straight down it would hang for ever.
        self.rate = (0.0, 0.0, 0.0)
        to_x, to_y = self._range.below_hip(swing, footing.dynamics)
        far = math.hypot(to_x - x, to_y - y)
        part = min(1.0, _DRAWN / POSITION_GAIN / max(far, _THERE))
        return self._within_reach(footing, (x + part * (to_x - x), y + part * (to_y - y), down))

    def _hangs(self, footing: Footing, sent: float) -> bool:
        """Return whether the foot is sent to the ground and has not got lower for a while."""
        height = float(footing.sole(footing.other)[2])
        if sent > min(height - _COMES, footing.highest_ground) or not footing.has_left:
            self._comes()
            return False
        if self._hung < _PATIENCE:
            if height < self._least - _COMES:
                self._least, self._hung = height, 0.0
            self._hung += self._dt
        return self._hung >= _PATIENCE

    def _followed(self, footing: Footing, lowest: float) -> Vector3:
        """The operator's device, where a foot can be and no lower than it may [m]."""
        assert self._command is not None
        swing = footing.other
        (x, y, z), (here_x, here_y, _) = self._command.place(swing), footing.sole(swing).tolist()
        # A foot that still touches would be dragged over the ground.
        clear = footing.clearance(footing.ground_below)
        target = here_x + clear * (x - here_x), here_y + clear * (y - here_y), max(z, lowest)
        found, part = self._within_reach(footing, target), self._command.feet[swing]
        if part is not None and part.velocity and math.dist(found.tolist(), (x, y, z)) < _THERE:
            self.rate = part.velocity
        return found

    def _within_reach(self, footing: Footing, target: Vector) -> Vector3:
        """The nearest place where the swing foot can be [m]."""
        swing = footing.other
        faces = math.atan2(footing.heading[1], footing.heading[0])
        left, right = footing.yaws
        return self._range.bring_back(
            swing,
            target,
            footing.anchors[footing.stance],
            self._range.hip(swing, footing.dynamics),
            footing.heading,
            lower=self.room_below,
            turns=(wrapped(left - faces), wrapped(right - faces)),
        )

    def velocity(self) -> Vector3:
        """Eq. (17c) with the device's velocity as feedforward, gently down and smoothed [m/s]."""
        footing, hurry, biped = self._footing, self.rescuing, self._footing.biped
        (x, y, z), (rate_x, rate_y, rate_z) = self.sent.tolist(), self.rate
        here_x, here_y, here_z = footing.sole(footing.other).tolist()
        x = POSITION_GAIN * (x - here_x) + rate_x
        y = POSITION_GAIN * (y - here_y) + rate_y
        z = POSITION_GAIN * (z - here_z) + rate_z
        # v_lim: 1 m/s for the paper's robot.
        part = biped.tall / max(biped.tall, math.hypot(x, y, z))
        x, y, z = part * x, part * y, part * z
        if not hurry:
            # Low where the ground may be.
            touching = TOUCH_SPEED * biped.wide
            clear = footing.clearance(footing.highest_ground)
            z = max(z, -(touching + clear * (self._parameters.lower_speed - touching)))
        if not footing.mode.single:
            return np.array([x, y, z])
        # Who is falling already has nothing to save by a slow foot.
        calm = 1.0 if hurry else _calm(footing)
        # Where the foot's velocity jumps, as with a device that jitters, the ZMP jumps too.
        (old_x, old_y, old_z), gain = self._smoothed, self._dt / (_SWING_TIME + self._dt)
        self._smoothed = (
            old_x + gain * (calm * x - old_x),
            old_y + gain * (calm * y - old_y),
            old_z + gain * (z - old_z),
        )
        return np.array(self._smoothed)


def _calm(footing: Footing) -> float:
    """Factor of the swing foot's speed along the ground, smaller near to tipping."""
    x, y, _ = footing.anchors[footing.stance].tolist()
    most = footing.support.depth((x, y))
    # A sole tilted so far that no ground is left under it.
    return 0.0 if most <= 0.0 else min(1.0, max(0.0, footing.capture_depth / (_CALM * most)))


class LevelTick(NamedTuple):
    """Outcome of a tick."""

    target: Vector3  # of the swing foot [m]
    zmp_reference: Vector2  # [m]
    cart_table_zmp: Vector2  # (26) of the commanded acceleration [m]
    ended: StepEnd | None  # None while a step goes on, and before the first


class SteppingLevel:
    """Leader of a stack that is solved for torques, or for velocities."""

    def __init__(
        self,
        biped: Biped,
        parameters: TeleopParameters,
        estimator: StanceEstimator,
        stack: Stack,
        *,
        servos: bool,
    ) -> None:
        self._biped, self._parameters = biped, parameters
        self._reach = biped.foot_range(parameters, servos=servos)
        self._estimator, self.stack = estimator, stack
        self.footing: Footing | None = None  # of the last tick

    def _begin(self, omega: float, region: SingleSupportRegion) -> None:
        """Stand on both feet as at the start, over what stays the same of each `Footing`."""
        self._devices = FootDevices(self._reach, self._parameters)
        self.footing = None
        self._stand = partial(
            Footing,
            biped=self._biped,
            estimator=self._estimator,
            omega=omega,
            region=region,
        )
