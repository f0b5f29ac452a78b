"""`LastCheck`: refusal of commands that must not reach the drives."""

from typing import Protocol, runtime_checkable

import numpy as np

from poise._checks import checked_number
from poise.errors import ConfigurationError
from poise.hardware._link import COMMAND_FIELDS, Gains, Joints, MotorCommand, MotorState, per_joint

DAMPING_RATIO = 0.3
"""Damping torque at a joint's velocity limit, by its torque limit, as of the controllers' fallback:
a fall has no joint reach its torque limit below three times its velocity limit."""

_ROWS = *COMMAND_FIELDS, "change of torque"


@runtime_checkable
class RobotLimits(Protocol):
    """Limits of joints, as `Robot` has them; a process that imports no robot has them, too."""

    @property
    def joint_names(self) -> tuple[str, ...]: ...
    @property
    def q_min(self) -> Joints: ...
    @property
    def q_max(self) -> Joints: ...
    @property
    def v_max(self) -> Joints: ...
    @property
    def tau_max(self) -> Joints: ...


class LastCheck:
    """Last check of commands before the drives: finite, within limits, bounded change.

    A command passes if it is finite and, for each joint,

        q_min + margin <= q <= q_max - margin  where kp > 0
        |dq| <= v_max  where kd > 0
        |tau| <= scale tau_max,    0 <= kp <= kp_max,    0 <= kd <= kd_max
        |u(command) - u(last)| <= step tau_max

    with u = tau + kp (q - q_measured) + kd (dq - dq_measured) at the newest state, so that a jump
    of any field counts by its torque. The command in the place of a refused one is damping, which
    is then the last; so is the command before the first.

    Args:
        limits: a `Robot`, or its limits.
        kp_max: largest stiffness that the drives may have [N m/rad].
        kd_max: largest damping that they may have [N m s/rad].
        margin: distance of position targets from the limits [rad].
        scale: fraction of the torque limits that may be used.
        step: largest change of a torque in a tick, by its limit: that of the rate limiter of
            `poise.default_stack` within 3.5 periods of 500 Hz, the longest gap between states.
        damping: of the damping command; by default `DAMPING_RATIO` of the torque limit at the
            velocity limit [N m s/rad].

    Attributes:
        joints: names of the joints.
        lower, upper: bounds of position targets [rad].
        v_max: bounds of velocity targets [rad/s].
        tau_max: bounds of torques [N m].
        kp_max: largest stiffness [N m/rad].
        kd_max: largest damping [N m s/rad].
        damping: the damping command.
        refused: number of refused commands.
        reason: fault of the last refused command; "" before the first.

    Raises:
        ConfigurationError: a setting is out of range, or the damping above `kd_max`.
        UnknownNameError: gains of a joint that does not exist.
    """

    def __init__(
        self,
        limits: RobotLimits,
        *,
        kp_max: Gains,
        kd_max: Gains,
        margin: float = 0.0,
        scale: float = 1.0,
        step: float = 1.75,
        damping: Gains | None = None,
    ) -> None:
        self.joints = joints = tuple(limits.joint_names)
        margin = checked_number(margin, "margin of the last check [rad]")
        self.lower, self.upper = limits.q_min + margin, limits.q_max - margin
        if not np.all(self.lower < self.upper):
            narrow = joints[int(np.argmin(self.upper - self.lower))]
            wanted = f"less than half the range of {narrow}"
            raise ConfigurationError("margin of the last check [rad]", got=margin, wanted=wanted)
        scale = checked_number(scale, "scale of the last check", above=0.0)
        if scale > 1.0:
            raise ConfigurationError("scale of the last check", got=scale, wanted="in (0, 1]")
        step = checked_number(step, "step of the last check", above=0.0)
        self.v_max, self.tau_max = np.array(limits.v_max), scale * limits.tau_max
        change = step * limits.tau_max
        self.kp_max = per_joint(kp_max, joints, "kp_max [N m/rad]")
        self.kd_max = per_joint(kd_max, joints, "kd_max [N m s/rad]")
        kd = DAMPING_RATIO * limits.tau_max / limits.v_max if damping is None else damping
        kd = per_joint(kd, joints, "damping [N m s/rad]")
        if np.any(kd > self.kd_max):
            high = int(np.argmax(kd - self.kd_max))
            message, wanted = f"damping of {joints[high]}", f"at most kd_max, {self.kd_max[high]:g}"
            raise ConfigurationError(message, got=float(kd[high]), wanted=wanted)
        most = self.upper, self.v_max, self.kp_max, self.kd_max, self.tau_max, change
        none = np.zeros(len(joints))
        least = self.lower, -self.v_max, none, none, -self.tau_max, -change
        for numbers in (self.lower, *most[:5], kd):
            numbers.flags.writeable = False
        self._bounds = np.array([least, most])  # by row of `_ROWS`
        self.damping = self._last = MotorCommand.damping(kd)
        self.refused, self.reason = 0, ""

    def check(self, command: MotorCommand, state: MotorState) -> MotorCommand:
        """Return the command, or damping in its place.

        Args:
            command: to be sent.
            state: the newest one.
        """
        fault = self._fault(command, state)
        if not fault:
            return command
        self.refused, self.reason = self.refused + 1, fault
        self.reset()
        return self.damping

    def reset(self) -> None:
        """Note that damping has gone out: the next command may differ from it by one step."""
        self._last = self.damping

    def _fault(self, command: MotorCommand, state: MotorState) -> str:
        count = len(self.joints)
        try:
            # A copy, which is the last command of the next tick.
            rows = np.array([getattr(command, name) for name in COMMAND_FIELDS], dtype=np.float64)
            measured = np.array([state.q, state.dq], dtype=np.float64)
        except (AttributeError, TypeError, ValueError, OverflowError):
            return f"no command, wanted numbers for {count} joints"
        if rows.shape != (len(COMMAND_FIELDS), count) or measured.shape != (2, count):
            return f"a command of shape {rows.shape[1:]}, wanted {count} joints"
        if not np.isfinite(measured).all():
            return "the measured state is not finite, wanted one that is"
        taken = MotorCommand(**dict(zip(COMMAND_FIELDS, rows, strict=True)))
        with np.errstate(invalid="ignore", over="ignore"):  # infinite or huge ones, refused below
            change = taken.torque(*measured) - self._last.torque(*measured)
        values, (least, most) = np.vstack((rows, change)), self._bounds
        good = (least <= values) & (values <= most)
        # Targets without a gain may be any number.
        good[:2] |= (rows[2:4] == 0.0) & np.isfinite(rows[:2])
        if not good.all():
            row, k = np.argwhere(~good)[0].tolist()
            wanted = f"{least[row, k]:.4g} to {most[row, k]:.4g}"
            return f"{_ROWS[row]} of {self.joints[k]} is {values[row, k]:.4g}, wanted {wanted}"
        self._last = taken
        return ""
