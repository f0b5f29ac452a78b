"""`bench_dof`: the full and the reduced controller on robots of 20 to 60 joints.

`speed_targets`: the ratios that the reduced controller should reach, beside what it reaches.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from benchmarks.clocked import Subject, Turns, time_all
from benchmarks.methods import timed_methods
from benchmarks.recording import STACKS, STANCES, Progress, record_run
from benchmarks.result import (
    TIME_HEADS,
    Result,
    TickResult,
    method_name,
    or_dash,
    text_table,
    time_cells,
)
from benchmarks.tick import tick_results
from poise.errors import ConfigurationError, UnknownNameError
from poise.hqp import make_solver
from poise.robots import load_robot

DIRECT, CASCADE = "direct", "cascade/osqp"

_CASCADE_AT_33 = {"double": 0.45, "single": 0.40}
"""Reduced over full tick by the cascade on OSQP; Ahn et al. 2024, Table 3: 0.45 and 0.33."""

_DIRECT_BY_JOINTS = {33: 0.70, 45: 0.55, 60: 0.45}
"""Reduced over full tick by the default solver."""

_NEVER_SLOWER_FROM = 24
_TIMES_FASTER, _ASSEMBLY, _SPREAD, _GROWTH = 8.0, 0.25, 2.0, 1.8


@dataclass(frozen=True, kw_only=True)
class Target(Result):
    """A ratio, and what it should be.

    Attributes:
        target: what the ratio is.
        contacts: stance.
        value: the ratio as measured.
        relation: how it should stand to the bound.
        bound: the bound.
    """

    target: str
    contacts: str
    value: float
    relation: Literal["<=", ">="]
    bound: float

    @property
    def met(self) -> bool:
        """Whether the value keeps the bound."""
        return self.value <= self.bound if self.relation == "<=" else self.value >= self.bound

    def to_json(self) -> dict[str, Any]:
        """The target as JSON holds it."""
        return {**super().to_json(), "met": self.met}


def speed_targets(results: Sequence[TickResult]) -> list[Target]:
    """Everything that can be said of the robots and stances that were timed."""
    targets: list[Target] = []
    for stance in dict.fromkeys(r.contacts for r in results):
        rows = {(r.joints, r.controller, r.solver): r for r in results if r.contacts == stance}
        targets += _stance_targets(stance, rows)
    return targets


def _stance_targets(stance: str, rows: dict[tuple[int, str, str], TickResult]) -> list[Target]:
    joints = sorted({n for n, _, _ in rows})

    def p50(n: int, controller: str, solver: str) -> float:
        return rows[n, controller, solver].p50_us

    def ratio(n: int, solver: str) -> float:
        return p50(n, "reduced", solver) / p50(n, "whole_body", solver)

    found: list[tuple[str, float, Literal["<=", ">="], float]] = []
    if 33 in joints:
        words = "33 joints: reduced over full tick, cascade/osqp"
        found.append((words, ratio(33, CASCADE), "<=", _CASCADE_AT_33[stance]))
    for n, bound in _DIRECT_BY_JOINTS.items():
        if n in joints:
            words = f"{n} joints: reduced over full tick, direct"
            found.append((words, ratio(n, DIRECT), "<=", bound))
    large = [n for n in joints if n >= _NEVER_SLOWER_FROM]
    if large:
        words = f"{_NEVER_SLOWER_FROM} joints and more: reduced over full tick, direct, most"
        found.append((words, max(ratio(n, DIRECT) for n in large), "<=", 1.0))
    if 33 in joints:
        words = "33 joints: full cascade/osqp over reduced direct"
        times = p50(33, "whole_body", CASCADE) / p50(33, "reduced", DIRECT)
        found.append((words, times, ">=", _TIMES_FASTER))
    for controller in ("whole_body", "reduced"):
        own = [rows[n, controller, DIRECT] for n in joints]
        shares = [(r.phases_us["assembly"] or 0.0) / r.p50_us for r in own]
        spread = max(r.p99_us / r.p50_us for r in own)
        found.append(
            (f"{controller} direct: assembly over tick, most", max(shares), "<=", _ASSEMBLY)
        )
        found.append((f"{controller} direct: p99 over p50, most", spread, "<=", _SPREAD))
        spread = max((r.cpu_p99_us or 0.0) / (r.cpu_p50_us or 1.0) for r in own)
        words = f"{controller} direct: p99 over p50 of processor time, most"
        found.append((words, spread, "<=", _SPREAD))
    if 33 in joints and 60 in joints:
        growth = p50(60, "reduced", DIRECT) / p50(33, "reduced", DIRECT)
        found.append(("reduced direct: 60 over 33 joints", growth, "<=", _GROWTH))
    return [
        Target(target=words, contacts=stance, value=round(value, 3), relation=relation, bound=bound)
        for words, value, relation, bound in found
    ]


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
        subjects = [Subject(recording, plan.stack, m) for m in methods]
        for done in time_all(subjects, turns):
            if progress is not None:
                progress(i + done / turns.ticks, float(len(plan.cases)))
        counted = {m.name: turns.counted(m.name) for m in methods}
        found = tick_results(recording, plan.stack, "tick", subjects, counted)
        results += sorted(found, key=lambda r: (r.solver != "direct", r.controller == "reduced"))
    return results


_HEADS = ("joints", "variables", "rows", *TIME_HEADS, "x whole", "residual", "relaxed")


def format_dof_table(results: Sequence[TickResult]) -> str:
    """A block a stance and method, a line a robot, times in microseconds; then the targets."""
    lines: list[str] = []
    for stance in dict.fromkeys(r.contacts for r in results):
        rows = [r for r in results if r.contacts == stance]
        for name in dict.fromkeys(method_name(r) for r in rows):
            own = [r for r in rows if method_name(r) == name]
            lines += ["", f"{name}, {stance} support, stack {own[0].stack!r}, times in us"]
            lines += text_table(_HEADS, [("", *_cells(row)) for row in own])
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


def _cells(row: TickResult) -> tuple[list[str], str]:
    # By its own tolerance a cascade on OSQP never meets a level in full.
    known = row.solver == "direct" and row.relaxed_ticks is not None
    cells = [str(row.joints), str(row.variables), str(row.rows), *time_cells(row)]
    cells += [or_dash(row.ratio_to_whole, ".2f"), or_dash(row.residual_max, ".0e")]
    cells.append(f"{row.relaxed_ticks}/{row.ticks}" if known else "-")
    return cells, f"  {row.missed_ticks} ticks FAILED" if row.missed_ticks else ""
