"""`FootDevices`: foot intent of an operator, from lift to touchdown.

`DeviceEvents`: events (14) of two foot devices and the loads of the soles.
"""

import math

import numpy as np
from jaxtyping import Float64

from poise.locomotion._stepping._feet._foot import FootTarget, FootVelocity
from poise.locomotion._stepping._operator import OperatorSample
from poise.locomotion._stepping._stance import (
    LANDED,
    Footing,
    FootRange,
    TeleopParameters,
    turn_to_left,
    wrapped,
)
from poise.locomotion._walking import HeldFlight, StepEnd

_STUCK_TIME = 0.3
"""A foot that still carries so long after it should have been lifted stays on the ground [s]."""

_UNLOADED = 0.02
"""Time without load after which a foot has left the ground [s]."""

_SHIFT_TIMEOUT = 3.0
"""A weight shift that takes longer gives both feet back [s]."""

_FARTHEST = 0.03
"""Largest distance of the reference of the swing foot from the foot [m]."""

_TURN_RATE, _CLEAR = 1.0, 0.02
"""Turning of a swing foot [rad/s], and its least height for that [m]."""

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
            loads = self._footing.sensor.loads
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
    """Swing foot by an operator's device, within reach: a `FootMotion` of the stepping engine.

    Attributes:
        sent: where the swing foot is sent [m].
        turns: commanded yaw of the left and of the right foot [rad].
        room_below: how far the body may still come down for a foot [m].
        falling: whether the stance leg does not hold the robot, so that the foot is put down.
    """

    def __init__(self, reach: FootRange, parameters: TeleopParameters) -> None:
        super().__init__(parameters)
        self._target, self._velocity = FootTarget(reach, parameters), FootVelocity(parameters)
        self.sent: Float64[np.ndarray, "3"] = np.full(3, np.nan)
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
        if here_z - footing.ground_below > _CLEAR:
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
