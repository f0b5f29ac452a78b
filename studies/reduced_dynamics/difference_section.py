"""Beyond the paper: accelerations, torques and wrenches of both methods at every tick."""

from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from benchmarks.drawing import PALETTE, power_of_ten
from studies.finding import Cell, Figure, Finding, Section, Table, draw
from studies.plan import Progress, StudyOptions
from studies.reduced_dynamics.walk_run import STANCES, WalkRun, walk_run

_EXACT = 1e-6
"""Relative to the largest value: what the paper's claim of one and the same control asks here."""

_KINDS = (("acceleration", "m/s², rad/s²"), ("torque", "N m"), ("wrench", "N, N m"))

_PROSE = (
    "The paper compares tracking errors. Here both methods answer for the same state, at every "
    "tick of the walk, and the answers are compared: generalized accelerations, joint torques, "
    "contact wrenches. With exact dynamics the reduction changes nothing: whatever differs is what "
    "a solver left. A difference is the largest of any component, relative to the largest value of "
    "its kind along the walk.",
)


def difference_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    run = walk_run(options, progress)
    rows: list[tuple[Cell, ...]] = []
    findings: list[Finding] = []
    for solver in ("direct", "cascade/osqp"):
        for kind, unit in _KINDS:
            largest = _largest(run, solver, kind)
            by_stance = {s: _gap(run, solver, kind, run.answered(solver, s)) for s in STANCES}
            worst = max(float(d.max()) for d in by_stance.values())
            typical = [float(np.median(d)) for d in by_stance.values()]
            most = [float(d.max()) for d in by_stance.values()]
            rows.append((solver, kind, unit, largest, *typical, *most))
            if solver == "direct":
                findings.append(
                    Finding(
                        name=f"full and reduced by direct: difference in {kind}",
                        paper=0.0,
                        ours=worst / largest,
                        ok=worst / largest <= _EXACT,
                        note="“without compromising control performance”; relative to the largest "
                        f"along the walk, {largest:.3g} {unit}",
                    )
                )
    return Section(
        prose=_PROSE,
        findings=tuple(findings),
        figures=(_figure(run),),
        tables=(
            Table(
                title="Difference between full and reduced along the walk",
                header="solver | what | unit | largest value | median, double | median, single | "
                       "most, double | most, single",
                rows=tuple(rows),
                caption="Of all components at a tick the largest; then median and most over ticks.",
            ),
        ),
    )  # fmt: skip


def _answers(run: WalkRun, controller: str, solver: str, kind: str) -> Float64[np.ndarray, "T n"]:
    found: Float64[np.ndarray, "T n"] = getattr(run.subjects[controller, solver], kind)
    return found


def _gap(
    run: WalkRun, solver: str, kind: str, ticks: Int64[np.ndarray, " n"]
) -> Float64[np.ndarray, " n"]:
    """Largest difference of a component at each tick."""
    full, own = (_answers(run, c, solver, kind)[ticks] for c in ("whole_body", "reduced"))
    return np.abs(full - own).max(axis=1)


def _largest(run: WalkRun, solver: str, kind: str) -> float:
    return float(np.nanmax(np.abs(_answers(run, "whole_body", solver, kind))))


def _figure(run: WalkRun) -> Figure:
    time = np.array([state.time for state in run.recording.states])

    def paint(canvas: Any) -> None:
        panels = canvas.subplots(1, len(_KINDS))
        for panel, (kind, unit) in zip(panels, _KINDS, strict=True):
            for solver, colour in zip(("cascade/osqp", "direct"), PALETTE, strict=False):
                ticks = np.sort(np.concatenate([run.answered(solver, s) for s in STANCES]))
                gap = np.maximum(_gap(run, solver, kind, ticks), 1e-17)
                panel.semilogy(time[ticks], gap, ".", markersize=2, color=colour, label=solver)
            panel.yaxis.set_major_formatter(power_of_ten)
            panel.set_title(f"{kind} [{unit}]", fontweight="normal")
            panel.set_xlabel("time [s]")
        panels[0].legend(loc="upper left", markerscale=4)

    return draw(
        name="difference",
        title="Difference between full and reduced at every tick",
        caption="Same states, same targets, same solver. What is left with OSQP is its tolerance, "
        "in either method.",
        height=3.6,
        paint=paint,
    )
