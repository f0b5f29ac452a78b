"""`LinkBody`: a robot behind a link as the body of a rollout."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from poise._checks import checked_number
from poise.control import Command
from poise.dynamics import RobotState, least_jerk
from poise.errors import ConfigurationError
from poise.hardware._last_check import LastCheck
from poise.hardware._link import (
    COMMAND_FIELDS,
    STATE_FIELDS,
    Gains,
    Joints,
    Link,
    MotorCommand,
    MotorState,
    per_joint,
)
from poise.hardware._plant_link import robot_state
from poise.hardware._torque_split import TorqueSplit
from poise.hardware._watchdog import Action, Verdict, Watchdog
from poise.robots import Robot
from poise.stack import Leader

RAMP = 3.0
"""Length of each ramp, and of standing before the leader begins [s]: a joint that is 1 rad off then
moves by at most 15 / 8 / 3 s = 0.6 rad/s, which a person with a hand on the stop can follow."""

LISTEN = 0.5
"""Time for which all of a tick runs before the first command [s]: its memory is warm then."""

_POLL = 1e-4
"""Pause between two looks for a new state [s], a twentieth of a period of 500 Hz."""


class LinkBody:
    """Robot behind a link, as the `Body` of `poise.rollout`.

    At first it only listens, for `listen`. A step then evaluates the watchdog, splits the command's torque, blends it by the ramp, writes, and
    waits for the next state, at most one and a half periods after the last. Time is that of the
    robot's stamps, zero at the first state.

    In the ramp-in the set-points of the drives are a blend of position control and controller,

        u = (1 - s) hold + s split,    hold: q = q_0 + s (q_start - q_0) with `kp`, `kd`

    field by field, with the measured positions q_0 at the first step and the least-jerk phase s.
    The first torques are zero. Position control at the ankles does not balance a humanoid: a hoist
    holds it meanwhile, and is lowered while the controller stands for `stand`. After `end` the
    set-points fade to the last check's damping in the same way.

    Args:
        robot: the robot.
        link: connection to it; its joints are the robot's.
        split: from torques to set-points of the drives; None for torque alone.
        check: the last check of the link, for bounds and damping.
        kp: stiffness of position control; that of the last check's `kp_max` if None [N m/rad].
        kd: its damping; `kd_max` if None [N m s/rad].
        watchdog: the table of troubles; the default one if None.
        q_start: posture of the joints at the end of the ramp-in; that of `robot.q_home` if None.
        listen: time for which nothing is sent; zero for a link whose time passes by commands [s].
        ramp: length of both ramps, zero for none [s].
        stand: time for which the controller stands before the leader begins [s].
        operator: returns the time of the operator's newest sample by the link's clock [s]; None
            without an operator.

    Attributes:
        robot: the robot.
        link: connection to it.
        begin: time at which the leader begins [s].
        verdict: of the watchdog in the last step.
        measured: state of the present tick, as read.
        sent: set-points of the last tick; None before the first and after an end.
        late: ticks in which no new state arrived.
        operator: time of the operator's newest sample, as given.

    Raises:
        ConfigurationError: the link has other joints than the robot, or a setting is out of range.
    """

    def __init__(
        self,
        robot: Robot,
        link: Link,
        check: LastCheck,
        split: TorqueSplit | None = None,
        *,
        kp: Gains | None = None,
        kd: Gains | None = None,
        watchdog: Watchdog | None = None,
        q_start: Joints | None = None,
        listen: float = LISTEN,
        ramp: float = RAMP,
        stand: float = RAMP,
        operator: Callable[[], float | None] | None = None,
    ) -> None:
        if link.info.joints != robot.joint_names or check.joints != robot.joint_names:
            raise ConfigurationError(
                "the link or its last check has other joints than the robot",
                got=(link.info.joints, check.joints),
                wanted=f"those of {robot.name}: {robot.joint_names}",
            )
        self.robot, self.link, self._check = robot, link, check
        self.control_dt = dt = 1.0 / link.info.rate
        zero, joints = np.zeros(robot.nj), robot.joint_names
        self._kp = per_joint(check.kp_max if kp is None else kp, joints, "kp [N m/rad]")
        self._kd = per_joint(check.kd_max if kd is None else kd, joints, "kd [N m s/rad]")
        self._split = split or TorqueSplit(check, kp=zero, kd=zero, period=dt)
        self.watchdog = watchdog or Watchdog(robot, period=dt)
        home = robot.q_home[-robot.nj :] if q_start is None else q_start
        self._q_start = np.clip(home, check.lower, check.upper)
        self._ramp = checked_number(ramp, "ramp of the link's body [s]")
        self._end, self.operator = math.inf, operator
        self.verdict = Verdict(response=Action.RUN)
        self.sent: MotorCommand | None = None
        self._answered = link.read()
        self.late = 0
        self.measured = link.read()
        self._listen = checked_number(listen, "listen of the link's body [s]")
        self.begin = self._listen + self._ramp + checked_number(stand, "stand of the link's body [s]")
        self._zero, self._age = math.nan, 0.0

    @property
    def time(self) -> float:
        """Stamp of the present state, zero where the leader begins [s]."""
        return 0.0 if math.isnan(self._zero) else self.measured.time - self._zero

    @property
    def fallen(self) -> bool:
        """True once the watchdog damps or stops, and after the ramp-out: a rollout ends."""
        return self.verdict.response >= Action.DAMP or self.time >= self._end + self._ramp

    @property
    def held(self) -> bool:
        """True where the leader's targets are frozen: before its begin, and on HOLD."""
        return self.time < self.begin or self.verdict.response is Action.HOLD

    def state(self) -> RobotState:
        """Return the measured state, for an estimator: `robot_state`; the first begins the run."""
        if math.isnan(self._zero):
            self.measured, self._began = self.link.read(), self.link.clock()
            self._zero = self.measured.time
        state = robot_state(self.robot, self.link.info, self.measured)
        return replace(state, time=self.time)

    def true_state(self) -> RobotState:
        """Return the measured state; the true one is not known."""
        return self.state()

    def step(self, command: Command) -> None:
        """Send a command and wait for the next state.

        Args:
            command: of the controller, for the present state.
        """
        if self.time <= self._listen:
            self._q_0 = np.clip(self.measured.q, self._check.lower, self._check.upper)
        if self.time < self._listen:
            self._answered = self.measured
            self._wait()
            return
        operator = None if self.operator is None else self.operator()
        state, before = self.measured, self.verdict.response
        self._answered = state
        self.verdict = self.watchdog.evaluate(self.link, state, command, operator=operator)
        self._age = self.link.clock() - state.arrived
        response = self.verdict.response
        if response < Action.DAMP:
            self.sent = self._ramped(self._split.split(command, state))
            self.link.write(self.sent)
        else:
            if response is Action.DAMP and before is not Action.STOP:
                self.link.write(self._check.damping)
            self.sent = None
        self._wait()

    def follow(self, leader: Leader) -> "HeldLeader":
        """Return the leader, frozen while the body is `held`.

        Args:
            leader: sets the targets of the controller's stack.
        """
        return HeldLeader(leader, self)

    def signals(self) -> dict[str, np.ndarray | float | str]:
        """Return the state that the last tick received and the command that it sent.

        `received/` and `sent/` with the fields of `MotorState` and `MotorCommand`, `age` of the
        state when the command went out [s], and notes of the link and the watchdog.
        """
        received = {f"received/{name}": getattr(self._answered, name) for name in STATE_FIELDS}
        signals = {name: value for name, value in received.items() if np.size(value)}
        if self.sent is not None:
            signals |= {f"sent/{name}": getattr(self.sent, name) for name in COMMAND_FIELDS}
        reason = self.verdict.reason or self.link.reason
        return signals | {
            "age": self._age,
            "link": self.link.status.value,
            "watchdog": f"{self.verdict.response.name}: {reason}",
        }

    def end(self) -> None:
        """Begin the ramp-out; for its length the controller goes on."""
        self._end = self.time

    def close(self) -> None:
        """Damp the robot and disconnect."""
        self.sent = None
        self.link.close()

    def _ramped(self, split: MotorCommand) -> MotorCommand:
        if self.time < self._listen + self._ramp:
            share = least_jerk(self.time, self._listen, self._ramp)[0]
            q = self._q_0 + share * (self._q_start - self._q_0)
            still = np.zeros(len(q))
            hold = MotorCommand(q=q, dq=still, kp=self._kp, kd=self._kd, tau=still)
            return _blend(hold, split, share)
        if self.time > self._end:
            share = least_jerk(self.time, self._end, self._ramp)[0]
            damping = replace(self._check.damping, q=split.q)
            return _blend(split, damping, share)
        return split

    def _wait(self) -> None:
        """Wait for the next state."""
        begin, link, period = self._began, self.link, self.control_dt
        while True:
            state, now = link.read(), link.clock()
            # A robot's period is not quite that of this clock: half of one is for its jitter.
            if state.time != self.measured.time and now >= begin + 0.5 * period:
                break
            if now >= begin + 1.5 * period:
                self.late += 1
                break
            time.sleep(_POLL)
            if link.clock() == now:  # Its time passes by commands, and there was none.
                break
        self.measured: MotorState = state
        self._began = now


