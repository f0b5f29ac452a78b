"""Beyond the paper: accelerations, torques and wrenches of both methods at every tick."""

import numpy as np

from studies.finding import Cell, Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.reduced_dynamics.walk_run import STANCES, walk_run

_EXACT = 1e-6
"""Difference relative to the largest value that counts as one and the same control."""

_KINDS = (("acceleration", "m/s², rad/s²"), ("torque", "N m"), ("wrench", "N, N m"))


def difference_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    run = walk_run(options, progress)
    rows: list[tuple[Cell, ...]] = []
    findings: list[Finding] = []
    for solver in ("direct", "cascade/osqp"):
        for kind, unit in _KINDS:
            full, own = (getattr(run.subjects[c, solver], kind) for c in ("whole_body", "reduced"))
            largest = float(np.nanmax(np.abs(full)))
            ticks = [run.answered(solver, stance) for stance in STANCES]
            gaps = [np.abs(full - own)[tick].max(axis=1) for tick in ticks]
            most = [float(gap.max()) for gap in gaps]
            rows.append((solver, kind, unit, largest, *(float(np.median(g)) for g in gaps), *most))
            if solver == "direct":
                findings.append(
                    Finding(
                        name=f"full and reduced by direct: difference in {kind}",
                        paper=0.0,
                        ours=max(most) / largest,
                        ok=max(most) / largest <= _EXACT,
                        note="“without compromising control performance”; relative to the largest "
                        f"along the walk, {largest:.3g} {unit}",
                    )
                )
    return Section(
        prose=(
            "The paper compares tracking errors. Here both methods answer for the same state, at "
            "every tick of the walk, and the answers are compared. With exact dynamics the "
            "reduction changes nothing: the difference is what a solver left.",
        ),
        findings=tuple(findings),
        tables=(
            Table(
                title="Difference between full and reduced along the walk",
                header="solver | what | unit | largest value | median, double | median, single | "
                "most, double | most, single",
                rows=tuple(rows),
                caption="Of all components at a tick the largest; then median and most over ticks.",
            ),
        ),
    )
