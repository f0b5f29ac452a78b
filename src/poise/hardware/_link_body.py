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

WARM = 0.2
"""Time for which a tick runs before its command counts [s], until memory and caches are warm."""

_POLL = 1e-4  # pause between two looks for a new state [s], a twentieth of 500 Hz


class LinkBody:
    """Robot behind a link, as the `Body` of `poise.rollout`.

    A step evaluates the watchdog, splits the torque, blends it by the ramp, writes, and waits for
    the next state, at most one and a half periods after the last.

    The first call of `state` brings a hanging robot into its posture by position control,

        hold: q = q_0 + s (q_start - q_0) with `kp`, `kd`,

    with the measured positions q_0 and a least-jerk phase s over `ramp`, and holds it there until
    `ready`: the hoist is lowered meanwhile until the robot stands. Time is that of the robot's
    stamps, zero then. For `WARM` the drives still hold, then the set-points are

        u = (1 - s) hold + s split

    field by field, with a phase over `ramp`. Position control does not balance a humanoid: the
    hoist goes once the controller stands alone, for `stand` before the leader begins. After `end`
    the set-points fade to the last check's damping over `ramp`.

    Args:
        robot: the robot.
        link: connection to it; its joints are the robot's.
        check: the last check of the link, for bounds and damping.
        split: from torques to set-points of the drives; None for torque alone.
        kp: stiffness of position control; that of the last check's `kp_max` if None [N m/rad].
        kd: its damping; `kd_max` if None [N m s/rad].
        watchdog: the table of troubles; the default one if None.
        q_start: posture of the joints; that of `robot.q_home` if None.
        posture: False for a robot that is in its posture already, and stands.
        ramp: length of each ramp; zero for a robot that stands under no control [s].
        stand: time for which the controller stands before the leader begins [s].
        ready: returns True once it stands on its feet; None for `stand` after it has its posture.
        operator: returns the time of the operator's newest sample by the link's clock [s].

    Attributes:
        robot, link, ready, operator: as given.
        begin: time at which the leader begins [s].
        q_start: posture of the joints within the last check's bounds.
        verdict: of the watchdog in the last step.
        measured: state of the present tick, as read.
        sent: set-points of the last tick; None before the first and after an end.
        late: ticks in which no new state arrived.

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
        posture: bool = True,
        ramp: float = RAMP,
        stand: float = RAMP,
        ready: Callable[[], bool] | None = None,
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
        self._still, joints = np.zeros(robot.nj), robot.joint_names
        self._kp = per_joint(check.kp_max if kp is None else kp, joints, "kp [N m/rad]")
        self._kd = per_joint(check.kd_max if kd is None else kd, joints, "kd [N m s/rad]")
        self._split = split or TorqueSplit(check, kp=self._still, kd=self._still, period=dt)
        self.watchdog = watchdog or Watchdog(robot, period=dt)
        home = robot.q_home[-robot.nj :] if q_start is None else q_start
        self._bounds = check.lower, check.upper
        self.q_start = np.clip(home, *self._bounds)
        self._posture = posture and ramp > 0.0
        self._ramp = checked_number(ramp, "ramp of the link's body [s]")
        self._stand = checked_number(stand, "stand of the link's body [s]")
        self._warm = WARM if ramp > 0.0 else 0.0
        self.begin = self._warm + self._ramp + self._stand
        self._end, self.ready, self.operator = math.inf, ready, operator
        self.verdict = Verdict(response=Action.RUN)
        self.sent: MotorCommand | None = None
        self.measured = self._answered = link.read()
        self._zero, self._age, self.late = math.nan, 0.0, 0

    @property
    def time(self) -> float:
        """Stamp of the present state, zero where the robot stands [s]."""
        return 0.0 if math.isnan(self._zero) else self.measured.time - self._zero

    @property
    def fallen(self) -> bool:
        """True once the watchdog damps or stops, and after the ramp-out."""
        return self.verdict.response >= Action.DAMP or self.time >= self._end + self._ramp

    @property
    def held(self) -> bool:
        """True before the leader begins, and on HOLD."""
        return self.time < self.begin or self.verdict.response is Action.HOLD

    def state(self) -> RobotState:
        """Return the measured state, as `robot_state`; the first call begins the run."""
        if math.isnan(self._zero):
            self.measured, self._began = self.link.read(), self.link.clock()
            if self._posture:
                self._take_posture()
            self._zero = self.measured.time
        return replace(robot_state(self.robot, self.link.info, self.measured), time=self.time)

    def true_state(self) -> RobotState:
        """Return the measured state; the true one is not known."""
        return self.state()

    def step(self, command: Command) -> None:
        """Send a command and wait for the next state.

        Args:
            command: of the controller, for the present state.
        """
        state = self._answered = self.measured
        if self.time < self._warm and self.verdict.response < Action.DAMP:
            self._send(self._hold(self.q_start))
            return
        operator = None if self.operator is None else self.operator()
        self.verdict = self.watchdog.evaluate(self.link, state, command, operator=operator)
        self._age = self.link.clock() - state.arrived
        if self.verdict.response < Action.DAMP:
            self._send(self._ramped(self._split.split(command, state)))
            return
        if self.verdict.response is Action.DAMP:
            self.link.write(self._check.damping)
        self.sent = None
        self._wait()

    def follow(self, leader: Leader) -> "_HeldLeader":
        """Return the leader, not called before `begin`; on HOLD its `pause` is, if it has one.

        Args:
            leader: sets the targets of the controller's stack.
        """
        return _HeldLeader(leader, self)

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
        self.link.close()

    def _take_posture(self) -> None:
        """Bring the robot into its posture, and hold it until it is ready."""
        begin, q_0 = self.measured.time, np.clip(self.measured.q, *self._bounds)
        while True:
            since = self.measured.time - begin
            self.verdict = self.watchdog.evaluate(self.link, self.measured)
            if self.verdict.response >= Action.DAMP:
                self.link.write(self._check.damping)
                return
            share = least_jerk(since, 0.0, self._ramp)[0]
            self._send(self._hold(q_0 + share * (self.q_start - q_0)))
            over = since - self._ramp
            if over >= 0.0 and (over >= self._stand if self.ready is None else self.ready()):
                return

    def _hold(self, q: Joints) -> MotorCommand:
        return MotorCommand(q=q, dq=self._still, kp=self._kp, kd=self._kd, tau=self._still)

    def _send(self, command: MotorCommand) -> None:
        self.sent = command
        self.link.write(command)
        self._wait()

    def _ramped(self, split: MotorCommand) -> MotorCommand:
        time, ramp = self.time, self._ramp
        if time < self._warm + ramp:
            share = least_jerk(time, self._warm, ramp)[0]
            return _blend(self._hold(self.q_start), split, share)
        if time > self._end:
            share = least_jerk(time, self._end, ramp)[0]
            return _blend(split, replace(self._check.damping, q=split.q), share)
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
            time.sleep(max(_POLL, begin + 0.5 * period - now))
            if link.clock() == now:  # Its time passes by commands, and there was none.
                break
        self.measured = state
        self._began = now


class _HeldLeader:
    """Leader of `LinkBody.follow`."""

    def __init__(self, leader: Leader, body: LinkBody) -> None:
        self.stack, self._leader, self._body = leader.stack, leader, body
        self._pause = getattr(leader, "pause", lambda _: None)
        self._signals = getattr(leader, "signals", dict)

    def lead(self, state: RobotState) -> None:
        body = self._body
        if body.time >= body.begin:
            (self._pause if body.held else self._leader.lead)(state)

    def signals(self) -> Mapping[str, Any]:
        """Return the leader's signals, for a recorder; none before it begins."""
        return self._signals() if self._body.time >= self._body.begin else {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._leader, name)


def _blend(first: MotorCommand, second: MotorCommand, share: float) -> MotorCommand:
    pairs = ((n, getattr(first, n), getattr(second, n)) for n in COMMAND_FIELDS)
    return MotorCommand(**{n: (1.0 - share) * a + share * b for n, a, b in pairs})
