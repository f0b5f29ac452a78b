"""`serve`: the process of a `ProcessLink`."""

import gc
import math
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from copy import copy
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from poise.hardware._last_check import LastCheck
from poise.hardware._link import COMMAND_FIELDS, STATE_FIELDS, Link, LinkStatus, MotorCommand
from poise.hardware._mailbox import Mailbox

FRESH = 0.01
"""Age of a command from which the link damps, or two of its periods where that is more [s]: half of
the 20 ms within which a robot has to be damped, and five ticks of 500 Hz."""

LOOKS = 4  # for states and commands in a period: each waits for a quarter of it at most
STATUSES = tuple(LinkStatus)
_MEASURED = tuple(name for name in STATE_FIELDS if name != "arrived")
_REASON = 200  # bytes: the longest reason has a joint's name and two numbers


def state_kind(joints: int, soles: int) -> np.dtype[np.void]:
    """Return the record of a state."""
    sizes: dict[str, tuple[int, ...]] = dict.fromkeys(STATE_FIELDS, (joints,))
    sizes |= {"time": (), "arrived": (), "wrenches": (soles, 6)}
    sizes |= {"quaternion": (4,), "gyro": (3,), "acceleration": (3,)}
    numbers = [(name, np.float64, size) for name, size in sizes.items()]
    notes = [("status", np.int64), ("refused", np.int64), ("reason", f"S{_REASON}")]
    return np.dtype([*numbers, *notes])


def command_kind(joints: int) -> np.dtype[np.void]:
    """Return the record of a command."""
    numbers = [(name, np.float64, (joints,)) for name in COMMAND_FIELDS]
    return np.dtype([("sent", np.float64), ("close", np.int64), *numbers])


def serve(
    make: Callable[[], Link],
    check: LastCheck,
    soles: tuple[str, ...],
    linger: float,
    priority: int | None,
    memories: list[Any],
    answer: Connection,
) -> None:
    """Make a link and serve it until its controller has gone."""
    # A session of its own: what ends or stops the controller's terminal or group is not for it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "setsid"):
        os.setsid()
    try:
        if priority is not None:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        link = make()
        fits = (link.info.joints, link.info.soles) == (check.joints, soles)
        server = _Server(link, check, len(soles), memories) if fits else None
    except Exception as error:
        answer.send(f"{type(error).__name__}: {error}")
        return
    answer.send(link.info)
    answer.close()
    if server is None:
        link.close()
        return
    gc.collect()
    gc.freeze()
    server.run(linger)


class _Server:
    """Ticks of the link's process."""

    def __init__(self, link: Link, check: LastCheck, soles: int, memories: list[Any]) -> None:
        # A copy, because the link may have the same.
        self._link, self._check = link, copy(check)
        kinds = state_kind(len(check.joints), soles), command_kind(len(check.joints))
        self._states, self._commands = map(Mailbox, memories, kinds)
        self._record = np.zeros((), dtype=kinds[0])
        self._status, self._state, self._ending = LinkStatus.IDLE, link.read(), False
        self._fault, self._longest = "", max(FRESH, 2.0 / link.info.rate)
        self._number: int | None = None  # of the last command; nothing is sent before the first
        self._written = -math.inf
        self._record["time"], self._told = np.nan, None
        self._publish()
        signal.signal(signal.SIGTERM, lambda *_: setattr(self, "_ending", True))

    def run(self, linger: float) -> None:
        """Tick until the controller has gone, then damp for a while."""
        period, parent = 1.0 / (LOOKS * self._link.info.rate), os.getppid()
        due, end = time.monotonic(), math.inf
        try:
            while due < end:
                self._tick()
                if end == math.inf and (self._ending or os.getppid() != parent):
                    self._ending, end = True, time.monotonic() + linger
                due = max(due + period, time.monotonic())
                time.sleep(max(0.0, due - time.monotonic()))
        except Exception as error:
            self._status, self._fault = LinkStatus.LOST, f"{type(error).__name__}: {error}"
            sys.exit(1)
        finally:
            with suppress(Exception):
                if self._number is not None:
                    self._link.write(self._check.damping)
                self._link.close()
            self._publish()

    def _tick(self) -> None:
        self._state = self._link.read()
        self._publish()
        number, command = self._fresh()
        now, period = time.monotonic(), 1.0 / self._link.info.rate
        # A command goes out when it comes; without one something does after one and a half periods.
        waited = now - self._written
        idle = self._number is None and command is None
        if idle or waited < (0.5 if number != self._number else 1.5) * period:
            return
        self._number, self._written = number, now
        check, refused = self._check, self._refused
        if command is None:
            check.reset()
            self._link.write(check.damping)
        else:
            self._link.write(check.check(command, self._state))
        failed = self._refused > refused
        sent = LinkStatus.DAMPING if command is None else LinkStatus.OK
        lost = self._link.status is LinkStatus.LOST
        self._status = LinkStatus.LOST if lost else LinkStatus.REFUSED if failed else sent

    @property
    def _refused(self) -> int:
        return self._check.refused + self._link.refused

    def _fresh(self) -> tuple[int, MotorCommand | None]:
        """Return number and set-points of the controller's command; None once it is old."""
        found = self._commands.read()
        if found is None or self._ending:
            return 0, None
        number, record = found
        self._ending = bool(record["close"])
        if self._ending or time.monotonic() - float(record["sent"]) > self._longest:
            return 0, None
        return number, MotorCommand(**{name: record[name] for name in COMMAND_FIELDS})

    def _publish(self) -> None:
        state, record = self._state, self._record
        if (told := (state.time, self._status, self._refused)) == self._told:
            return
        self._told = told
        if state.time != record["time"]:
            record["arrived"] = time.monotonic()
            for name in _MEASURED:
                record[name] = getattr(state, name)
        record["status"], record["refused"] = STATUSES.index(self._status), self._refused
        reason = self._fault or self._check.reason or self._link.reason
        record["reason"] = reason.encode()[:_REASON]
        self._states.write(record[()])
