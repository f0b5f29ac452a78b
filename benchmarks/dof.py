"""`bench_dof`: the full and the reduced controller on robots of 20 to 60 joints.

Results of `bench_dof` as a table for a terminal.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass

from benchmarks.clocked import Subject
from benchmarks.methods import Method, timed_methods
from benchmarks.recording import Progress, Recording, record_run
from benchmarks.result import PHASES, TickResult, method_name
from benchmarks.schedule import Turns, take_turns
from benchmarks.stances import STACKS, STANCES
from benchmarks.targets import speed_targets
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


_TIMES = ("p50", "p99", "max", "cpu p99", *PHASES)
_HEADS = ("joints", "variables", "rows", *_TIMES, "x whole", "residual", "relaxed")


def format_dof_table(results: Sequence[TickResult]) -> str:
    """A block a stance and method, a line a robot, times in microseconds; then the targets.

    Args:
        results: of `bench_dof`.
    """
    lines: list[str] = []
    for stance in dict.fromkeys(r.contacts for r in results):
        rows = [r for r in results if r.contacts == stance]
        for name in dict.fromkeys(method_name(r) for r in rows):
            own = [r for r in rows if method_name(r) == name]
            lines += ["", f"{name}, {stance} support, stack {own[0].stack!r}, times in us"]
            lines.append("  ".join(f"{head:>9}" for head in _HEADS))
            lines += [_line(row) for row in own]
    targets = speed_targets(results)
    if targets:
        width = max(len(t.target) for t in targets)
        lines += ["", "targets, ratios of medians"]
        lines += [
            f"{t.contacts:6}  {t.target:{width}}  {t.value:7.2f}  {t.relation} {t.bound:g}"
            + ("" if t.met else "  MISSED")
            for t in targets
        ]
    return "\n".join(lines).lstrip("\n")


def _line(row: TickResult) -> str:
    cells = [str(row.joints), str(row.variables), str(row.rows)]
    times = (
        row.p50_us,
        row.p99_us,
        row.max_us,
        row.cpu_p99_us,
        *(row.phases_us[p] for p in PHASES),
    )
    cells += ["-" if t is None else f"{t:.0f}" for t in times]
    cells.append("-" if row.ratio_to_whole is None else f"{row.ratio_to_whole:.2f}")
    cells.append("-" if row.residual_max is None else f"{row.residual_max:.0e}")
    # By its own tolerance a cascade on OSQP never meets a level in full.
    known = row.solver == "direct" and row.relaxed_ticks is not None
    cells.append(f"{row.relaxed_ticks}/{row.ticks}" if known else "-")
    line = "  ".join(f"{cell:>9}" for cell in cells)
    return line + (f"  {row.missed_ticks} ticks FAILED" if row.missed_ticks else "")
