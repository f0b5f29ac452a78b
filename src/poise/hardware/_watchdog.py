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

    RUN = 0  # send the command
    HOLD = 1  # freeze the leader's targets; the controller goes on balancing
    DAMP = 2  # send the last check's damping, from here on
    STOP = 3  # send nothing any more


class Trouble(Enum):
    """Kinds of trouble; each is a number that grows with it."""

    LATE_STATE = "late state"  # age of the newest one [periods of the link]
    GAP = "gap between states"  # of their stamps; infinite for one that goes back [periods]
    BAD_STATE = "bad state"  # numbers that are not finite, temperatures and torques aside
    FALL = "fall"  # tilt of the base; infinite where the controller reports a fall [rad]
    JOINT_STOP = "joint near its stop"  # worst distance beyond its limit, negative within [rad]
    HEAT = "over-temperature"  # of the hottest motor [deg C]
    LATE_TICK = "late controller"  # successive ticks that began more than a period late
    NO_ANSWER = "no answer of the solver"  # time since the last solved command [s]
    REFUSED = "refused command"  # by the last check, since the last tick
    OPERATOR = "operator gone"  # age of the operator's newest sample [s]
    STOP_BUTTON = "emergency stop"  # number of calls of `Watchdog.stop`
    INTERRUPT = "Ctrl-C"  # number of SIGINT
    KILL = "kill"  # number of SIGTERM; SIGKILL is for the process of a `ProcessLink`
    LINK = "link lost"  # one where nothing reaches the robot


@dataclass(frozen=True)
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
    Rule(Trouble.LATE_STATE, 5.0, Action.DAMP),  # 10 ms: half of those to damp within
    # Two lost states, over which an estimator integrates; the half is for rounded stamps.
    Rule(Trouble.GAP, 3.5, Action.HOLD),
    Rule(Trouble.BAD_STATE, 0, Action.DAMP),
    Rule(Trouble.FALL, 1.0, Action.DAMP),  # the CoM is beyond any foot it could still put down
    Rule(Trouble.JOINT_STOP, -0.005, Action.HOLD),  # half of the default margin of `JointLimit`
    Rule(Trouble.HEAT, 80.0, Action.DAMP),  # neodymium magnets of grade N lose magnetisation
    Rule(Trouble.LATE_TICK, 1, Action.DAMP),  # twice in succession
    Rule(Trouble.NO_ANSWER, 0.05, Action.DAMP),  # half of a fallback's time constant
    Rule(Trouble.REFUSED, 0, Action.DAMP),
    Rule(Trouble.OPERATOR, 0.5, Action.HOLD),  # for which step teleoperation holds a sample
    Rule(Trouble.STOP_BUTTON, 0, Action.DAMP),
    Rule(Trouble.INTERRUPT, 0, Action.DAMP),
    Rule(Trouble.KILL, 0, Action.DAMP),
    Rule(Trouble.LINK, 0, Action.STOP),
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
        tilt = math.acos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))  # NaN is a trouble
        measured = {
            Trouble.LATE_STATE: (now - state.arrived) * link.info.rate,
            Trouble.GAP: self._gap(state.time) * link.info.rate,
            Trouble.BAD_STATE: float(sum(np.count_nonzero(~np.isfinite(n)) for n in numbers)),
            Trouble.FALL: math.inf if status is CommandStatus.FALLEN else tilt,
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
