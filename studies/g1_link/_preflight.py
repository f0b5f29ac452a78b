"""`preflight`: mistakes of wiring, frames, units and clocks, and which of them are found."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from poise.apps.deployment import g1_gains
from poise.hardware import LinkStatus, MotorCommand, MotorState, Move, Preflight, preflight
from poise.robots import Robot
from studies.finding import Finding, Section, Table
from studies.g1_link._hanging import HangingRobot
from studies.g1_link._loops import load_g1
from studies.g1_link._mistakes import Change, Mistaken, scaled, swapped, turned
from studies.plan import Progress, StudyOptions

_REST, _ROCK, _LIMB = 3.0, 6.0, 1.2
"""Lengths of what is recorded at rest, while the pelvis is rocked, and of a limb's motion [s]."""

_QUARTER, _HALF = pin.utils.rotate("z", np.pi / 2), pin.utils.rotate("x", np.pi)


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """A mistake between the robot and its reader."""

    name: str
    change: Change = lambda state: state  # of each state
    fresh: Callable[[float], bool] = np.isfinite  # whether there is a new state at a time


class Recorded:
    """Link that repeats what a robot in its hoist measured, at rest and in each motion.

    Args:
        link: to a hanging robot.
    """

    def __init__(self, link: HangingRobot) -> None:
        self.info, self.status, self.refused, self.reason = link.info, LinkStatus.OK, 0, ""
        self._link, self._period = link, 1.0 / link.info.rate
        self._rest = self._states(_REST + 0.1)
        self._moves = dict[tuple[Any, ...], list[MotorState]]()
        self._begin(self._rest)

    def rest(self) -> "Recorded":
        """Begin once more, at rest."""
        self._begin(self._rest)
        return self

    def ask(self, move: Move) -> None:
        """Begin a motion."""
        key = move.joints, move.sign
        if key not in self._moves:
            self._link.ask(move)
            self._moves[key] = self._states(_LIMB if move.joints else _ROCK)
        self._begin(self._moves[key])

    def read(self) -> MotorState:
        """Return the next state, or the last one."""
        state = next(self._now, None)
        self._over += 0.0 if state is not None else self._period
        self._last = self._last if state is None else state
        return self._last

    def clock(self) -> float:
        """Return the time of the record, which goes on behind its end [s]."""
        return self._last.time + self._over

    def write(self, command: MotorCommand) -> None:
        """Do nothing: a preflight sends nothing."""

    def close(self) -> None:
        """Do nothing."""

    def _begin(self, states: list[MotorState]) -> None:
        self._now: Iterator[MotorState] = iter(states)
        self._last, self._over = states[0], 0.0

    def _states(self, seconds: float) -> list[MotorState]:
        return [self._link.read() for _ in range(round(seconds / self._period))]


def mistakes(robot: Robot) -> list[Mistake]:
    """Return twenty mistakes."""

    def joint(name: str) -> int:
        return robot.joint_index(f"{name}_joint")

    def swap(one: str, other: str, *names: str) -> Change:
        found = joint(one), joint(other)
        return swapped(*found, names) if names else swapped(*found)

    def scale(name: str, factor: float, *names: str) -> Change:
        return scaled(joint(name), factor, names=names) if names else scaled(joint(name), factor)

    def w_first(state: MotorState) -> MotorState:
        return replace(state, quaternion=state.quaternion[[3, 0, 1, 2]])

    def milliseconds(state: MotorState) -> MotorState:
        return replace(state, time=1e3 * state.time)

    def hot(state: MotorState) -> MotorState:
        return replace(state, temperature=np.full(robot.nj, 85.0))

    changes = {
        "elbow and shoulder roll interchanged": swap("left_elbow", "left_shoulder_roll"),
        "knees interchanged": swap("left_knee", "right_knee"),
        "hip and wrist interchanged": swap("left_hip_roll", "right_wrist_yaw"),
        "velocities interchanged": swap("left_hip_pitch", "left_wrist_roll", "dq"),
        "sign of an elbow": scale("left_elbow", -1.0),
        "sign of a velocity": scale("left_wrist_yaw", -1.0, "dq"),
        "sign of a torque": scale("left_hip_yaw", -1.0, "tau"),
        "a knee in degrees": scale("left_knee", 180.0 / np.pi),
        "a velocity in turns": scale("left_ankle_roll", 0.5 / np.pi, "dq"),
        "a motor that is missing": scale("left_knee", 0.0),
        "an encoder that stands": scale("right_hip_roll", 0.0, "q"),
        "NaN": scale("right_elbow", np.nan),
        "unit upside down": turned(_HALF, "gyro", "acceleration", "quaternion"),
        "quaternion with w first": w_first,
        "accelerometer in g": turned(np.eye(3) / 9.81, "acceleration"),
        "gyro turned about the vertical": turned(_QUARTER, "gyro"),
        "accelerometer turned about the vertical": turned(_QUARTER, "acceleration"),
        "stamps in milliseconds": milliseconds,
        "a hot motor": hot,
    }
    made = [Mistake(name=name, change=change) for name, change in changes.items()]
    half = Mistake(name="half the rate", fresh=lambda time: round(500.0 * time) % 2 == 0)
    return [*made, half]


def preflight_section(options: StudyOptions, progress: Progress) -> Section:
    """Make preflights of a robot without mistakes, and with one each."""
    robot, found = load_g1(), dict[str, Preflight]()
    check = g1_gains(robot).check
    link = Recorded(HangingRobot(robot, check, seed=options.seed))
    seeded = [Mistake(name="none"), *mistakes(robot)]
    for k, mistake in enumerate(seeded):
        progress(float(k), float(len(seeded)))
        wrong: Any = Mistaken(link.rest(), mistake.change, mistake.fresh)
        found[mistake.name] = preflight(robot, wrong, check, seconds=_REST, motion=link.ask)
    progress(float(len(seeded)), float(len(seeded)))
    well, missed = found.pop("none"), [name for name, f in found.items() if f.ok]
    return Section(
        prose=(
            "A G1 hangs in two straps, limp, with noise and dry friction; a person rocks its "
            "pelvis and moves its limbs. What it measures is recorded once; a mistake is seeded "
            "between it and `poise.hardware.preflight`, one at a time.",
        ),
        findings=(
            Finding(
                name="mistakes that the preflight does not find",
                ours=len(missed),
                paper=0,
                ok=not missed,
                note=f"of {len(found)}" + "".join(f"; {name}" for name in missed),
            ),
            Finding(
                name="failed checks of a robot without mistakes",
                ours=len(well.failed),
                paper=0,
                ok=well.ok,
                note=", ".join(well.failed),
            ),
        ),
        tables=(
            Table(
                title="Mistakes",
                header="mistake | checks that find it",
                rows=tuple((name, ", ".join(f.failed) or "none") for name, f in found.items()),
            ),
        ),
    )
