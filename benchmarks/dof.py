"""`bench_dof`: the full and the reduced controller on robots of 20 to 60 joints."""

from collections.abc import Generator
from dataclasses import dataclass

from benchmarks.methods import Method, timed_methods
from benchmarks.recording import Progress, Recording, record_run
from benchmarks.result import TickResult
from benchmarks.schedule import Turns, take_turns
from benchmarks.stances import STACKS, STANCES
from benchmarks.subject import Subject
from benchmarks.tick import tick_results
from poise.errors import ConfigurationError, UnknownNameError
from poise.hqp import make_solver
from poise.robots import load_robot

JOINTS = (20, 24, 28, 33, 37, 41, 45, 50, 55, 60)
"""Joints of the robots: Figure 5 of Ahn et al. 2024 ends at 45."""


@dataclass(frozen=True, kw_only=True)
class DofBench:
    """What to time; checked when made.

    Attributes:
        joints: numbers of joints of `humanoidN`.
        contacts: "double", "single", or both.
        stack: one of `STACKS`.
        ticks: recorded ticks of each robot and stance after the first batch.
        slow_ticks: ticks in every 50 on which the cascade is timed.
    """

    joints: tuple[int, ...] = JOINTS
    contacts: tuple[str, ...] = STANCES
    stack: str = "table1"
    ticks: int = 300
    slow_ticks: int = 5

    def __post_init__(self) -> None:
        for what, got, choices in (
            ("unknown contacts", self.contacts, STANCES),
            ("unknown stack", (self.stack,), STACKS),
        ):
            for name in got:
                if name not in choices:
                    raise UnknownNameError(what, got=name, choices=choices)
        if not self.joints or not self.contacts or self.ticks < 10:
            raise ConfigurationError(
                "nothing to time",
                got=f"joints {self.joints}, contacts {self.contacts}, {self.ticks} ticks",
                wanted="a number of joints, a stance and 10 ticks or more",
            )

    @property
    def cases(self) -> list[tuple[int, str]]:
        """Joints and stances, in the order in which they are timed."""
        return [(n, stance) for n in self.joints for stance in self.contacts]


def bench_dof(plan: DofBench, progress: Progress | None = None) -> list[TickResult]:
    """Times full and reduced controller, by default solver and by cascade on OSQP.

    Each robot is recorded in motion like in `bench_tick`; then its four methods take turns, see
    `Turns`.

    Args:
        plan: what to time.
        progress: told how many robots and stances are done.

    Returns:
        Four results a robot and stance: `direct`, then the cascade, the whole-body controller
        before the reduced one.

    Raises:
        PoiseError: bad input, OSQP is not installed, or a robot that fell.
    """
    methods = timed_methods("reduced", None)
    for method in methods:
        if method.backend is not None:
            make_solver(method.strategy, method.backend)
    # All names before the first run.
    robots = {n: load_robot(f"humanoid{n}") for n in plan.joints}
    results: list[TickResult] = []
    for i, (joints, stance) in enumerate(plan.cases):
        turns = Turns(ticks=50 + plan.ticks, slow=plan.slow_ticks)
        recording = record_run(robots[joints], stance, turns.ticks)
        subjects = {m: Subject(recording, plan.stack, m) for m in methods}
        for done in _time(subjects, turns):
            if progress is not None:
                progress(i + done / turns.ticks, float(len(plan.cases)))
        results += _results(recording, plan.stack, subjects, turns)
    return results


def _time(subjects: dict[Method, Subject], turns: Turns) -> Generator[int]:
    quick = [one for method, one in subjects.items() if method.backend is None]
    slow = [one for method, one in subjects.items() if method.backend is not None]
    yield from take_turns(quick, slow, turns)


def _results(
    recording: Recording, kind: str, subjects: dict[Method, Subject], turns: Turns
) -> list[TickResult]:
    counted = {
        method.name: turns.quick_counted() if method.backend is None else turns.slow_counted()
        for method in subjects
    }
    results = tick_results(recording, kind, "tick", list(subjects.values()), counted)
    return sorted(results, key=lambda r: (r.solver != "direct", r.controller == "reduced"))
