"""Feet that an operator leads: `FootTarget`, `FootVelocity`, `FootDevices`, and `Level`."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from poise.control import Controller
from poise.dynamics import Dynamics, RobotState
from poise.locomotion._stepping._operator import BodyCommand, OperatorGuard, OperatorSample, Vector
from poise.locomotion._stepping._stance import (
    LANDED,
    POSITION_GAIN,
    Biped,
    Footing,
    StanceEstimator,
    TeleopParameters,
)
from poise.locomotion._support import SingleSupportRegion, Vector2, Vector3
from poise.locomotion._walking import (
    CLEAR,
    FootRange,
    HeldFlight,
    Mode,
    StepEnd,
    turn_to_left,
    wrapped,
)
from poise.stack import Stack

_THERE = 1e-6
"""A foot is sent no nearer than this to where the operator says, whatever is rounded [m]."""

_HANGS, _COMES = 0.005, 0.002
"""Height over its target of a foot that has not arrived; descent of one that comes [m]."""

_PATIENCE, _DRAWN = 0.4, 0.05
"""Time for which a foot may hang, and speed at which it is drawn nearer then [s, m/s]."""


class FootTarget:
    """Eq. (15d): after the device while in the air, and held while on the ground."""

    def __init__(self, reach: FootRange, parameters: TeleopParameters) -> None:
        self._range, self._parameters = reach, parameters
        self.restart()
        # Velocity of the device, where the foot is sent to its place [m/s].
        self.rate: Vector = (0.0, 0.0, 0.0)

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
    ) -> Vector3:
        """The place [m]."""
        here = footing.sole(footing.other)
        self.rate = (0.0, 0.0, 0.0)
        if not footing.mode.single:
            x, y, z = footing.anchors[footing.other].tolist()
            return np.array([x, y, z - footing.pressed])
        self.rescuing = self.rescuing or falling
        lowest = footing.lowest_ground - self._parameters.press_depth
        if device is None or self.rescuing:
            # Without a command straight down, until touchdown.
            sent = np.array([here[0], here[1], lowest])
        else:
            # One that has not left the ground yet would push the robot over.
            down = lowest if footing.has_left else float(here[2])
            sent = self._followed(footing, device, down, room_below)
        if self._hangs(footing, float(sent[2])):
            self.rate = (0.0, 0.0, 0.0)
            return self._nearer(footing, float(sent[2]), room_below)
        return sent

    def _hangs(self, footing: Footing, sent: float) -> bool:
        """Return whether the foot is sent to the ground and has not got lower for a while."""
        height = float(footing.sole(footing.other)[2])
        if sent > min(height - _HANGS, footing.highest_ground) or not footing.has_left:
            self._comes()
            return False
        if self._hung < _PATIENCE:
            if height < self._least - _COMES:
                self._least, self._hung = height, 0.0
            self._hung += self._parameters.dt
        return self._hung >= _PATIENCE

    def _nearer(self, footing: Footing, height: float, room_below: float) -> Vector3:
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
    ) -> Vector3:
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

    def _within_reach(self, footing: Footing, target: Vector, room_below: float) -> Vector3:
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
            lower=room_below,
            turns=(wrapped(left - faces), wrapped(right - faces)),
        )


_CALM = 0.8
"""Depth of the DCM in the sole, over the deepest place's, for full speed."""

_TOUCH_SPEED = 0.15
"""Largest speed of a foot downwards at the height of the ground, for the paper's soles [m/s]."""

_SWING_TIME = 0.05
"""Time constant with which the swing foot's velocity is smoothed [s]."""


