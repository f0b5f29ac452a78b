"""The page's tables: checks, tasks, tick times and events; and the verdict in words."""

from html import escape

from poise.apps.report._plots import number, tick_percentiles, worst_tasks
from poise.apps.report._record import Check, RunView

_RELATIONS = {"<=": "≤", ">=": "≥", "==": "="}


def verdict(record: RunView) -> tuple[str, bool]:
    """How the run ended, in a few words, and whether that is good."""
    failed = [c for c in record.checks if not c.ok]
    if record.fell:
        return "✗ The robot fell", False
    if record.ended_early:
        return "✗ The run ended early", False
    if failed:
        plural = "checks" if len(record.checks) > 1 else "check"
        return f"✗ {len(failed)} of {len(record.checks)} {plural} failed", False
    if not record.checks:
        return "✓ Ran to its end, nothing was checked", True
    if len(record.checks) == 1:
        return "✓ The check holds", True
    return f"✓ All {len(record.checks)} checks hold", True


def checks_html(record: RunView) -> str:
    """Every check with its value, bound, unit and mark; those that failed come first."""
    if not record.checks:
        return ""
    rows = "".join(_check_row(c) for c in sorted(record.checks, key=lambda c: c.ok))
    head = (
        '<tr><th>check</th><th class="number">value</th><th class="number">bound</th>'
        "<th>unit</th><th>worst at</th><th>holds</th></tr>"
    )
    return _section(
        "checks",
        "Checks",
        "What the scenario demanded; the run passes when every line holds. A time takes the replay "
        "and the plots to the worst moment.",
        f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>",
    )


def _check_row(check: Check) -> str:
    mark = ("good", "✓ holds") if check.ok else ("bad", "✗ failed")
    relation = _RELATIONS.get(check.relation, check.relation)
    why = f'<div class="why">{escape(check.mechanism)}</div>' if check.mechanism else ""
    return (
        f'<tr class="{"held" if check.ok else "failed"}"><td>{escape(check.name)}{why}</td>'
        f'<td class="number">{number(check.value)}</td>'
        f'<td class="number">{relation} {number(check.bound)}</td>'
        f"<td>{escape(check.unit) or '–'}</td><td>{_moment(check)}</td>"
        f'<td class="mark {mark[0]}">{mark[1]}</td></tr>'
    )


def _moment(check: Check) -> str:
    """A button that takes the page's clock to the worst moment of a check."""
    if check.time is None:
        return "–"
    return f'<button class="moment" data-time="{check.time:.4f}">{check.time:.2f} s</button>'


def tasks_html(record: RunView) -> str:
    """Each task with its level and its largest error."""
    if not record.tasks:
        return ""
    rows = "".join(
        f'<tr><td>{escape(task.name)}</td><td class="number">{task.level + 1}</td>'
        f'<td class="number">{escape(worst)}</td></tr>'
        for task, (_, worst) in zip(record.tasks, worst_tasks(record), strict=True)
    )
    head = (
        '<tr><th>task</th><th class="number">level</th><th class="number">largest error</th></tr>'
    )
    table = f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>"
    return _folded("tasks", f"The {len(record.tasks)} tasks in figures", table)


def ticks_html(record: RunView) -> str:
    """Percentiles of the tick times by phase."""
    rows = "".join(
        f"<tr><td>{escape(name)}</td>"
        + "".join(f'<td class="number">{number(v)}</td>' for v in values)
        + "</tr>"
        for name, *values in tick_percentiles(record)
    )
    if not rows:
        return ""
    columns = "".join(f'<th class="number">{c} [µs]</th>' for c in ("p50", "p99", "max"))
    table = f"<table><thead><tr><th>phase</th>{columns}</tr></thead><tbody>{rows}</tbody></table>"
    return _folded("tick-table", "Tick times in figures", table)


def events_html(record: RunView) -> str:
    """Every event, also those whose labels found no room in the plots."""
    if not record.events:
        return ""
    rows = "".join(
        f'<tr><td class="number">{event.time:.3f}</td><td class="number">'
        f"{number(event.duration) if event.duration else '–'}</td>"
        f"<td>{escape(event.label)}</td></tr>"
        for event in sorted(record.events, key=lambda e: e.time)
    )
    head = (
        '<tr><th class="number">time [s]</th><th class="number">duration [s]</th>'
        "<th>what happened</th></tr>"
    )
    table = f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>"
    return _folded("events", f"All {len(record.events)} events", table)


def _section(name: str, title: str, how: str, content: str) -> str:
    return f'<section id="{name}"><h2>{title}</h2><p class="how">{how}</p>{content}</section>'


def _folded(name: str, title: str, content: str) -> str:
    return f'<section id="{name}"><details><summary>{title}</summary>{content}</details></section>'
