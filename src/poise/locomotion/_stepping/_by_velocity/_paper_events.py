"""`PaperEvents`: the modes and events (14) where velocities are commanded."""

import numpy as np

from poise.locomotion._stepping._by_velocity._com_motion import ComMotion
from poise.locomotion._stepping._by_velocity._velocity_numbers import VelocityNumbers
from poise.locomotion._stepping._feet import DeviceEvents
from poise.locomotion._stepping._operator import OperatorSample
from poise.locomotion._stepping._stance import Footing, TeleopParameters
from poise.locomotion._walking import LIFT, Mode, ModeEvent, StepEnd, StepMachine


class PaperEvents:
    """Keep the mode by devices and loads.

    Attributes:
        ended: end of the last step; None while one goes on, and before the first.
    """

    def __init__(self, parameters: TeleopParameters, numbers: VelocityNumbers) -> None:
        self._dt, self._numbers, self._machine = parameters.dt, numbers, StepMachine()
        self._devices, self._shifted = DeviceEvents(parameters), 0.0
        self.ended: StepEnd | None = None

    @property
    def mode(self) -> Mode:
        """Feet that carry the robot."""
        return self._machine.mode

    @property
    def foot_has_left(self) -> bool:
        """True once the swing foot has left the ground."""
        return self._devices.foot_has_left

    def advance(
        self,
        command: OperatorSample | None,
        held: tuple[bool, bool],
        footing: Footing,
        com: ComMotion,
        time: float,
        *,
        rescuing: bool,
    ) -> bool:
        """Move the mode on if something happened; return whether it did."""
        devices, machine, mode = self._devices, self._machine, self.mode
        devices.update(command, held, footing)
        if mode.support is None:
            lifted = devices.lifted()
            event = None if lifted is None else LIFT[lifted]
            if event is not None:
                self.ended = None
        elif mode.single:
            swing = 1 - mode.support
            load = float(footing.sensor.loads[swing]) / footing.biped.weight
            event = self._ended(
                devices.end_of_swing(swing, load, rescuing=rescuing), ModeEvent.LANDED
            )
        else:
            ended = devices.end_of_shift(1 - mode.support, time - machine.since)
            event = self._ended(ended, ModeEvent.CANCEL) or self._shift(footing, com)
        return event is not None and machine.advance(event, time)

    def begin(self) -> None:
        """Start the detectors of a mode that has just begun; the feet's places are known."""
        self._shifted = 0.0
        if self.mode is Mode.D:
            self._devices.stand()
        elif self.mode.support is not None:
            self._devices.take_off(1 - self.mode.support)

    def _ended(self, ended: StepEnd | None, event: ModeEvent) -> ModeEvent | None:
        if ended is None:
            return None
        self.ended = ended
        return event

    def _shift(self, footing: Footing, com: ComMotion) -> ModeEvent | None:
        """The weight is on the foot that shall carry, for long enough."""
        self._shifted = self._shifted + self._dt if self._has_shifted(footing, com) else 0.0
        return ModeEvent.SHIFTED if self._shifted > self._numbers.shift_time else None

    def _has_shifted(self, footing: Footing, motion: ComMotion) -> bool:
        """Eq. (14e), and the CoM too: while it brakes, the ZMP is there and the CoM is not."""
        p, com, place = self._numbers, footing.dynamics.com[:2], footing.zmp_reference
        if np.linalg.norm(footing.sensor.zmp - place) > p.r_lift:
            return False
        if np.linalg.norm(motion.cart_table_zmp(com) - place) > p.ct_zmp_max:
            return False
        # As commanded, and as it is: the robot lags behind a command that has just turned.
        return all(
            np.linalg.norm(com + velocity / motion.omega - place) < p.capture_max
            for velocity in (motion.velocity, motion.observed)
        )
