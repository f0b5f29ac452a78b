"""What goes wrong in a run, tick by tick, and which of it stands behind a failed check."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64

from poise.apps.scenarios._scenario import Scenario
from poise.apps.scenarios._signals import RunSignals
from poise.control import CommandStatus
from poise.robots import Robot

_SETTLED = 0.05
"""What happens before this is the robot being put down [s]."""

_LASTING = 0.01
"""What lasts shorter than this did not bring anybody down [s]."""

_EDGE = 7e-3
"""A ZMP nearer to the edge of the feet than this is at it: contacts leave 5 mm [m]."""

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

_BEFORE = 0.25
"""What happened this long before the worst moment of a check may have brought it about [s]."""

_SAID = 3
"""So many symptoms are told of a check."""


class Symptom(NamedTuple):
    """Something that goes wrong now and then.

    Attributes:
        kind: one word for all of its kind, such as those of one joint and another.
        what: in words.
        there: in which ticks.
        lasting: least duration within twice that time, for rocking feet come and go [s].
    """

    kind: str
    what: str
    there: Bool[np.ndarray, " T"]
    lasting: float = _LASTING

    def begin(self, time: Float64[np.ndarray, " T"]) -> float | None:
        """Return when it begins for `lasting` of the time that follows [s]; None for never."""
        count = 1 if len(time) < 2 else max(1, round(self.lasting / float(time[1] - time[0])))
        total = np.concatenate(([0], np.cumsum(self.there)))
        ends = np.minimum(np.arange(len(time)) + 2 * count, len(time))
        begins = self.there & (total[ends] - total[:-1] >= count)
        return float(time[int(np.argmax(begins))]) if begins.any() else None

    def between(self, time: Float64[np.ndarray, " T"], begin: float, end: float) -> "Symptom":
        """The same in a window of time alone [s]."""
        return self._replace(there=self.there & (time >= begin) & (time <= end))


def symptoms_of(signals: RunSignals, robot: Robot, scenario: Scenario) -> list[Symptom]:
    """Everything that can go wrong, after the first push where there is one."""
    pushes = [push.at for push in scenario.pushes]
    since = max(_SETTLED, min(pushes, default=0.0))
    joints = robot.joint_names
    found = [
        *_each("torque", "torque of {} at its limit", joints, _at_limit(signals)),
        *_each("stop", "{} at its stop", joints, _at_stop(signals, robot, since)),
        *_each("slip", "{} slips", tuple(signals.sole_positions), _slipping(signals, robot)),
        Symptom("zmp", "ZMP at the edge of the feet", signals.zmp_margin < _EDGE),
        Symptom(
            "tick",
            "a tick without an answer",
            np.array([s != CommandStatus.OK.value for s in signals.status]),
            lasting=0.0,
        ),
    ]
    if scenario.plant.commanded == "torque" and signals.residuals.shape[1] >= 2:
        words = ("dynamics unmet (level 1)", "contacts or joint limits unmet (level 2)")
        for level, what in enumerate(words):
            unmet = signals.residuals[:, level] > _RESIDUAL
            found.append(Symptom(f"level {level + 1}", what, unmet))
    late = signals.time >= since
    found = [symptom._replace(there=symptom.there & late) for symptom in found]
    return [symptom for symptom in found if symptom.there.any()]


def tell(symptoms: list[Symptom], time: Float64[np.ndarray, " T"], begin: float, end: float) -> str:
    """The first symptoms of a window of time, one of a kind, in words; "" for none."""
    first: dict[str, tuple[float, str]] = {}
    for symptom in symptoms:
        at = symptom.between(time, begin, end).begin(time)
        if at is not None:
            first[symptom.kind] = min(first.get(symptom.kind, (np.inf, "")), (at, symptom.what))
    return "; then ".join(f"{what} ({at:.2f} s)" for at, what in sorted(first.values())[:_SAID])


def tell_before(symptoms: list[Symptom], time: Float64[np.ndarray, " T"], worst: float) -> str:
    """What went wrong shortly before a moment [s], in words; "" where nothing is known."""
    # What begins at that very moment lasts beyond it.
    return tell(symptoms, time, worst - _BEFORE, worst + _LASTING)


def _each(
    kind: str, words: str, names: tuple[str, ...], there: Bool[np.ndarray, "T n"]
) -> list[Symptom]:
    """A symptom of each that ever has it."""
    return [
        Symptom(kind, words.format(names[i]), there[:, i])
        for i in np.flatnonzero(there.any(axis=0)).tolist()
    ]


def _at_limit(signals: RunSignals) -> Bool[np.ndarray, "T nj"]:
    return np.abs(signals.torque) >= _FULL * signals.torque_max


def _at_stop(signals: RunSignals, robot: Robot, since: float) -> Bool[np.ndarray, "T nj"]:
    """Which joints are at a limit that they were not at before."""
    joints = signals.q[:, robot.nq - robot.nj :]
    near = (joints < robot.q_min + _STOP) | (joints > robot.q_max - _STOP)
    before = near[max(int(np.searchsorted(signals.time, since)) - 1, 0)]
    return near & ~before


def _slipping(signals: RunSignals, robot: Robot) -> Bool[np.ndarray, "T n"]:
    if len(signals.time) < 2 or not signals.sole_positions:
        return np.zeros((len(signals.time), len(signals.sole_positions)), dtype=np.bool_)
    slips: list[Bool[np.ndarray, " T"]] = []
    for name, places in signals.sole_positions.items():
        speed = np.linalg.norm(np.gradient(places[:, :2], signals.time, axis=0), axis=1)
        slips.append((speed > _SLIP) & (signals.sole_forces[name] > _CARRIES * robot.weight))
    return np.stack(slips, axis=1)
