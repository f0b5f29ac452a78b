"""`walk_run`: one recorded walk, all four methods in turn on its states, and their answers."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Int64

from benchmarks.clocked import Turns, time_all
from benchmarks.methods import timed_methods
from benchmarks.walk_recording import WalkRecording, WalkSubject, record_walk
from poise.robots import load_robot
from studies.plan import Progress, StudyOptions

ROBOT = "humanoid33"
"""As many joints as TOCABI has: eight in each arm, six in each leg, three in the waist, two in the
neck."""

STANCES = ("double", "single")
STACK = "table1"

_STEPS, _QUICK_STEPS = 6, 1
_SLOW, _QUICK_SLOW = 6, 2

_RECORDING_SHARE = 0.15
"""Of the time that recording and timing take together."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkRun:
    """Answers and times along a walk."""

    recording: WalkRecording  # the walk
    turns: Turns  # who was timed when
    subjects: dict[tuple[str, str], WalkSubject]  # by (controller, solver)

    def counted(self, solver: str, stance: str) -> Int64[np.ndarray, " n"]:
        """Ticks in a stance that count for a method."""
        return np.intersect1d(self.turns.counted(solver), self.recording.ticks(stance))

    def answered(self, solver: str, stance: str) -> Int64[np.ndarray, " n"]:
        """Ticks in a stance that a method's two controllers both answered."""
        ticks = self.recording.ticks(stance)
        pair = [self.subjects[c, solver] for c in ("whole_body", "reduced")]
        known = [np.isfinite(one.acceleration[ticks]).all(axis=1) for one in pair]
        return ticks[known[0] & known[1]]


def walk_run(options: StudyOptions, progress: Progress) -> WalkRun:
    """The walk of the study, made when it is first asked for.

    Several parts show different sides of it. The robot walks under the full controller, with a
    posture below everything; what is timed on its states is the stack of the paper's Table 1.
    """
    holder = _holder(options.quick)
    if not holder:
        holder.append(_run(options, progress))
    progress(1.0, 1.0)
    return holder[0]


@cache
def _holder(_quick: bool) -> list[WalkRun]:
    """A place for a run: a cache whose key is not the progress."""
    return []


def _run(options: StudyOptions, progress: Progress) -> WalkRun:
    steps = _QUICK_STEPS if options.quick else _STEPS
    share = _RECORDING_SHARE
    recording = record_walk(
        load_robot(ROBOT), steps, lambda done, total: progress(share * done / total, 1.0)
    )
    methods = timed_methods("reduced", None)
    subjects = {(m.controller, m.name): WalkSubject(recording, STACK, m) for m in methods}
    slow = _QUICK_SLOW if options.quick else _SLOW
    turns = Turns(ticks=len(recording.states), slow=slow)
    for done in time_all(subjects.values(), turns):
        progress(share + (1.0 - share) * done / turns.ticks, 1.0)
    return WalkRun(recording=recording, turns=turns, subjects=subjects)
