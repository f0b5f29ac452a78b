"""`ModeEvents`: keeps the mode, and decides from devices and loads when it ends.

Detectors of lifted devices and landed feet.
"""

import numpy as np

from poise.locomotion._stepping._by_torque import ComFeedback
from poise.locomotion._stepping._by_velocity import ComMotion
from poise.locomotion._stepping._operator import OperatorSample
from poise.locomotion._stepping._stance import (
    WIDE,
    Mode,
    ModeEvent,
    ModeMachine,
    OneFoot,
    StanceEstimator,
    StepEnd,
    TeleopParameters,
    ZmpSensor,
    inner_side,
)

_STUCK_TIME = 0.3
"""A foot that still carries so long after it should have been lifted stays on the ground [s]."""


class LiftDetector:
    """Whether a device has just been lifted: a rising edge with hysteresis.

    Args:
        parameters: lift and lower heights.
    """

    def __init__(self, parameters: TeleopParameters) -> None:
        self._lift, self._lower = parameters.lift_height, parameters.lower_height
        # A device that is up at the start has to come down first.
        self._up = True

    def update(self, height: float) -> bool:
        """Takes the device's height above its foot's place on the ground [m]."""
        if height < self._lower:
            self._up = False
            return False
        if height > self._lift and not self._up:
            self._up = True
            return True
        return False

    def is_low(self, height: float) -> bool:
        """Whether a height counts as lowered [m]."""
        return height < self._lower

    def reset(self, height: float) -> None:
        """Starts over: a device that is up now has to come down first.

        One that is neither up nor down is not up: its foot may have settled below where it rests.
        """
        self._up = height > self._lift


class LandingDetector:
    """Whether the foot in the air has landed, once it has been without load for a while.

    Args:
        parameters: loads and time.
        weight: of the robot [N].

    Attributes:
        load: from which on a foot counts as on the ground [N].
        armed: whether the foot has left the ground.
    """

    def __init__(self, parameters: TeleopParameters, weight: float) -> None:
        self.load = parameters.land_load * weight
        self._unload = parameters.unload_load * weight
        self._time, self._dt = parameters.unload_time, parameters.dt
        self.reset()

    def reset(self) -> None:
        """The foot is about to leave the ground."""
        self._unloaded, self._since, self.armed = 0.0, 0.0, False

    def update(self, load: float, *, lifting: bool) -> bool:
        """Takes one tick.

        Args:
            load: on the foot [N].
            lifting: whether the foot is being sent upwards. A foot that scrapes over the ground
                while it is lifted has not landed.
        """
        self._since += self._dt
        if not self.armed:
            self._unloaded = self._unloaded + self._dt if load < self._unload else 0.0
            self.armed = self._unloaded >= self._time
            return load > self.load and self._since > _STUCK_TIME
        return load > self.load and not lifting


