"""`TorqueSplit`: set-points of the drives' own loops from a controller's command."""

import math

import numpy as np

from poise._checks import all_finite, checked_number
from poise.control import Command
from poise.errors import ConfigurationError
from poise.hardware._last_check import LastCheck
from poise.hardware._link import Gains, Joints, MotorCommand, MotorState, per_joint

LEAKAGE = 50.0
"""Leakage rate of the targets towards the measured state [1/s]: its time constant of 20 ms is above
the delay of state and command, some ticks of 2 ms, and a fifth of that of the fastest task of
`poise.default_stack`, 1 / sqrt(kp) = 100 ms, so the drives add no stiffness to slower motions."""


class TorqueSplit:
    """Feed-forward torque with low gains in the drives' own loops.

    `tau` is the controller's. The targets integrate its joint accelerations a, leaking towards the
    measured state with rate r:

        d/dt dq = a + r (dq_measured - dq),    d/dt q = dq + r (q_measured - q)

    The terms of the leakage are exact over a tick. Targets stay within the bounds of the last
    check. A command without an acceleration, as a fallback, starts them anew at the measured
    positions with zero velocity.

    Args:
        check: the last check, for bounds and names.
        kp: stiffness of the joints; zero for pure torque [N m/rad].
        kd: damping of the joints [N m s/rad].
        period: from one command to the next [s].
        leakage: r [1/s].

    Attributes:
        kp: stiffness in use [N m/rad].
        kd: damping in use [N m s/rad].

    Raises:
        ConfigurationError: gains above those of the last check, or a setting out of range.
        UnknownNameError: gains of a joint that does not exist.
    """

    def __init__(
        self,
        check: LastCheck,
        *,
        kp: Gains,
        kd: Gains,
        period: float = 0.002,
        leakage: float = LEAKAGE,
    ) -> None:
        self._check = check
        self.kp = per_joint(kp, check.joints, "kp of the torque split [N m/rad]")
        self.kd = per_joint(kd, check.joints, "kd of the torque split [N m s/rad]")
        for name, gains, most in (("kp", self.kp, check.kp_max), ("kd", self.kd, check.kd_max)):
            if np.any(gains > most):
                worst = int(np.argmax(gains - most))
                message = f"{name} of {check.joints[worst]} is above that of the last check"
                wanted = f"at most {most[worst]:g}"
                raise ConfigurationError(message, got=float(gains[worst]), wanted=wanted)
            gains.flags.writeable = False
        self._period = checked_number(period, "period of the torque split [s]", above=0.0)
        leakage = checked_number(leakage, "leakage of the torque split [1/s]")
        self._leak = 1.0 - math.exp(-leakage * self._period)
        self._last: tuple[Joints, Joints] | None = None

    def split(self, command: Command, state: MotorState) -> MotorCommand:
        """Return the command of the drives; one call a tick.

        Args:
            command: of a controller that commands torques.
            state: that the command answers.
        """
        count = len(self._check.joints)
        q, dq = (np.clip(state.q, self._check.lower, self._check.upper), np.zeros(count))
        if command.acceleration is not None:
            speed = np.clip(state.dq, -self._check.v_max, self._check.v_max)
            q, dq = self._integrated(q, speed, command.acceleration[-count:])
        # Targets that are not finite are refused by the last check, and forgotten here.
        known = command.acceleration is not None and all_finite(q) and all_finite(dq)
        self._last = (q, dq) if known else None
        tau = np.full(count, np.nan) if command.torque is None else command.torque
        return MotorCommand(q=q, dq=dq, kp=self.kp, kd=self.kd, tau=tau)

    def _integrated(self, q: Joints, dq: Joints, acceleration: Joints) -> tuple[Joints, Joints]:
        check, (q_last, dq_last) = self._check, self._last or (q, dq)
        dq_next = dq_last + self._period * acceleration + self._leak * (dq - dq_last)
        q_next = q_last + self._period * dq_next + self._leak * (q - q_last)
        dq_next = np.clip(dq_next, -check.v_max, check.v_max)
        return np.clip(q_next, check.lower, check.upper), dq_next