class FootVelocity:
    """Eq. (17c) with the device's velocity as feedforward, gently down and smoothed."""

    def __init__(self, parameters: TeleopParameters) -> None:
        self._lower_speed = parameters.lower_speed
        self._gain = parameters.dt / (_SWING_TIME + parameters.dt)
        self.restart()

    def restart(self) -> None:
        """Another mode has begun."""
        self._smoothed: Vector = (0.0, 0.0, 0.0)

    def towards(
        self,
        footing: Footing,
        target: Vector3,
        rate: Vector = (0.0, 0.0, 0.0),
        *,
        hurry: bool = False,
    ) -> Vector3:
        """The velocity [m/s]."""
        (x, y, z), (rate_x, rate_y, rate_z) = target.tolist(), rate
        here_x, here_y, here_z = footing.sole(footing.other).tolist()
        x = POSITION_GAIN * (x - here_x) + rate_x
        y = POSITION_GAIN * (y - here_y) + rate_y
        z = POSITION_GAIN * (z - here_z) + rate_z
        # v_lim: 1 m/s for the paper's robot.
        fastest = footing.biped.tall
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
        """Return the largest speed downwards: low where the ground may be [m/s]."""
        clear = footing.clearance(footing.highest_ground)
        touching = _TOUCH_SPEED * footing.biped.wide
        return touching + clear * (self._lower_speed - touching)


def _calm(footing: Footing) -> float:
    """Factor of the swing foot's speed along the ground, smaller near to tipping."""
    x, y, _ = footing.anchors[footing.stance].tolist()
    most = footing.support.depth((x, y))
    if most <= 0.0:
        # A sole tilted so far that no ground is left under it.
        return 0.0
    return min(1.0, max(0.0, footing.capture_depth / (_CALM * most)))


_STUCK_TIME = 0.3
"""A foot that still carries so long after it should have been lifted stays on the ground [s]."""

_UNLOADED = 0.02
"""Time without load after which a foot has left the ground [s]."""

_SHIFT_TIMEOUT = 3.0
"""A weight shift that takes longer gives both feet back [s]."""

_FARTHEST = 0.03
"""Largest distance of the reference of the swing foot from the foot [m]."""

_TURN_RATE = 1.0
"""Turning of a swing foot [rad/s]."""

FOOT_TURNS = (0.12, 0.6)
"""Largest turn of a foot inwards and outwards against the other one [rad]."""


class LiftDetector:
    """Rising edge of a device's height, with hysteresis."""

    def __init__(self, parameters: TeleopParameters) -> None:
        self._lift, self._lower = parameters.lift_height, parameters.lower_height
        # A device that is up at the start has to come down first.
        self._up = True

    def update(self, height: float) -> bool:
        """Take the device's height above its foot's place on the ground [m]."""
        if height < self._lower:
            self._up = False
            return False
        if height > self._lift and not self._up:
            self._up = True
            return True
        return False

    def is_low(self, height: float) -> bool:
        """Return whether a height counts as lowered [m]."""
        return height < self._lower

    def reset(self, height: float) -> None:
        """Begin with a device at a height: one that is up has to be lowered first."""
        self._up = height > self._lift


class LandingDetector:
    """Touchdown of the swing foot, once it has been without load for a while (`armed`)."""

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self.reset()

    def reset(self) -> None:
        """Begin with a foot that is about to leave the ground."""
        self._unloaded, self._since, self.armed = 0.0, 0.0, False

    def update(self, load: float, *, lifting: bool) -> bool:
        """Take one tick."""
        self._since += self._dt
        if not self.armed:
            self._unloaded = self._unloaded + self._dt if load < 0.5 * LANDED else 0.0
            self.armed = self._unloaded >= _UNLOADED
            return load > LANDED and self._since > _STUCK_TIME
        return load > LANDED and not lifting


