"""`preflight`: checks of a robot behind a link, before the first command is sent."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain

import numpy as np

from poise._checks import checked_kind, checked_number
from poise.errors import ConfigurationError
from poise.hardware import _preflight_checks as at_rest, _preflight_moves as by_hand
from poise.hardware._last_check import LastCheck
from poise.hardware._link import Joints, Link, MotorState
from poise.hardware._preflight_checks import PreflightCheck
from poise.hardware._preflight_moves import Move
from poise.robots import Robot

_PATIENCE = 15.0  # for a motion [s]: two seconds for each of an arm's seven joints, and one more
_STALLED = 1.0  # wall time without progress of the link's clock after which it stands [s]


@dataclass(frozen=True, kw_only=True)
class Preflight:
    """Result of a preflight; `str` formats it as a table.

    Attributes:
        checks: all that were made, in their order.
    """

    checks: tuple[PreflightCheck, ...]

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the failed checks."""
        return tuple(check.name for check in self.checks if check.ok is False)

    @property
    def ok(self) -> bool:
        """True if no check failed; those without data do not count."""
        return not self.failed

    def __str__(self) -> str:
        marks = {True: "ok", False: "FAILED", None: "-"}
        rows = [("", "check", "seen", "wanted")]
        rows += [(marks[c.ok], c.name, c.seen, c.wanted) for c in self.checks]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        lines += [f"{c.name}: {c.remedy}." for c in self.checks if c.ok is False]
        return "\n".join((*lines, "Preflight passed." if self.ok else "Preflight FAILED."))


def preflight(
    robot: Robot,
    link: Link,
    check: LastCheck,
    *,
    start: Joints | None = None,
    seconds: float = 3.0,
    motion: Callable[[Move], None] | None = None,
    each_joint: bool = False,
) -> Preflight:
    """Check a robot that hangs limp or damped, its feet in the air; nothing is sent.

    It listens at rest. If all is well and `motion` is given, a person rocks the pelvis and moves
    the limbs by hand. A check has no verdict where the link does not measure; checks that need what
    failed before are left out.

    At rest, mistakes of order and sign are found where they move the posture out of the position
    limits, or where the model's gravity torques there are not those measured. Rocking finds a gyro
    or accelerometer turned about the vertical; moving whole limbs finds joints interchanged between
    limbs and encoders that stand; moving each joint finds joints interchanged within a limb and a
    sign of position, velocity and torque together.

    Args:
        robot: the model.
        link: to the robot.
        check: the last check of the commands to come.
        start: joint positions at which the run starts, None for any [rad].
        seconds: time to listen at rest [s].
        motion: called with each request, to show its `prompt`; returns when the person is about to
            begin, with the robot still. None to ask for no motion.
        each_joint: ask for each joint by itself in place of whole limbs.

    Raises:
        ConfigurationError: `start` or `seconds` is out of range.
    """
    checked_kind(robot, Robot, "robot of the preflight")
    checked_number(seconds, "seconds of the preflight [s]", above=0.0)
    if start is not None and (np.shape(start) != (robot.nj,) or not np.isfinite(start).all()):
        raise ConfigurationError("start [rad]", got=start, wanted=f"{robot.nj} finite numbers")
    checks = at_rest.wiring_checks(robot, link, check)
    if all(c.ok for c in checks[:2]):
        begin = link.clock()
        states = _listen(link, seconds)
        elapsed, (samples, numbers) = link.clock() - begin, at_rest.stacked(robot, states)
        checks.append(numbers)
        if numbers.ok:
            checks += at_rest.timing_checks(link, samples, elapsed, seconds)
            checks += at_rest.rest_checks(robot, link, samples, start)
    if motion is not None and all(c.ok is not False for c in checks):
        checks += _moved(robot, link, motion, each_joint)
    return Preflight(checks=tuple(checks))


def _moved(
    robot: Robot, link: Link, motion: Callable[[Move], None], each_joint: bool
) -> list[PreflightCheck]:
    singles = (by_hand.joint_move(robot, k, link.read().q) for k in range(robot.nj))
    moves, records = list[Move](), list[at_rest.Samples]()
    for move in chain([by_hand.ROCK], singles if each_joint else by_hand.limb_moves(robot)):

        def done(seen: list[MotorState], move: Move = move) -> bool:
            return bool(np.all(move.reach(at_rest.stacked(robot, seen)[0]) >= by_hand.MOVED))

        motion(move)
        samples, numbers = at_rest.stacked(robot, _listen(link, _PATIENCE, done))
        if not numbers.ok:
            return [numbers]
        moves.append(move)
        records.append(samples)
    return by_hand.motion_checks(robot, moves, records)


def _listen(
    link: Link, seconds: float, done: Callable[[list[MotorState]], bool] = lambda _: False
) -> list[MotorState]:
    """Collect states for a time by the link's clock, or until done."""
    states, last, each = list[MotorState](), None, max(2, round(by_hand.WINDOW * link.info.rate))
    begin = now = link.clock()
    progress = time.monotonic()
    while now < begin + seconds and time.monotonic() - progress < _STALLED:
        state = link.read()
        if (state.time, state.arrived) == last:
            time.sleep(0.25 / link.info.rate)
        else:
            last = state.time, state.arrived
            states.append(state)
            if len(states) % each == 1 and done(states[::each]):
                break
        before, now = now, link.clock()
        progress = time.monotonic() if now > before else progress
    return states
