"""Symptoms: failure signs of a run, by tick, and the one that explains a failed check."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64

from poise.apps.report import RunSignals
from poise.apps.scenarios._scenario import Scenario
from poise.control import PHYSICS_TOLERANCE, CommandStatus
from poise.robots import Robot

_SETTLED = 0.05  # the robot is put down before this [s]
LASTING = 0.01  # shorter events do not make a robot fall [s]
_EDGE = 7e-3  # a ZMP nearer to the edge of the feet is at it: contacts leave 5 mm [m]
_FULL = 0.999  # torque over its limit from which it is at it


class Symptom(NamedTuple):
    """Failure sign that appears in intervals of a run."""

    kind: str  # one word for all of its kind, such as those of one joint and another
    what: str  # in words
    there: Bool[np.ndarray, " T"]  # ticks that have it
    lasting: float = LASTING  # least duration within twice that, for rocking feet come and go [s]

    def begin(self, time: Float64[np.ndarray, " T"]) -> float | None:
        """Return when it begins for `lasting` of the time that follows [s]; None for never."""
        count = 1 if len(time) < 2 else max(1, round(self.lasting / float(time[1] - time[0])))
        total = np.concatenate(([0], np.cumsum(self.there)))
        ends = np.minimum(np.arange(len(time)) + 2 * count, len(time))
        begins = self.there & (total[ends] - total[:-1] >= count)
        return float(time[int(np.argmax(begins))]) if begins.any() else None


def symptoms_of(signals: RunSignals, robot: Robot, scenario: Scenario) -> list[Symptom]:
    """All symptoms after the first push; of the whole run without a push."""
    since = max(_SETTLED, min((push.at for push in scenario.pushes), default=0.0))
    joints, soles = robot.joint_names, tuple(signals.soles)
    missed = np.array([s != CommandStatus.OK.value for s in signals.status])
    full = np.abs(signals.torque) >= _FULL * signals.torque_max
    found = [
        *_each("torque", "torque of {} at its limit", joints, full),
        *_each("stop", "{} at its stop", joints, _at_stop(signals, robot, since)),
        *_each("slip", "{} slips", soles, _slipping(signals, robot)),
        Symptom("zmp", "ZMP at the edge of the feet", signals.zmp_margin < _EDGE),
        Symptom("tick", "a tick without an answer", missed, lasting=0.0),
    ]
    if scenario.plant.commanded == "torque" and signals.residuals.shape[1] >= 2:
        words = ("dynamics unmet (level 1)", "contacts or joint limits unmet (level 2)")
        for level, what in enumerate(words):
            unmet = signals.residuals[:, level] > PHYSICS_TOLERANCE
            found.append(Symptom(f"level {level + 1}", what, unmet))
    for at, mode in signals.modes:
        if "lost" in mode:
            what = f"walk: {mode.split()[-1]}"
            found.append(Symptom("walk", what, signals.time >= at, lasting=0.0))
    late = signals.time >= since
    found = [symptom._replace(there=symptom.there & late) for symptom in found]
    return [symptom for symptom in found if symptom.there.any()]


def explain(
    symptoms: list[Symptom],
    time: Float64[np.ndarray, " T"],
    begin: float = -np.inf,
    end: float = np.inf,
) -> str:
    """The first three symptoms between two times [s], one of a kind, in words."""
    window = (time >= begin) & (time <= end)
    seen = [symptom._replace(there=symptom.there & window) for symptom in symptoms]
    found = beginnings(seen, time)[:3]
    return "; then ".join(f"{what} ({at:.2f} s)" for at, what in found)


def beginnings(symptoms: list[Symptom], time: Float64[np.ndarray, " T"]) -> list[tuple[float, str]]:
    """Times at which symptoms begin [s], the first of each kind, and their words, in order."""
    first: dict[str, tuple[float, str]] = {}
    for symptom in symptoms:
        at = symptom.begin(time)
        if at is not None:
            first[symptom.kind] = min(first.get(symptom.kind, (np.inf, "")), (at, symptom.what))
    return sorted(first.values())


def _each(
    kind: str, words: str, names: tuple[str, ...], there: Bool[np.ndarray, "T n"]
) -> list[Symptom]:
    """A symptom of each that ever has it."""
    return [
        Symptom(kind, words.format(names[i]), there[:, i])
        for i in np.flatnonzero(there.any(axis=0)).tolist()
    ]


def _at_stop(
    signals: RunSignals, robot: Robot, since: float, room: float = 5e-3
) -> Bool[np.ndarray, "T nj"]:
    """Joints nearer to a limit than this [rad] that they were not at before."""
    joints = signals.position
    near = (joints < robot.q_min + room) | (joints > robot.q_max - room)
    before = near[max(int(np.searchsorted(signals.time, since)) - 1, 0)]
    return near & ~before


def _slipping(
    signals: RunSignals, robot: Robot, least: float = 0.1, share: float = 0.2
) -> Bool[np.ndarray, "T n"]:
    """Soles under a share of the weight that go along the ground faster than this [m/s]."""
    slips = np.zeros((len(signals.time), len(signals.soles)), dtype=np.bool_)
    if len(signals.time) < 2:
        return slips
    for i, sole in enumerate(signals.soles.values()):
        speed = np.linalg.norm(np.gradient(sole.position[:, :2], signals.time, axis=0), axis=1)
        slips[:, i] = (speed > least) & (sole.force > share * robot.weight)
    return slips