class DeviceEvents:
    """The events (14) of two foot devices, and those that the paper leaves open."""

    def __init__(self, parameters: TeleopParameters) -> None:
        self._lower_height = parameters.lower_height
        self._lifts = (LiftDetector(parameters), LiftDetector(parameters))
        self._landing = LandingDetector(parameters.dt)
        self._command: OperatorSample | None = None
        self._held = (False, False)
        self._footing: Footing | None = None

    @property
    def foot_has_left(self) -> bool:
        """True once the swing foot has left the ground."""
        return self._landing.armed

    def update(
        self, command: OperatorSample | None, held: tuple[bool, bool], footing: Footing
    ) -> None:
        """Take one tick."""
        self._command, self._held, self._footing = command, held, footing

    def stand(self) -> None:
        """Begin double support; the feet's places are known."""
        for foot, lift in enumerate(self._lifts):
            lift.reset(0.0 if self._command is None else self._height(self._command, foot))

    def lifted(self) -> int | None:
        """Return the foot whose device was lifted, eqs (14a) and (14b); once a tick."""
        command = self._command
        if command is None or self._footing is None:
            return None
        left, right = (
            lift.update(self._height(command, foot)) for foot, lift in enumerate(self._lifts)
        )
        if left and right:
            # Both in one tick: the foot that carries less goes first, the other has to ask again.
            loads = self._footing.sense.loads
            return 0 if loads[0] < loads[1] else 1
        if left:
            return 0
        return 1 if right else None

    def end_of_shift(self, foot: int, since: float) -> StepEnd | None:
        """Return why a foot that is about to be lifted stays on the ground; None to go on."""
        if since > _SHIFT_TIMEOUT:
            return self._end(StepEnd.LATE, foot)
        return self._end(StepEnd.LOWERED, foot) if self._is_lowered(foot) else None

    def take_off(self, foot: int) -> None:
        """Begin the swing of a foot, 0 left, 1 right."""
        del foot
        self._landing.reset()

    def end_of_swing(self, foot: int, load: float, *, rescuing: bool = False) -> StepEnd | None:
        """Return how the swing has ended; None while it goes on."""
        landed = self._landing.update(load, lifting=not rescuing and self._is_sent_up(foot))
        has_left = self._landing.armed
        if has_left and not landed:
            return None
        if rescuing:
            return StepEnd.RESCUED
        if landed:
            return self._end(StepEnd.LANDED if has_left else StepEnd.STUCK, foot)
        return self._end(StepEnd.LOWERED, foot) if self._is_lowered(foot) else None

    def _end(self, ended: StepEnd, foot: int) -> StepEnd:
        return ended if self._held[foot] else StepEnd.LOST

    def _is_lowered(self, foot: int) -> bool:
        command = self._command
        return command is None or self._lifts[foot].is_low(self._height(command, foot))

    def _is_sent_up(self, foot: int) -> bool:
        if self._command is None or self._footing is None:
            return False
        above = self._command.place(foot)[2] - float(self._footing.sole(foot)[2])
        return above > self._lower_height

    def _height(self, command: OperatorSample, foot: int) -> float:
        """Height of a device above its foot's place on the ground [m]."""
        assert self._footing is not None
        return float(command.place(foot)[2] - self._footing.anchors[foot][2])


