"""`ModeEvents`: keeps the mode, and decides from hands and loads when it ends."""

import numpy as np

from poise.teleop.com_motion import ComMotion
from poise.teleop.detectors import LandingDetector, LiftDetector
from poise.teleop.device import DeviceSample
from poise.teleop.estimator import StanceEstimator
from poise.teleop.modes import Event, Mode, ModeMachine
from poise.teleop.parameters import TeleopParameters
from poise.teleop.rules import Rules
from poise.teleop.zmp import ZmpSensor


class ModeEvents:
    """The events (14), and those that the paper leaves open.

    Args:
        estimator: says where the feet are.
        sensor: says what they carry.
        com: says where the COM is going.
        parameters: distances, loads and times.
        rules: departures from the paper.
        weight: of the robot [N].
    """

    def __init__(
        self,
        estimator: StanceEstimator,
        sensor: ZmpSensor,
        com: ComMotion,
        parameters: TeleopParameters,
        rules: Rules,
        weight: float,
    ) -> None:
        self._estimator, self._sensor, self._com = estimator, sensor, com
        self._parameters, self._rules = parameters, rules
        self._lifts = (LiftDetector(parameters), LiftDetector(parameters))
        self._landing = LandingDetector(parameters, weight, arm=rules.armed_landing)
        self._machine, self._shifted = ModeMachine(), 0.0

    @property
    def mode(self) -> Mode:
        """Which feet carry the robot."""
        return self._machine.mode

    @property
    def foot_has_left(self) -> bool:
        """Whether the foot that is lifted has left the ground."""
        return self._landing.armed

    def advance(self, device: DeviceSample | None, time: float, *, rescuing: bool) -> bool:
        """Moves the mode on if something happened.

        Args:
            device: the operator's hands, None while they are lost.
            time: now [s].
            rescuing: whether the foot in the air is put down whatever the operator wants.

        Returns:
            Whether another mode has begun.
        """
        event = self._event(device, time, rescuing=rescuing)
        return event is not None and self._machine.advance(event, time)

    def begin(self, device: DeviceSample | None) -> None:
        """Starts the detectors of a mode that has just begun; the feet's places are known."""
        self._shifted = 0.0
        if self.mode is not Mode.D:
            self._landing.reset()
            return
        for foot, lift in enumerate(self._lifts):
            lift.reset(0.0 if device is None else self._lift_height(device, foot))

    def _event(self, device: DeviceSample | None, time: float, *, rescuing: bool) -> Event | None:
        support = self.mode.support
        if support is None:
            return self._lifted(device)
        swing = 1 - support
        if self.mode.single:
            return self._landed(device, swing, rescuing=rescuing)
        late = time - self._machine.since > self._parameters.shift_timeout
        if self._rules.cancel and (self._is_given_back(device, swing) or late):
            return Event.CANCEL
        return self._shift(support)

    def _lifted(self, device: DeviceSample | None) -> Event | None:
        """Eqs (14a) and (14b): a device has been lifted in double support."""
        if device is None:
            return None
        left, right = (
            lift.update(self._lift_height(device, foot)) for foot, lift in enumerate(self._lifts)
        )
        if left and right:
            # Both at once: the foot that carries less goes first, the other has to ask again.
            loads = self._sensor.loads
            return Event.LIFT_LEFT if loads[0] < loads[1] else Event.LIFT_RIGHT
        if left:
            return Event.LIFT_LEFT
        return Event.LIFT_RIGHT if right else None

    def _landed(self, device: DeviceSample | None, swing: int, *, rescuing: bool) -> Event | None:
        """The foot in the air has landed, or has not left the ground and need not any more."""
        load = float(self._sensor.loads[swing])
        lifting = not rescuing and self._is_sent_up(device, swing)
        if self._landing.update(load, lifting=lifting):
            return Event.LANDED
        if self._rules.cancel and not self._landing.armed:
            unwanted = rescuing or self._is_given_back(device, swing)
            return Event.LANDED if unwanted else None
        return None

    def _shift(self, support: int) -> Event | None:
        """The weight is on the foot that shall carry, for long enough."""
        p = self._parameters
        self._shifted = self._shifted + p.dt if self._has_shifted(support) else 0.0
        wanted = p.shift_time if self._rules.safe_lift else 0.0
        return Event.SHIFTED if self._shifted > wanted else None

    def _has_shifted(self, support: int) -> bool:
        p, dynamics = self._parameters, self._estimator.dynamics
        place, com = self._estimator.anchors[support][:2], dynamics.com[:2]
        if np.linalg.norm(self._sensor.zmp - place) > p.r_lift:
            return False
        if not self._rules.safe_lift:
            return True
        if np.linalg.norm(self._com.cart_table_zmp(com) - place) > p.ct_zmp_max:
            return False
        # As commanded, and as it is: the robot lags behind a command that has just turned.
        return all(
            float(np.linalg.norm(com + velocity / self._com.omega - place)) < p.capture_max
            for velocity in (self._com.velocity, dynamics.com_velocity[:2])
        )

    def _is_given_back(self, device: DeviceSample | None, swing: int) -> bool:
        """Whether nobody wants a foot in the air that is still on the ground."""
        return device is None or self._lifts[swing].is_low(self._lift_height(device, swing))

    def _is_sent_up(self, device: DeviceSample | None, swing: int) -> bool:
        if device is None:
            return False
        above = float(device.hand(swing)[2] - self._estimator.sole(swing)[2])
        return above > self._parameters.lower_height

    def _lift_height(self, device: DeviceSample, foot: int) -> float:
        """How far a device is above its foot's place on the ground [m]."""
        return float(device.hand(foot)[2] - self._estimator.anchors[foot][2])
