"""What happened first in a run that was not survived, from its signals."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from poise.apps.scenarios import Run, symptoms_of
from poise.control import CommandStatus

LEAN_MAX = 0.5
"""A robot whose base leans further from where it was at home does not stand upright [rad]."""

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
    """The first time of everything that went wrong, one of a kind."""
    signals = run.signals
    first: dict[str, Event] = {}
    for symptom in symptoms_of(signals, run.robot, run.scenario):
        begin = symptom.begin(signals.time)
        if begin is not None:
            event = Event(begin, symptom.what)
            first[symptom.kind] = min(first.get(symptom.kind, event), event)
    lost = [Event(t, f"walk: {mode.split()[-1]}") for t, mode in signals.modes if "lost" in mode]
    return [*first.values(), *lost]


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
