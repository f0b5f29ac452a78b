"""Checks: bounds that a scenario sets on its run, and those of every run."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from poise._schema import LARGEST
from poise.apps.report import Check, RunSignals
from poise.apps.scenarios._metrics import METRICS, Reading
from poise.apps.scenarios._scenario import CheckPlan, Measurement, Scenario
from poise.apps.scenarios._symptoms import LASTING, explain, symptoms_of
from poise.control import PHYSICS_LEVELS, PHYSICS_TOLERANCE, CommandStatus
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import Robot
from poise.stack import ComTask, Stack

_PHYSICS = ("dynamics and torque limits", "contacts and joint limits")


def validate_checks(checks: Sequence[Measurement], stack: Stack, robot: Robot) -> None:
    """Refuse checks on tasks, soles or levels that do not exist."""
    levels = PHYSICS_LEVELS + len(stack.levels)
    tasks = [task.name for _, task in stack.tasks()]
    for check in checks:
        kind = METRICS[check.metric].subject
        known = {"task": tasks, "sole": list(robot.soles)}.get(kind)
        if known is not None and check.subject not in known:
            raise UnknownNameError(
                f"a check names an unknown {kind}", got=check.subject, choices=known
            )
        if kind == "level" and not 1 <= int(check.subject) <= levels:
            raise ConfigurationError(
                "a check names an unknown level", got=check.subject, wanted=f"1 to {levels}"
            )
        if check.metric == "com_error_max" and not any(
            isinstance(task, ComTask) for _, task in stack.tasks()
        ):
            raise ConfigurationError(
                "a check needs a com task in the stack", got=check.metric, choices=tasks
            )


def evaluate_checks(
    scenario: Scenario, run: RunSignals, robot: Robot, fell: bool, ended_early: str
) -> tuple[Check, ...]:
    """Measure everything that must hold of a run."""
    last = len(run.time) - 1
    first = next((i for i, s in enumerate(run.status) if s != CommandStatus.OK.value), None)
    early = bool(ended_early)
    results = [
        _result("robot fell", "fell", Reading(float(fell), last if fell else None), run),
        _result(
            "run ended early", "ended_early", Reading(float(early), last if early else None), run
        ),
        _result("missed ticks", "missed_ticks", Reading(float(missed_ticks(run)), first), run),
    ]
    for level, name in enumerate(_PHYSICS if run.level_names else (), 1):
        plan = CheckPlan(metric="residual_max", at_most=PHYSICS_TOLERANCE, level=level)
        results.append(_measured(plan, run, f"residual of level {level}, {name}"))
    results += [_measured(plan, run, _describe(plan)) for plan in scenario.checks]
    if all(result.ok for result in results):
        return tuple(results)
    symptoms = symptoms_of(run, robot, scenario)

    def explained(result: Check) -> Check:
        if result.ok or result.time is None:
            return result
        # A fall takes its time: its causes come first.
        whole = result.metric in ("fell", "ended_early")
        # Others come a quarter of a second before; one that begins at the moment lasts beyond it.
        begin, end = (-np.inf, 0.0) if whole else (-0.25, LASTING)
        window = (result.time + begin, result.time + end)
        return replace(result, mechanism=explain(symptoms, run.time, *window))

    return tuple(map(explained, results))


def missed_ticks(run: RunSignals) -> int:
    """Ticks that fell back to a safe command, whatever the clock showed."""
    return sum(status != CommandStatus.OK.value for status in run.status)


def measure(plan: Measurement, run: RunSignals) -> Reading:
    """Measure a run, in the metric's unit; NaN where that cannot be done."""
    rows = (run.time >= plan.begin) & (run.time <= plan.end)
    return METRICS[plan.metric].measure(run, plan.subject, plan.axis_index, rows)


def _measured(plan: CheckPlan, run: RunSignals, name: str) -> Check:
    metric = METRICS[plan.metric]
    units = {task.name: task.unit for task in run.tasks}
    unit = units[plan.subject] if metric.subject == "task" else metric.unit
    return _result(name, plan.metric, measure(plan, run), run, plan.relation, plan.bound, unit)


def _result(
    name: str,
    metric: str,
    reading: Reading,
    run: RunSignals,
    relation: Literal["<=", ">="] = "<=",
    bound: float = 0.0,
    unit: str = "",
) -> Check:
    value, row = reading
    holds = value <= bound if relation == "<=" else value >= bound
    return Check(
        name=name,
        metric=metric,
        value=value,
        bound=bound,
        relation=relation,
        unit=unit,
        ok=bool(np.isfinite(value) and holds),
        time=None if row is None else float(run.time[row]),
    )


def _describe(plan: CheckPlan) -> str:
    metric, parts = METRICS[plan.metric], [METRICS[plan.metric].describe]
    if plan.subject:
        parts.append(plan.subject if metric.subject == "level" else f"of {plan.subject!r}")
    if plan.axis is not None:
        parts.append(f"along {plan.axis}")
    if plan.begin > 0.0 or plan.end < LARGEST:
        until = f"{plan.end:g} s" if plan.end < LARGEST else "the end"
        parts.append(f"from {plan.begin:g} s until {until}")
    return " ".join(parts)
