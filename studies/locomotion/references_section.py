"""What random references do to a robot that stands, with and without the balance limit."""

from collections.abc import Sequence

import numpy as np

from studies.finding import Finding, Section, Table
from studies.locomotion.standing_references import (
    ReferenceOutcome,
    ReferenceTrial,
    run_reference_trial,
)
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

ROBOTS = ("humanoid33", "g1")
STRATEGIES = ("direct", "weighted")

_SEEDS, _QUICK_SEEDS = 500, 4
_COMPARED = 100
"""Seeds that are tried without the limit, too."""


def references_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    seeds = options.count(_SEEDS, _QUICK_SEEDS)
    first = options.seed * _SEEDS
    groups = [(robot, strategy, True) for robot in ROBOTS for strategy in STRATEGIES]
    groups += [(robot, "direct", False) for robot in ROBOTS]
    trials = {
        (robot, strategy, limited): [
            ReferenceTrial(robot=robot, seed=first + i, strategy=strategy, limited=limited)
            for i in range(seeds if limited else min(seeds, _COMPARED))
        ]
        for robot, strategy, limited in groups
    }
    every = [trial for group in trials.values() for trial in group]
    outcomes = run_each(run_reference_trial, ReferenceOutcome, every, progress, options)
    found = {group: [outcomes[trial] for trial in trials[group]] for group in groups}
    return Section(
        prose=(
            f"Robots stand for 5 s while {seeds} random references a robot and solver are set, "
            "feasible and absurd: of COM, pelvis, torso and hands some jump or swing by up to half "
            "a metre and 1.5 rad, at up to 3 Hz, from a random moment on. The stack is the default "
            "one; states are estimated, with noise and delay.",
        ),
        findings=tuple(_finding(group, found[group]) for group in groups if group[2]),
        tables=(_table(found),),
    )


def _finding(group: tuple[str, str, bool], outcomes: Sequence[ReferenceOutcome]) -> Finding:
    robot, strategy, _ = group
    fallen = [o for o in outcomes if o.fell]
    note = f"of {len(outcomes)} references"
    if fallen:
        note += ", the first: " + fallen[0].asked
    return Finding(
        name=f"{robot}, {strategy}: falls by random references",
        paper=0,
        ours=len(fallen),
        ok=not fallen,
        note=note,
    )


def _table(found: dict[tuple[str, str, bool], list[ReferenceOutcome]]) -> Table:
    rows: list[tuple[str, ...]] = []
    for (robot, strategy, limited), outcomes in found.items():
        rows.append(
            (
                robot,
                strategy,
                "yes" if limited else "no",
                f"{sum(o.fell for o in outcomes)} of {len(outcomes)}",
                f"{100.0 * float(np.mean([o.held for o in outcomes])):.0f}%",
                f"{max(o.worst_physics for o in outcomes):.1e}",
                f"{float(np.median([o.torque_step for o in outcomes])):.2f}",
            )
        )
    return Table(
        title="Falls",
        header="robot | strategy | limit | falls | held back | level 2 | torque step",
        rows=tuple(rows),
        caption=_CAPTION,
    )


_CAPTION = (
    "Held back: part of the ticks. Level 2: largest residual of contacts and joint limits. Torque "
    "step: largest change of a torque from tick to tick over its limit, median of the runs."
)