class HeldLeader:
    """Leader that is held with its body.

    Before the body's `begin` it is not called; on HOLD its `pause` is in place of its `lead`, or
    nothing where it has none.

    Args:
        leader: the leader.
        body: of the robot.
    """

    def __init__(self, leader: Leader, body: LinkBody) -> None:
        self.stack, self._leader, self._body = leader.stack, leader, body
        self._pause = getattr(leader, "pause", None)
        self._signals = getattr(leader, "signals", dict)

    def lead(self, state: RobotState) -> None:
        """Set the stack's targets, or leave them.

        Args:
            state: as estimated.
        """
        body = self._body
        if body.time < body.begin:
            return
        if not body.held:
            self._leader.lead(state)
        elif self._pause is not None:
            self._pause(state)

    def signals(self) -> Mapping[str, Any]:
        """Return the leader's signals, for a recorder; none before it begins."""
        return self._signals() if self._body.time >= self._body.begin else {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._leader, name)


def _blend(first: MotorCommand, second: MotorCommand, share: float) -> MotorCommand:
    """Return (1 - share) first + share second, field by field."""
    rest = 1.0 - share
    mixed = {n: rest * getattr(first, n) + share * getattr(second, n) for n in COMMAND_FIELDS}
    return MotorCommand(**mixed)