class ModeEvents:
    """The events (14), and those that the paper leaves open.

    Args:
        estimator: says where the feet are.
        sensor: says what they carry.
        com: says where the COM is going.
        parameters: distances, loads and times.
        weight: of the robot [N].
        one_foot: where the ZMP shall be on a foot that carries alone.

    Attributes:
        ended: how the last step ended; None while one goes on, and before the first.
    """

    def __init__(
        self,
        estimator: StanceEstimator,
        sensor: ZmpSensor,
        com: ComMotion | ComFeedback,
        parameters: TeleopParameters,
        weight: float,
        one_foot: OneFoot = WIDE,
    ) -> None:
        self._one_foot = one_foot
        self._estimator, self._sensor, self._com = estimator, sensor, com
        self._parameters = parameters
        self._lifts = (LiftDetector(parameters), LiftDetector(parameters))
        self._landing = LandingDetector(parameters, weight)
        self._machine, self._shifted = ModeMachine(), 0.0
        self.ended: StepEnd | None = None

    @property
    def mode(self) -> Mode:
        """Which feet carry the robot."""
        return self._machine.mode

    @property
    def foot_has_left(self) -> bool:
        """Whether the foot that is lifted has left the ground."""
        return self._landing.armed

    def advance(
        self,
        device: OperatorSample | None,
        held: tuple[bool, bool],
        time: float,
        *,
        rescuing: bool,
    ) -> bool:
        """Moves the mode on if something happened.

        Args:
            device: the operator's foot devices, None while they are lost.
            held: whether the left and the right one hold their feet.
            time: now [s].
            rescuing: whether the foot in the air is put down whatever the operator commands.

        Returns:
            Whether another mode has begun.
        """
        support = self.mode.support
        if support is None:
            event = self._lifted(device)
        elif self.mode.single:
            ended = self._end_of_step(device, 1 - support, rescuing=rescuing)
            event = self._ended(ended, ModeEvent.LANDED, held[1 - support])
        else:
            ended = self._end_of_shift(device, 1 - support, time)
            event = self._ended(ended, ModeEvent.CANCEL, held[1 - support]) or self._shift(support)
        if event in (ModeEvent.LIFT_LEFT, ModeEvent.LIFT_RIGHT):
            self.ended = None
        return event is not None and self._machine.advance(event, time)

    def follow(self, mode: Mode, time: float, ended: StepEnd | None) -> bool:
        """Takes over the mode from somebody else who leads the feet.

        Args:
            mode: what it is now.
            time: now [s].
            ended: how that ends what the operator did; None where nothing was ended.

        Returns:
            Whether it has changed.
        """
        self.ended = ended
        changed = mode is not self._machine.mode
        if changed:
            self._machine.mode, self._machine.since = mode, time
        return changed

    def begin(self, device: OperatorSample | None) -> None:
        """Starts the detectors of a mode that has just begun; the feet's places are known."""
        self._shifted = 0.0
        if self.mode is not Mode.D:
            self._landing.reset()
            return
        for foot, lift in enumerate(self._lifts):
            lift.reset(0.0 if device is None else self._lift_height(device, foot))

    def _ended(self, ended: StepEnd | None, event: ModeEvent, held: bool) -> ModeEvent | None:
        """The event with which a step ends, if it does.

        Args:
            ended: how, by what its foot does.
            event: that it is.
            held: whether the device holds its foot; that of one that does not is sent down.
        """
        if ended is None:
            return None
        self.ended = ended if held or ended is StepEnd.RESCUED else StepEnd.LOST
        return event

    def _lifted(self, device: OperatorSample | None) -> ModeEvent | None:
        """Eqs (14a) and (14b): a device has been lifted in double support."""
        if device is None:
            return None
        left, right = (
            lift.update(self._lift_height(device, foot)) for foot, lift in enumerate(self._lifts)
        )
        if left and right:
            # Both at once: the foot that carries less goes first, the other has to ask again.
            loads = self._sensor.loads
            return ModeEvent.LIFT_LEFT if loads[0] < loads[1] else ModeEvent.LIFT_RIGHT
        if left:
            return ModeEvent.LIFT_LEFT
        return ModeEvent.LIFT_RIGHT if right else None

    def _end_of_step(
        self, device: OperatorSample | None, swing: int, *, rescuing: bool
    ) -> StepEnd | None:
        """The foot in the air has landed, or has not left the ground and need not any more."""
        load = float(self._sensor.loads[swing])
        lifting = not rescuing and self._is_sent_up(device, swing)
        landed = self._landing.update(load, lifting=lifting)
        has_left = self._landing.armed
        if has_left and not landed:
            return None
        if rescuing:
            return StepEnd.RESCUED
        if landed:
            return StepEnd.LANDED if has_left else StepEnd.STUCK
        return StepEnd.LOWERED if self._is_given_back(device, swing) else None

    def _end_of_shift(
        self, device: OperatorSample | None, swing: int, time: float
    ) -> StepEnd | None:
        """A shift that takes too long, or that nobody wants any more."""
        if time - self._machine.since > self._parameters.shift_timeout:
            return StepEnd.LATE
        return StepEnd.LOWERED if self._is_given_back(device, swing) else None

    def _shift(self, support: int) -> ModeEvent | None:
        """The weight is on the foot that shall carry, for long enough."""
        p = self._parameters
        self._shifted = self._shifted + p.dt if self._has_shifted(support) else 0.0
        return ModeEvent.SHIFTED if self._shifted > p.shift_time else None

    def _has_shifted(self, support: int) -> bool:
        """Eq. (14e), and the COM too: while it brakes, the ZMP is there and the COM is not."""
        p, estimator, dynamics = self._parameters, self._estimator, self._estimator.dynamics
        anchor, com = estimator.anchors[support], dynamics.com[:2]
        place = self._one_foot.zmp(support, anchor, estimator.rotation(support))
        if np.linalg.norm(self._sensor.zmp - place) > p.r_lift:
            return False
        if np.linalg.norm(self._com.cart_table_zmp(com) - place) > p.ct_zmp_max:
            return False
        inwards = inner_side(support) * estimator.rotation(support)[:2, 1]
        # As commanded, and as it is: the robot lags behind a command that has just turned.
        for velocity in (self._com.velocity, self._com.observed):
            off = com + velocity / self._com.omega - place
            if np.linalg.norm(off) >= p.capture_max or off @ inwards > self._one_foot.arrival:
                return False
        return True

    def _is_given_back(self, device: OperatorSample | None, swing: int) -> bool:
        """Whether nobody wants a foot in the air that is still on the ground."""
        return device is None or self._lifts[swing].is_low(self._lift_height(device, swing))

    def _is_sent_up(self, device: OperatorSample | None, swing: int) -> bool:
        if device is None:
            return False
        above = float(device.place(swing)[2] - self._estimator.sole(swing)[2])
        return above > self._parameters.lower_height

    def _lift_height(self, device: OperatorSample, foot: int) -> float:
        """How far a device is above its foot's place on the ground [m]."""
        return float(device.place(foot)[2] - self._estimator.anchors[foot][2])
