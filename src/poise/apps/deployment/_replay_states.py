"""`replay_states`: states of a log of a robot, fed to a controller."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise._show import new_figure
from poise.apps.deployment._deploy import stage_deployment
from poise.apps.scenarios import Scenario
from poise.errors import PoiseError
from poise.hardware import (
    COMMAND_FIELDS,
    STATE_FIELDS,
    Gains,
    LastCheck,
    LinkInfo,
    LinkStatus,
    MotorCommand,
    MotorState,
    TorqueSplit,
    Watchdog,
)
from poise.robots import Robot
from poise.sim import RunRecord, read_log, rollout

_STORED = tuple(name for name in STATE_FIELDS if name != "wrenches")
_UNKNOWN: dict[str, Any] = {"wrenches": np.zeros((0, 6))}


class ReplayLink:
    """Link that reads the states of a log in their order, and keeps the commands.

    Its clock goes on by a quarter of a period with each look.

    Args:
        record: of a robot behind a link: what was received and sent in each tick.
        joints: names of the joints.
        rate: of the link [1/s].

    Attributes:
        count: number of states.
        began: stamp of the first state [s].
        at: number of the newest state that has been read.
        written: commands, by the stamp of their state.

    Raises:
        PoiseError: the record is of no robot behind a link, or of another one.
    """

    status, refused, reason = LinkStatus.OK, 0, ""

    def __init__(self, record: RunRecord, joints: tuple[str, ...], *, rate: float = 500.0) -> None:
        if "received/q" not in record:
            wanted = "the log of `poise deploy`"
            raise PoiseError("the log has no states of a robot behind a link", wanted=wanted)
        if record.shape("received/q") != (len(joints),):
            got = f"{record.shape('received/q')[0]} joints"
            raise PoiseError("the log is of another robot", got=got, wanted=f"{len(joints)}")
        self.info = LinkInfo(name="replay of a log", rate=rate, joints=joints)
        # A state that was answered twice is read once.
        _, once = np.unique(record["received/time"], return_index=True)
        known = {name: record[f"received/{name}"][once] for name in _STORED}
        times: dict[str, Any] = {n: known.pop(n).tolist() for n in ("time", "arrived")}
        columns = known | times
        self._states = [
            MotorState(**{name: column[k] for name, column in columns.items()}, **_UNKNOWN)
            for k in range(len(once))
        ]
        self.count, self.at, self.began = len(once), 0, float(self._states[0].time)
        self._now, self._look = self._states[0].arrived, 0.25 / rate
        self.written: dict[float, MotorCommand] = {}

    def clock(self) -> float:
        """Return the time of the log [s]."""
        self._now += self._look
        return self._now

    def read(self) -> MotorState:
        """Return the next state if it has arrived."""
        if self.at + 1 < self.count and self._states[self.at + 1].arrived <= self._now:
            self.at += 1
        return self._states[self.at]

    def write(self, command: MotorCommand) -> None:
        """Keep a command.

        Args:
            command: for the newest state.
        """
        self.written[float(self._states[self.at].time)] = command

    def close(self) -> None:
        """Do nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StateReplay:
    """Torques that a controller would have commanded, beside those that were sent."""

    joints: tuple[str, ...]
    time: Float64[np.ndarray, " T"]  # of the log [s]
    sent: Float64[np.ndarray, "T nj"]  # torques of ideal drives at the measured state [N m]
    now: Float64[np.ndarray, "T nj"]  # those of the replay [N m]
    tau_max: Float64[np.ndarray, " nj"]  # [N m]

    @property
    def difference(self) -> Float64[np.ndarray, "T nj"]:
        """Difference by the joint's torque limit."""
        return np.abs(self.now - self.sent) / self.tau_max

    @property
    def worst(self) -> tuple[float, str, float]:
        """Time [s] and joint of the largest difference, and that by the joint's limit."""
        apart = self.difference
        row, joint = divmod(int(np.argmax(apart)), len(self.joints))
        return float(self.time[row]), self.joints[joint], float(apart[row, joint])

    def plot(self) -> Any:
        """Return a figure of the five joints that differ most: what was sent, and what would be."""
        worst = np.argsort(self.difference.max(axis=0))[::-1][:5]
        figure = new_figure(8.0, 8.0)
        axes = figure.subplots(len(worst), 1, sharex=True, squeeze=False)[:, 0]
        for ax, joint in zip(axes, worst.tolist(), strict=True):
            ax.plot(self.time, self.sent[:, joint], label="sent", linewidth=1.0)
            ax.plot(self.time, self.now[:, joint], label="replayed", linewidth=1.0)
            ax.set_ylabel(f"{self.joints[joint]} [N m]", fontsize=7)
        axes[0].legend(fontsize=7)
        axes[-1].set_xlabel("time [s]")
        return figure


def replay_states(
    path: str | Path,
    scenario: Scenario,
    robot: Robot,
    check: LastCheck,
    split: TorqueSplit | None = None,
    *,
    kp: Gains | None = None,
    kd: Gains | None = None,
    progress: Callable[[float, float], None] = lambda *_: None,
) -> StateReplay:
    """Feed the states of a log to a scenario's estimator, leader and controller.

    Args:
        path: log of a deployment.
        scenario: with the controller to try.
        robot: the robot.
        check: the last check, for bounds.
        split: from torques to set-points of the drives.
        kp: stiffness of position control in the ramp-in [N m/rad].
        kd: its damping [N m s/rad].
        progress: called with the ticks done and those in all.

    Raises:
        PoiseError: the log is of no deployment, or of another robot.
    """
    record = read_log(path)
    link = ReplayLink(record, robot.joint_names)
    stage = stage_deployment(scenario, robot, link, check, split, kp=kp, kd=kd, posture=False)
    body = stage.plant.body
    body.watchdog = Watchdog(robot, rules=())
    sent: dict[float, MotorCommand] = {}
    columns = [record[f"sent/{name}"] for name in COMMAND_FIELDS]
    stamps = dict(zip(record.times("received/time"), record["received/time"], strict=True))
    for k, time in enumerate(record.times("sent/tau")):
        fields = {name: column[k] for name, column in zip(COMMAND_FIELDS, columns, strict=True)}
        sent[float(stamps[time])] = MotorCommand(**fields)
    states: dict[float, MotorState] = {}
    for _ in rollout(stage.plant, stage.controller, stage.leader, estimator=stage.estimator):
        states[float(body.measured.time)] = body.measured
        progress(link.at, link.count)
        if link.at + 1 == link.count:
            break
    both = [time for time in sent if time in link.written and time in states]

    def torques(commands: dict[float, MotorCommand]) -> Float64[np.ndarray, "T nj"]:
        found = [commands[t].torque(states[t].q, states[t].dq) for t in both]
        return np.array(found).reshape(-1, robot.nj)

    return StateReplay(
        joints=robot.joint_names,
        time=np.array(both) - link.began,
        sent=torques(sent),
        now=torques(link.written),
        tau_max=np.array(robot.tau_max),
    )