class FootDevices(DeviceEvents):
    """Swing foot by an operator's device, within reach: a `FootMotion` of the stepping engine."""

    def __init__(self, reach: FootRange, parameters: TeleopParameters) -> None:
        super().__init__(parameters)
        self._target, self._velocity = FootTarget(reach, parameters), FootVelocity(parameters)
        self.sent: Vector3 = np.full(3, np.nan)  # where the swing foot is sent [m]
        self.turns, self.room_below, self._yaw = (0.0, 0.0), 0.0, 0.0
        self.falling = False

    def take_off(self, foot: int) -> None:
        """Begin the swing of a foot, 0 left, 1 right."""
        super().take_off(foot)
        self._target.restart()
        self._velocity.restart()
        if self._footing is not None:
            self._yaw, self.sent = self._footing.yaws[foot], self._footing.sole(foot).copy()

    def end_of_swing(self, foot: int, load: float, *, rescuing: bool = False) -> StepEnd | None:
        """Return the end of the swing, by the load over the weight; None while it goes on."""
        return super().end_of_swing(foot, load, rescuing=rescuing or self._target.rescuing)

    def move(self, flight: HeldFlight, dt: float) -> None:
        """Move the swing foot to where its device is, never far ahead of one that cannot follow."""
        footing, foot = self._footing, flight.foot
        if footing is None or footing.mode.support != 1 - foot or not footing.mode.single:
            # The tick of lift-off.
            return
        target = self._target
        self.sent = target.place(
            footing, self._command, room_below=self.room_below, falling=self.falling
        )
        velocity = self._velocity.towards(footing, self.sent, target.rate, hurry=target.rescuing)
        (x, y, z), (vx, vy, vz) = flight.swing.position.tolist(), velocity.tolist()
        here_x, here_y, here_z = footing.sole(foot).tolist()
        x, y, z = x + dt * vx, y + dt * vy, z + dt * vz
        gap_x, gap_y, gap_z = x - here_x, y - here_y, z - here_z
        far = math.sqrt(gap_x * gap_x + gap_y * gap_y + gap_z * gap_z)
        if far > _FARTHEST:
            part = _FARTHEST / far
            x, y, z = here_x + part * gap_x, here_y + part * gap_y, here_z + part * gap_z
        if here_z - footing.ground_below > CLEAR:
            self._turn(foot, footing, dt)
        yaw = self._yaw
        flight.move(np.array([x, y, z]), velocity, turn_to_left(yaw), yaw)

    def _turn(self, foot: int, footing: Footing, dt: float) -> None:
        """Turn a foot as far as it may be against the other one."""
        other, (inwards, outwards) = footing.yaws[1 - foot], FOOT_TURNS
        least, most = (-inwards, outwards) if foot == 0 else (-outwards, inwards)
        goal = other + min(max(wrapped(self.turns[foot] - other), least), most)
        change, step = wrapped(goal - self._yaw), dt * _TURN_RATE
        self._yaw += max(-step, min(step, change))


@dataclass(slots=True, eq=False)
class OperatorTick:
    """Command of a tick."""

    guard: OperatorGuard
    command: OperatorSample | None  # of the feet; None while they are lost
    body: BodyCommand
    torso: tuple[float, float, float]  # roll, pitch and yaw [rad]
    turns: tuple[float, float]  # yaw of the left and of the right foot [rad]
    upright: bool  # an upright torso comes first


class LevelTick(NamedTuple):
    """Outcome of a tick."""

    target: Vector3  # of the swing foot [m]
    zmp_reference: Vector2  # [m]
    cart_table_zmp: Vector2  # (26) of the commanded acceleration [m]
    ended: StepEnd | None  # None while a step goes on, and before the first


class Level(ABC):
    """Leader of a stack that is solved for torques, or for velocities."""

    def __init__(
        self,
        biped: Biped,
        parameters: TeleopParameters,
        reach: FootRange,
        estimator: StanceEstimator,
        stack: Stack,
    ) -> None:
        self._biped, self._parameters, self._reach = biped, parameters, reach
        self._estimator, self.stack = estimator, stack
        self.footing: Footing | None = None  # of the last tick

    @abstractmethod
    def reset(self) -> None:
        """Stand on both feet as at the start."""

    @abstractmethod
    def controller(self, dynamics: Dynamics, time_limit: float | None) -> Controller:
        """Return the controller of the stack."""

    @property
    @abstractmethod
    def mode(self) -> Mode:
        """Feet that carry the robot."""

    @abstractmethod
    def outcome(self, footing: Footing) -> LevelTick:
        """Return the outcome of the last tick, before the next one begins."""

    @abstractmethod
    def lead(self, state: RobotState, operator: OperatorTick) -> bool:
        """Set the stack for a tick; return whether a walk by velocity has ended in it."""

    def _begin(self, omega: float, region: SingleSupportRegion) -> None:
        """Stand on both feet as at the start, over what stays the same of each `Footing`."""
        self.footing = None
        self._stand = partial(
            Footing,
            biped=self._biped,
            estimator=self._estimator,
            omega=omega,
            region=region,
        )
