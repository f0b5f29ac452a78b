"""Figure 5: time of a tick by joints, 20 to 45 and on to 60."""

from typing import Any

from benchmarks.result import TickResult
from benchmarks.tick import TickBench, bench_tick
from studies.finding import Figure, Finding, Section, Table, draw
from studies.plan import Progress, StudyOptions
from studies.reduced_dynamics.walk_run import STANCES

JOINTS, _QUICK_JOINTS = (20, 24, 28, 33, 37, 41, 45, 50, 55, 60), (20, 45)
"""Joints of the robots: the paper's figure ends at 45."""

_TICKS, _QUICK_TICKS = 150, 40

_PAPER = {20: (754.0, 571.0), 45: (4081.0, 1319.0)}
"""Mean times of the conventional and the proposed method in double support [us]."""

_SOLVERS = ("cascade/osqp", "direct")
_NAMES = {"whole_body": "conventional", "reduced": "proposed"}

Rows = dict[tuple[str, int, str, str], TickResult]
"""Results by stance, joints, controller and solver."""


def dof_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    joints = _QUICK_JOINTS if options.quick else JOINTS
    cases = [(stance, n) for stance in STANCES for n in joints]
    rows: Rows = {}
    for i, (stance, n) in enumerate(cases):
        plan = TickBench(
            robot=f"humanoid{n}",
            contacts=stance,
            controller="reduced",
            stacks=("table1",),
            methods=("direct", "cascade/osqp"),
            ticks=_QUICK_TICKS if options.quick else _TICKS,
        )
        for result in bench_tick(plan):
            rows[stance, n, result.controller, result.solver] = result
        progress(i + 1.0, float(len(cases)))
    return Section(
        prose=(
            "Parametric humanoids with 12 joints in the legs and the others in waist, arms, neck "
            "and hands; each is recorded in motion in MuJoCo, and full and reduced controller take "
            "turns on its states. The stack is Table 1 with both hands. The paper shows double "
            "support, 20 to 45 joints, by OSQP. Arms of few joints cannot serve the pose of a hand "
            "in full: where something has to give on every tick, both methods search for it, and "
            "where limits of the arms are among it the reduced controller solves the whole "
            "problem.",
        ),
        findings=(*_quoted(rows), *_trends(rows, min(joints), max(joints))),
        figures=(_figure(rows, joints),),
        tables=(_table(rows),),
    )


def _ratio(rows: Rows, stance: str, joints: int, solver: str) -> float:
    own, full = (rows[stance, joints, c, solver] for c in ("reduced", "whole_body"))
    return own.p50_us / full.p50_us


def _quoted(rows: Rows) -> list[Finding]:
    """The two robots of which the paper gives numbers, in double support."""
    return [
        Finding(
            name=f"Figure 5, {joints} joints, double support, cascade/osqp: decrease",
            paper=100.0 * (1.0 - own / full),
            ours=100.0 * (1.0 - _ratio(rows, "double", joints, "cascade/osqp")),
            unit="%",
            ok=_ratio(rows, "double", joints, "cascade/osqp") <= own / full,
            note=f"{full:.0f} to {own:.0f} µs in the paper",
        )
        for joints, (full, own) in _PAPER.items()
    ]


def _trends(rows: Rows, small: int, large: int) -> list[Finding]:
    findings: list[Finding] = []
    for stance in STANCES:
        for solver in _SOLVERS:
            first, last = (_ratio(rows, stance, n, solver) for n in (small, large))
            findings.append(
                Finding(
                    name=f"Figure 5, {stance} support, {solver}: ratio at {large} joints to ratio "
                    f"at {small}",
                    paper=(1319 / 4081) / (571 / 754) if stance == "double" else None,
                    ours=last / first,
                    ok=last < first,
                    note="“more pronounced with an increase in the DOF”; the paper's number is 45 "
                    f"to 20. Proposed to conventional: {first:.2f} and {last:.2f}.",
                )
            )
    return findings


def _table(rows: Rows) -> Table:
    return Table(
        title="Times by joints",
        header="support | solver | joints | method | variables | rows | median [µs] | 99% [µs] | "
        "to conventional",
        rows=tuple(
            (
                stance,
                solver,
                joints,
                _NAMES[controller],
                r.variables,
                r.rows,
                r.p50_us,
                r.p99_us,
                _ratio(rows, stance, joints, solver) if controller == "reduced" else None,
            )
            for (stance, joints, controller, solver), r in rows.items()
        ),
    )


def _figure(rows: Rows, joints: tuple[int, ...]) -> Figure:
    def paint(canvas: Any) -> None:
        panels = canvas.subplots(1, len(STANCES), sharey=True)
        for panel, stance in zip(panels, STANCES, strict=True):
            for i, solver in enumerate(_SOLVERS):
                shares = [100.0 * _ratio(rows, stance, n, solver) for n in joints]
                panel.semilogy(joints, shares, "--", color=f"C{i}", label=solver)
            if stance == "double":
                quoted = [100.0 * own / full for full, own in _PAPER.values()]
                panel.plot(list(_PAPER), quoted, "k.", label="paper")
            panel.yaxis.set_major_formatter("{x:g}")
            panel.yaxis.set_minor_formatter(lambda _value, _position: "")
            panel.axhline(100.0, color="dimgrey", linewidth=0.8)
            panel.set_title(f"{stance} support", fontweight="normal")
            panel.set_xlabel("joints")
        panels[0].set_ylabel("proposed to conventional [%]")
        panels[0].legend(loc="upper right")

    return draw(
        name="figure-5",
        title="Figure 5: time by joints",
        caption="Median tick of the proposed method as a share of the conventional one's with the "
        "same solver.",
        height=3.6,
        paint=paint,
    )
