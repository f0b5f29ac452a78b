"""Figure 5: time of a tick by joints, 20 to 45 and on to 60."""

from typing import Any

from benchmarks.dof import JOINTS, DofBench, bench_dof, speed_targets
from benchmarks.drawing import PALETTE, plain_number
from benchmarks.result import TickResult
from studies.finding import Cell, Figure, Finding, Section, Table, draw
from studies.plan import Progress, StudyOptions

_QUICK_JOINTS = (20, 45)
_TICKS, _QUICK_TICKS = 250, 50

_PAPER = {20: (754.0, 571.0), 45: (4081.0, 1319.0)}
"""Mean times of the conventional and the proposed method in double support [us]."""

_SOLVERS = ("cascade/osqp", "direct")
_NAMES = {"whole_body": "conventional", "reduced": "proposed"}

Rows = dict[tuple[str, int, str, str], TickResult]
"""Results by stance, joints, controller and solver."""

_PROSE = (
    "Parametric humanoids with 12 joints in the legs and the others in waist, arms, neck and "
    "hands; each is recorded in motion in MuJoCo, and full and reduced controller take turns on "
    "its states (`python -m benchmarks dof`). The stack is Table 1 with both hands. "
    "The paper shows double "
    "support, 20 to 45 joints, by OSQP.",
    "Arms of few joints cannot serve the pose of a hand in full. Where something has to give on "
    "every tick, both methods search for what, and where limits of the arms are among it the "
    "reduced controller solves the whole problem: the last column says on how many of the ticks "
    "something gave way.",
)


def dof_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    plan = DofBench(
        joints=_QUICK_JOINTS if options.quick else JOINTS,
        ticks=_QUICK_TICKS if options.quick else _TICKS,
        slow_ticks=3 if options.quick else 5,
    )
    results = bench_dof(plan, progress)
    rows = {(r.contacts, r.joints, r.controller, r.solver): r for r in results}
    return Section(
        prose=_PROSE,
        findings=(*_quoted(rows), *_trends(rows, plan)),
        figures=(_figure(rows, plan),),
        tables=(*(_table(rows, plan, stance) for stance in plan.contacts), _targets(results)),
    )


def _quoted(rows: Rows) -> list[Finding]:
    """The two robots of which the paper gives numbers, in double support."""
    findings: list[Finding] = []
    for joints, (full, own) in _PAPER.items():
        ours = _ratio(rows, "double", joints, "cascade/osqp")
        findings.append(
            Finding(
                name=f"Figure 5, {joints} joints, double support, cascade/osqp: decrease",
                paper=100.0 * (1.0 - own / full),
                ours=100.0 * (1.0 - ours),
                unit="%",
                ok=ours <= own / full,
                note=f"{full:.0f} to {own:.0f} µs in the paper",
            )
        )
    return findings


def _trends(rows: Rows, plan: DofBench) -> list[Finding]:
    findings: list[Finding] = []
    small, large = min(plan.joints), max(plan.joints)
    for stance in plan.contacts:
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


def _ratio(rows: Rows, stance: str, joints: int, solver: str) -> float:
    own, full = (rows[stance, joints, c, solver] for c in ("reduced", "whole_body"))
    return own.p50_us / full.p50_us


def _table(rows: Rows, plan: DofBench, stance: str) -> Table:
    lines: list[tuple[Cell, ...]] = []
    for solver in _SOLVERS:
        for n in plan.joints:
            for controller, name in _NAMES.items():
                r = rows[stance, n, controller, solver]
                phases = [r.phases_us[p] for p in ("dynamics", "assembly", "solve", "command")]
                ratio = _ratio(rows, stance, n, solver) if controller == "reduced" else None
                gave = None if r.relaxed_ticks is None else 100.0 * r.relaxed_ticks / r.ticks
                gave = gave if solver == "direct" else None
                lines.append(
                    (solver, n, name, r.variables, r.rows, r.p50_us, r.p99_us, r.max_us,
                     r.cpu_p99_us, *phases, ratio, gave)
                )  # fmt: skip
    return Table(
        title=f"Times by joints, {stance} support",
        header="solver | joints | method | variables | rows | median [µs] | 99% [µs] | max [µs] | "
               "processor, 99% [µs] | dynamics [µs] | assembly [µs] | solve [µs] | command [µs] | "
               "to conventional | something gave way [% of ticks]",
        rows=tuple(lines),
    )  # fmt: skip


def _targets(results: list[TickResult]) -> Table:
    return Table(
        title="Targets for Poise, as ratios",
        header="support | what | ours | should be | met",
        rows=tuple(
            (t.contacts, t.target, t.value, f"{t.relation} {t.bound:g}", "yes" if t.met else "no")
            for t in speed_targets(results)
        ),
        caption="Not the paper's: what Poise's own development asks of the reduced controller.",
    )


def _figure(rows: Rows, plan: DofBench) -> Figure:
    def paint(canvas: Any) -> None:
        panels = canvas.subplots(2, len(plan.contacts), squeeze=False, sharex=True, sharey="row")
        for times, ratios, stance in zip(*panels, plan.contacts, strict=True):
            for solver, colour in zip(_SOLVERS, PALETTE, strict=False):
                for controller, style in (("whole_body", "-"), ("reduced", "--")):
                    medians = [rows[stance, n, controller, solver].p50_us for n in plan.joints]
                    label = f"{_NAMES[controller]}, {solver}"
                    times.semilogy(plan.joints, medians, style, color=colour, label=label)
                shares = [100.0 * _ratio(rows, stance, n, solver) for n in plan.joints]
                ratios.semilogy(plan.joints, shares, "--", color=colour, label=solver)
            if stance == "double":
                quoted = [100.0 * own / full for full, own in _PAPER.values()]
                ratios.plot(list(_PAPER), quoted, "k.", label="paper")
            for panel in (times, ratios):
                panel.yaxis.set_major_formatter(plain_number)
                panel.yaxis.set_minor_formatter(lambda _value, _position: "")
            times.set_title(f"{stance} support", fontweight="normal")
            ratios.axhline(100.0, color="#52606D", linewidth=0.8)
            ratios.set_xlabel("joints")
        panels[0, 0].set_ylabel("tick, median [µs]")
        panels[1, 0].set_ylabel("proposed to conventional [%]")
        panels[0, 0].legend(loc="upper left")
        panels[1, 0].legend(loc="upper right")

    return draw(
        name="figure-5",
        title="Figure 5: time by joints",
        caption="Above the median tick, below the proposed method's as a share of the conventional "
        "one's with the same solver.",
        height=6.4,
        paint=paint,
    )
