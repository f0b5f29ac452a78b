"""The effect of each mechanism on falls, from the rows of runs."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from poise.errors import ConfigurationError
from studies.ablation.logistic import RIDGE, Estimate, fit_logistic
from studies.ablation.mechanisms import MECHANISMS
from studies.ablation.runs import TELEOPERATION, WALKING, AblationOutcome, Rows
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions

_FEWEST, _MOST = 0.15, 0.3
"""Part of the runs that should end with a fall: there a run says most beside what it costs."""

_HEADER = (
    "mechanism | acts in runs with it [%] | "
    "runs without it | falls in them [%] | falls in the others [%] | "
    "log odds without it | low | high | change of falls without it [%] | low | high | "
    "large torque steps without it over with it | verdict"
)

_PREVENTS, _CAUSES, _OPEN = "prevents falls", "causes falls", "not shown"


def rows_of(options: StudyOptions) -> Rows:
    """The file of rows: as the command line says, or `rows.jsonl` in the study's folder."""
    return Rows(options.rows or (options.folder or Path()) / "rows.jsonl")


def effects_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    rows = rows_of(options)
    outcomes = [outcome for outcome in rows.read() if not outcome.error]
    if not outcomes:
        raise ConfigurationError(
            "no runs to fit", got=str(rows.path), wanted="rows, which the part `runs` writes"
        )
    groups = {
        leader: [outcome for outcome in outcomes if outcome.trial.leader == leader]
        for leader in (TELEOPERATION, WALKING)
    }
    groups = {leader: group for leader, group in groups.items() if group}
    tables = {leader: _effects(group) for leader, group in groups.items()}
    progress(1.0, 1.0)
    count = sum(len(table) for table in tables.values())
    return Section(
        prose=(
            f"{len(outcomes)} runs. For each leader the log odds of a fall are a sum of an effect "
            "of each mechanism that is switched off, each robot, condition and operator, and the "
            "logarithm of the size of pushes; no interactions. Intervals are 95% Wald intervals; "
            f"a ridge of {RIDGE:g} keeps effects finite. Of {count} intervals about "
            f"{0.05 * count:.0f} leave zero out by chance alone.",
        ),
        findings=(
            *(_fall_rate(leader, group) for leader, group in groups.items()),
            *(
                Finding(
                    name=f"{leader}: mechanisms without which fewer robots fall",
                    ours=(harmful := sum(row[-1] == _CAUSES for row in table)),
                    ok=harmful == 0,
                )
                for leader, table in tables.items()
            ),
        ),
        tables=tuple(
            Table(
                title=f"Effects in {leader}",
                header=_HEADER,
                rows=tuple(table),
                caption="The change is that of the probability of a fall, averaged over all runs.",
            )
            for leader, table in tables.items()
        ),
    )


def _fall_rate(leader: str, group: Sequence[AblationOutcome]) -> Finding:
    rate = sum(outcome.fell for outcome in group) / len(group)
    return Finding(
        name=f"{leader}: runs that end with a fall",
        ours=100.0 * rate,
        unit="%",
        ok=_FEWEST <= rate <= _MOST,
        note=f"asked: {100.0 * _FEWEST:.0f} to {100.0 * _MOST:.0f}%; {len(group)} runs",
    )


def _effects(group: Sequence[AblationOutcome]) -> list[tuple[str | int | float | None, ...]]:
    """A row of the table for each mechanism that these runs switch."""
    names = [m.name for m in MECHANISMS if any(m.name in o.trial.off for o in group)]
    switched = np.array([[name in o.trial.off for name in names] for o in group], float)
    settings = _settings(group)
    fell = np.array([o.fell for o in group], float)
    design = np.hstack([switched, settings, np.ones((len(group), 1))])
    fit = fit_logistic(design, fell)
    steps = np.array([o.torque_steps / max(o.time, 1.0) for o in group])
    table = list[tuple[str | int | float | None, ...]]()
    for column, name in enumerate(names):
        odds, change = fit.log_odds(column), fit.change(column)
        off = switched[:, column] > 0.0
        with_it = float(steps[~off].mean()) if (~off).any() else 0.0
        table.append(
            (
                name,
                _acting(name, group),
                int(off.sum()),
                100.0 * float(fell[off].mean()),
                100.0 * float(fell[~off].mean()) if (~off).any() else None,
                *(odds.value, odds.low, odds.high),
                *(100.0 * x for x in (change.value, change.low, change.high)),
                float(steps[off].mean()) / with_it if with_it > 0.0 else None,
                _verdict(odds),
            )
        )
    return table


def _acting(name: str, group: Sequence[AblationOutcome]) -> float | None:
    """Part of the runs with a mechanism in which it acts [%]."""
    acts = [o.acts[name] > 0 for o in group if name in o.acts]
    return 100.0 * sum(acts) / len(acts) if acts else None


def _settings(group: Sequence[AblationOutcome]) -> np.ndarray:
    """Columns of robot, condition and operator, the first of each left out, and of pushes."""
    columns = [np.log([o.trial.push for o in group])]
    columns[0] = columns[0] - columns[0].mean()
    for attribute in ("robot", "condition", "operator"):
        values = [getattr(o.trial, attribute) for o in group]
        columns += [
            np.array([value == choice for value in values], float)
            for choice in sorted(set(values))[1:]
        ]
    return np.column_stack(columns)


def _verdict(odds: Estimate) -> str:
    if odds.low > 0.0:
        return _PREVENTS
    return _CAUSES if odds.high < 0.0 else _OPEN
