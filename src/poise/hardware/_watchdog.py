"""`Watchdog`: troubles of a run on a robot, and the response to each, as one table."""

import math
import signal
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Any

import numpy as np

from poise._checks import checked_kind, checked_number
from poise.control import Command, CommandStatus
from poise.errors import ConfigurationError
from poise.hardware._last_check import RobotLimits
from poise.hardware._link import Link, LinkStatus, MotorState


class Action(IntEnum):
    """Action on a trouble, the strongest last."""

    RUN = 0
    """None: send the command."""
    HOLD = 1
    """Freeze the leader's targets; the controller goes on balancing."""
    DAMP = 2
    """Send the last check's damping, from here on."""
    STOP = 3
    """Send nothing any more."""


class Trouble(Enum):
    """Kinds of trouble; each is a number that grows with it."""

    LATE_STATE = "late state"
    """Age of the newest state [periods of the link]."""
    GAP = "gap between states"
    """Between the stamps of two states; infinite for one that goes back [periods of the link]."""
    BAD_STATE = "bad state"
    """Numbers of the state that are not finite, temperatures and torques aside."""
    FALL = "fall"
    """Tilt of the base; infinite where the controller reports a fall [rad]."""
    JOINT_STOP = "joint near its stop"
    """Distance of the worst joint beyond its position limit, negative within [rad]."""
    HEAT = "over-temperature"
    """Temperature of the hottest motor [deg C]."""
    LATE_TICK = "late controller"
    """Ticks one after another that began more than a period late."""
    NO_ANSWER = "no answer of the solver"
    """Time since the last solved command [s]."""
    REFUSED = "refused command"
    """Commands that the last check refused since the last tick."""
    OPERATOR = "operator gone"
    """Age of the operator's newest sample [s]."""
    STOP_BUTTON = "emergency stop"
    """Number of calls of `Watchdog.stop`."""
    INTERRUPT = "Ctrl-C"
    """Number of SIGINT."""
    KILL = "kill"
    """Number of SIGTERM; SIGKILL is for the process of a `ProcessLink`."""
    LINK = "link lost"
    """One where nothing reaches the robot."""


@dataclass(frozen=True, kw_only=True)
class Rule:
    """One row of the table: the response to a trouble that exceeds a limit.

    Attributes:
        trouble: its kind.
        limit: largest number that is none, in the trouble's unit.
        response: to a larger one, and to NaN.
    """

    trouble: Trouble
    limit: float
    response: Action

    def __post_init__(self) -> None:
        checked_kind(self.trouble, Trouble, "trouble of a rule")
        checked_kind(self.response, Action, "response of a rule")
        if math.isnan(self.limit):
            raise ConfigurationError("limit of a rule", got=self.limit, wanted="a number")


RULES = (
    # 10 ms at 500 Hz, half of the 20 ms within which a robot has to be damped.
    Rule(trouble=Trouble.LATE_STATE, limit=5.0, response=Action.DAMP),
    # Two lost states; an estimator integrates over them. The half is for the rounding of stamps.
    Rule(trouble=Trouble.GAP, limit=3.5, response=Action.HOLD),
    Rule(trouble=Trouble.BAD_STATE, limit=0, response=Action.DAMP),
    # A humanoid tilted by 1 rad has its CoM beyond any foot it could still put down.
    Rule(trouble=Trouble.FALL, limit=1.0, response=Action.DAMP),
    # Half of the default margin of `JointLimit`, which controllers keep.
    Rule(trouble=Trouble.JOINT_STOP, limit=-0.005, response=Action.HOLD),
    # Neodymium magnets of grade N lose magnetisation above 80 deg C.
    Rule(trouble=Trouble.HEAT, limit=80.0, response=Action.DAMP),
    # Twice in succession.
    Rule(trouble=Trouble.LATE_TICK, limit=1, response=Action.DAMP),
    # Half of the time constant with which a controller's fallback decays.
    Rule(trouble=Trouble.NO_ANSWER, limit=0.05, response=Action.DAMP),
    Rule(trouble=Trouble.REFUSED, limit=0, response=Action.DAMP),
    # Time for which step teleoperation holds the last sample.
    Rule(trouble=Trouble.OPERATOR, limit=0.5, response=Action.HOLD),
    Rule(trouble=Trouble.STOP_BUTTON, limit=0, response=Action.DAMP),
    Rule(trouble=Trouble.INTERRUPT, limit=0, response=Action.DAMP),
    Rule(trouble=Trouble.KILL, limit=0, response=Action.DAMP),
    Rule(trouble=Trouble.LINK, limit=0, response=Action.STOP),
)
"""The default table."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Response of a tick.

    Attributes:
        response: the strongest of all rules that apply.
        trouble: its trouble; None without one.
        reason: the trouble with its number and limit; "" without one.
    """

    response: Action
    trouble: Trouble | None = None
    reason: str = ""


