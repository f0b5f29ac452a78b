"""`ProcessLink`: a link in a process of its own, which damps the robot without its controller."""

import time
from collections.abc import Callable
from multiprocessing import get_context

import numpy as np

from poise._checks import checked_number
from poise.errors import ConfigurationError, RobotError
from poise.hardware._last_check import LastCheck
from poise.hardware._link import (
    COMMAND_FIELDS,
    STATE_FIELDS,
    Link,
    LinkInfo,
    LinkStatus,
    MotorCommand,
    MotorState,
)
from poise.hardware._mailbox import Mailbox, Record
from poise.hardware._server import STATUSES, command_kind, serve, state_kind

START_TIME = 60.0  # longest start and end of its process [s]; importing a simulator takes some
LINGER = 2.0
"""Damping after the end of the controller [s]: a robot that tips over from 0.05 rad lies within
ln(pi / 0.05) / omega = 1.3 s, with omega = 3.1 1/s of a CoM 1 m high."""


class ProcessLink:
    """A link in a process of its own, by shared memory without locks.

    The link's process looks for states and commands four times in a period of the link, and passes
    each on when it comes. Nothing is sent before the first command. Every command passes the last
    check there. Without a fresh one for 10 ms, or two periods of a slow link, as from a controller
    that stopped or died, it sends the last check's damping; a fresh command takes over again. After
    `close`, or the end of the controller's process, it damps for a while longer, then closes its
    link and ends.

    The process is spawned: a script needs `if __name__ == "__main__":`. It imports neither
    Pinocchio nor MuJoCo unless `make` does. Ctrl-C and a lost terminal do not end it.

    Args:
        make: makes the link, in its process: a function of a module, or a `functools.partial`.
        check: the last check; the link's process has a copy of it.
        soles: names of the soles whose wrenches the link measures, as in its `info`.
        linger: time of damping after the end [s].
        priority: of the link's process under Linux's real-time scheduler `SCHED_FIFO`, 1 to 99, as
            80; without it another process may delay the damping.

    Raises:
        ConfigurationError: the link has other joints or soles than these.
        RobotError: the link's process ended or could not make the link; the message has the reason.
    """

    def __init__(
        self,
        make: Callable[[], Link],
        check: LastCheck,
        *,
        soles: tuple[str, ...] = (),
        linger: float = LINGER,
        priority: int | None = None,
    ) -> None:
        self._linger = linger = checked_number(linger, "linger of the link [s]")
        context = get_context("spawn")
        kinds = state_kind(len(check.joints), len(soles)), command_kind(len(check.joints))
        # Without a name: a process that is killed leaves nothing behind.
        memories = [context.RawArray("b", Mailbox.size_of(kind)) for kind in kinds]
        self._states, self._commands = map(Mailbox, memories, kinds)
        self._last, self._command = np.zeros((), dtype=kinds[0])[()], np.zeros((), dtype=kinds[1])
        self._closed = False
        near, far = context.Pipe(duplex=False)
        arguments = (make, check, soles, linger, priority, memories, far)
        # At the end of this process a daemon gets SIGTERM, after which it lingers and ends.
        self._process = context.Process(target=serve, args=arguments, daemon=True)
        self._process.start()
        far.close()
        try:
            answer = near.recv() if near.poll(START_TIME) else f"no answer in {START_TIME:g} s"
        except EOFError:
            answer = "it ended"
        near.close()
        if not isinstance(answer, LinkInfo):
            self._process.terminate()
            self._process.join()
            raise RobotError("the process of the link did not start", got=answer)
        self.info: LinkInfo = answer
        if (answer.joints, answer.soles) != (check.joints, soles):
            self._process.join()
            got, wanted = (answer.joints, answer.soles), f"{check.joints} and {soles}"
            raise ConfigurationError("the link has other joints or soles", got=got, wanted=wanted)

    @property
    def status(self) -> LinkStatus:
        """State of the connection; LOST once its process has ended, or after `close`."""
        if self._closed or not self._process.is_alive():
            return LinkStatus.LOST
        return STATUSES[int(self._read()["status"])]

    @property
    def refused(self) -> int:
        """Number of commands that failed the last check."""
        return int(self._read()["refused"])

    @property
    def reason(self) -> str:
        """Fault of the last refused command, or of the link; "" for none."""
        code = None if self._closed else self._process.exitcode
        ended = "" if code is None else f"the process of the link ended with status {code}"
        return bytes(self._read()["reason"]).decode(errors="replace") or ended

    @property
    def pid(self) -> int | None:
        """Identifier of the link's process, for its priority and processor; None once closed."""
        return None if self._closed else self._process.pid

    def clock(self) -> float:
        """Return `time.monotonic()`, which both processes share [s]."""
        return time.monotonic()

    def read(self) -> MotorState:
        """Return the newest state; the last one for ever where the link's process has ended."""
        record = self._read()
        return MotorState(**{name: record[name] for name in STATE_FIELDS})

    def write(self, command: MotorCommand) -> None:
        """Hand a command over to the link's process.

        Args:
            command: set-points of all joints.
        """
        if self._closed:
            return
        try:
            for name in COMMAND_FIELDS:
                self._command[name] = getattr(command, name)
        except (AttributeError, TypeError, ValueError):
            self._command["tau"] = np.nan  # The last check refuses it.
        self._send()

    def close(self) -> None:
        """Damp the robot, and wait for the end of the link's process."""
        if self._closed:
            return
        self._command["close"] = 1
        self._send()
        self._process.join(self._linger + START_TIME)
        self._process.kill()  # One whose driver hangs; it does nothing to one that has ended.
        self._process.join()
        self._closed = True

    def _send(self) -> None:
        self._command["sent"] = time.monotonic()
        self._commands.write(self._command[()])

    def _read(self) -> Record:
        found = self._states.read()
        if found is not None:
            self._last = found[1]
        return self._last
