"""What happened first in a run that was not survived, from its signals."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Bool, Float64

from poise.apps.scenarios import Run, RunSignals
from poise.control import CommandStatus
from poise.robots import GRAVITY

LEAN_MAX = 0.5
"""A robot whose base leans further from where it was at home does not stand upright [rad]."""

_SETTLED = 0.05
"""What happens before this is the robot being put down [s]."""

_LASTING = 0.01
"""What lasts shorter than this did not bring anybody down [s]."""

_EDGE = 2e-3
"""A ZMP nearer to the edge of the feet than this is at it [m]."""

_STOP = 5e-3
"""A joint nearer to its limit than this is at it [rad]."""

_FULL = 0.999
"""A torque over its limit from which it is at it."""

_SLIP = 0.1
"""A sole that carries load and goes faster along the ground than this slips [m/s]."""

_CARRIES = 0.2
"""A sole with this share of the robot's weight carries load."""

_RESIDUAL = 1e-6
"""A level with a larger relative residual is unmet."""

_SAID = 3
"""So many events say how it came."""


class Event(NamedTuple):
    """Something that happened in a run.

    Attributes:
        time: when it began [s].
        what: in words.
    """

    time: float
    what: str


def lean(run: Run) -> float:
    """Angle of the base's vertical at the end of a run from where it was at home [rad]."""
    home, now = (
        pin.Quaternion(q[3:7]).toRotationMatrix()[:, 2]
        for q in (run.robot.q_home, run.signals.q[-1])
    )
    return float(np.arccos(np.clip(home @ now, -1.0, 1.0)))


def mechanism(run: Run) -> str:
    """How it came that a run was not survived: what happened first, and how it ended."""
    events = sorted(events_of(run))[:_SAID]
    told = [f"{event.what} ({event.time:.2f} s)" for event in events]
    return "; then ".join([*told, _end(run)])


def events_of(run: Run) -> list[Event]:
    """The first time of everything that can go wrong, after the first push where there is one."""
    signals = run.signals
    pushes = [push.at for push in run.scenario.pushes]
    since = max(_SETTLED, min(pushes, default=0.0))
    late = signals.time >= since
    names = run.robot.joint_names
    found = [
        _of_joints(signals, _at_limit(signals), names, "torque of {} at its limit", late),
        _of_joints(signals, _at_stop(run, since), names, "{} at its stop", late),
        _of_joints(signals, _slipping(run), tuple(signals.sole_positions), "{} slips", late),
        _first(signals, signals.zmp_margin < _EDGE, "ZMP at the edge of the feet", late),
        _first(
            signals,
            np.array([s != CommandStatus.OK.value for s in signals.status]),
            "a tick without an answer",
            late,
            lasting=0.0,
        ),
    ]
    if run.scenario.plant.actuation == "torque":
        words = ("dynamics unmet (level 1)", "contacts or joint limits unmet (level 2)")
        for level, what in enumerate(words):
            found.append(_first(signals, signals.residuals[:, level] > _RESIDUAL, what, late))
    found += [Event(t, f"walk: {mode.split()[-1]}") for t, mode in signals.modes if "lost" in mode]
    return [event for event in found if event is not None]


def _end(run: Run) -> str:
    if run.ended_early:
        return run.ended_early
    if lean(run) > LEAN_MAX:
        return f"it leaned by {lean(run):.2f} rad at the end"
    if run.scenario.walk is not None:
        return f"the walk was not finished ({run.signals.modes[-1][1]})"
    if any(status != CommandStatus.OK.value for status in run.signals.status):
        return "it went on to the end"
    own = run.checks[len(run.checks) - len(run.scenario.checks) :]
    return "; ".join(f"at the end {c.name} was {c.value:.2g} {c.unit}" for c in own if not c.ok)


def _at_limit(signals: RunSignals) -> Bool[np.ndarray, "T nj"]:
    return np.abs(signals.torque) >= _FULL * signals.torque_max


def _at_stop(run: Run, since: float) -> Bool[np.ndarray, "T nj"]:
    """Which joints are at a limit that they were not at before."""
    robot = run.robot
    joints = run.signals.q[:, robot.nq - robot.nj :]
    near = (joints < robot.q_min + _STOP) | (joints > robot.q_max - _STOP)
    before = near[int(np.searchsorted(run.signals.time, since)) - 1]
    return near & ~before


def _slipping(run: Run) -> Bool[np.ndarray, "T n"]:
    signals = run.signals
    weight = run.robot.mass * GRAVITY
    slips: list[Bool[np.ndarray, " T"]] = []
    for name, places in signals.sole_positions.items():
        speed = np.linalg.norm(np.gradient(places[:, :2], signals.time, axis=0), axis=1)
        slips.append((speed > _SLIP) & (signals.sole_forces[name] > _CARRIES * weight))
    return np.stack(slips, axis=1)


def _of_joints(
    signals: RunSignals,
    there: Bool[np.ndarray, "T n"],
    names: tuple[str, ...],
    words: str,
    late: Bool[np.ndarray, " T"],
) -> Event | None:
    """The first of many to be there."""
    events = [
        _first(signals, there[:, i], words.format(name), late) for i, name in enumerate(names)
    ]
    return min((event for event in events if event is not None), default=None)


def _first(
    signals: RunSignals,
    there: Bool[np.ndarray, " T"],
    what: str,
    late: Bool[np.ndarray, " T"],
    lasting: float = _LASTING,
) -> Event | None:
    """When something begins to be so, and stays so for a while."""
    time: Float64[np.ndarray, " T"] = signals.time
    count = 1 if len(time) < 2 else max(1, round(lasting / float(time[1] - time[0])))
    held = np.convolve(there & late, np.ones(count), mode="full")[: len(time)] >= count
    if not held.any():
        return None
    return Event(float(time[int(np.argmax(held)) - count + 1]), what)