class Watchdog:
    """Table of troubles and responses, evaluated each tick.

    HOLD ends with its trouble; DAMP and STOP stay until `reset`. A limit changes by another table:

        rules = [*(r for r in RULES if r.trouble is not Trouble.HEAT), Rule(...)]

    Args:
        limits: a `Robot`, or its limits.
        period: of the control loop [s].
        rules: the table; a trouble may stand in it several times, as with a warmer limit for a
            stronger response.

    Raises:
        ConfigurationError: the period is not positive, or a rule is none.
    """

    def __init__(
        self, limits: RobotLimits, *, period: float = 0.002, rules: Sequence[Rule] = RULES
    ) -> None:
        self._q_min, self._q_max = limits.q_min, limits.q_max
        self._period = checked_number(period, "period of the watchdog [s]", above=0.0)
        self.rules = tuple(checked_kind(rule, Rule, "rule of the watchdog") for rule in rules)
        self._signals = {signal.SIGINT: 0, signal.SIGTERM: 0}
        self.reset()

    def reset(self) -> None:
        """Forget all troubles; signals, too."""
        self._verdict = Verdict(response=Action.RUN)
        self._stamp = self._tick = self._answer = math.nan
        self._late, self._refused, self._stops = 0, -1, 0
        self._signals = dict.fromkeys(self._signals, 0)

    def stop(self) -> None:
        """Count an emergency stop; from any thread."""
        self._stops += 1

    @contextmanager
    def signals(self) -> Generator[None]:
        """Count SIGINT and SIGTERM for the table while the context lasts; main thread only."""
        before = {kind: signal.signal(kind, self._count) for kind in self._signals}
        try:
            yield
        finally:
            for kind, handler in before.items():
                signal.signal(kind, handler)

    def evaluate(
        self,
        link: Link,
        state: MotorState,
        command: Command | None = None,
        *,
        operator: float | None = None,
    ) -> Verdict:
        """Return the response of this tick; one call a tick.

        Args:
            link: of the robot.
            state: as read in this tick.
            command: of the controller in this tick; None without one.
            operator: time of the operator's newest sample by the link's clock; None without an
                operator [s].
        """
        measured = self._measure(link, state, command, operator)
        found = Verdict(response=Action.RUN)
        for rule in self.rules:
            value = measured[rule.trouble]
            if not value <= rule.limit and rule.response > found.response:
                reason = f"{rule.trouble.value}: {value:.4g}, limit {rule.limit:g}"
                found = Verdict(response=rule.response, trouble=rule.trouble, reason=reason)
        if self._verdict.response < Action.DAMP or found.response > self._verdict.response:
            self._verdict = found
        return self._verdict

    def _measure(
        self, link: Link, state: MotorState, command: Command | None, operator: float | None
    ) -> dict[Trouble, float]:
        now, status = link.clock(), CommandStatus.OK if command is None else command.status
        interval, refused = now - self._tick, link.refused
        self._late = self._late + 1 if interval > 2.0 * self._period else 0
        if status.ok or math.isnan(self._answer):
            self._answer = now
        beyond = np.maximum(state.q - self._q_max, self._q_min - state.q)
        numbers = (state.q, state.dq, state.quaternion, state.gyro, state.acceleration)
        x, y = state.quaternion[:2].tolist()
        upright = 1.0 - 2.0 * (x * x + y * y)  # cosine of the tilt
        measured = {
            Trouble.LATE_STATE: (now - state.arrived) * link.info.rate,
            Trouble.GAP: self._gap(state.time) * link.info.rate,
            Trouble.BAD_STATE: float(sum(np.count_nonzero(~np.isfinite(n)) for n in numbers)),
            Trouble.FALL: math.inf if status is CommandStatus.FALLEN else _angle(upright),
            Trouble.JOINT_STOP: float(beyond.max()),
            Trouble.HEAT: float(np.fmax.reduce(state.temperature, initial=-math.inf)),
            Trouble.LATE_TICK: self._late,
            Trouble.NO_ANSWER: now - self._answer,
            Trouble.REFUSED: refused - self._refused if self._refused >= 0 else 0,
            Trouble.OPERATOR: 0.0 if operator is None else now - operator,
            Trouble.STOP_BUTTON: self._stops,
            Trouble.INTERRUPT: self._signals[signal.SIGINT],
            Trouble.KILL: self._signals[signal.SIGTERM],
            Trouble.LINK: float(link.status is LinkStatus.LOST),
        }
        self._tick, self._refused = now, refused
        return measured

    def _gap(self, stamp: float) -> float:
        gap = 0.0 if math.isnan(self._stamp) else stamp - self._stamp
        self._stamp = stamp
        return gap if gap >= 0.0 else math.inf

    def _count(self, kind: int, _: Any) -> None:
        self._signals[signal.Signals(kind)] += 1


def _angle(cosine: float) -> float:
    """Return the angle; NaN, which is a trouble, for NaN."""
    return math.acos(np.clip(cosine, -1.0, 1.0))
