"""Results as a table for a terminal."""

from collections.abc import Sequence

from benchmarks.result import PHASES, TickResult
from poise.control import CONTROLLERS

_HEADS = (
    "p50", "p99", "max", "cpu p99", *PHASES, "x direct", "x whole", "variables", "rows", "residual",
)  # fmt: skip


def format_table(results: Sequence[TickResult]) -> str:
    """One block a stack, one line a method; times in microseconds.

    Args:
        results: of one benchmark.
    """
    width = max(len(method_name(r)) for r in results)
    lines: list[str] = []
    for stack in dict.fromkeys(r.stack for r in results):
        rows = [r for r in results if r.stack == stack]
        first = rows[0]
        lines += [
            "",
            f"{first.robot}, {first.joints} joints, {first.contacts} support, stack {stack!r}: "
            f"{first.ticks} ticks, times in us",
            "  ".join([" " * width, *(f"{head:>9}" for head in _HEADS)]),
        ]
        lines += [_line(row, width) for row in rows]
    return "\n".join(lines).lstrip("\n")


def _line(row: TickResult, width: int) -> str:
    phases = [row.phases_us[phase] for phase in PHASES]
    cells = [_time(t) for t in (row.p50_us, row.p99_us, row.max_us, row.cpu_p99_us, *phases)]
    cells.append(f"{row.ratio_to_direct:.2f}")
    cells.append("-" if row.ratio_to_whole is None else f"{row.ratio_to_whole:.2f}")
    cells += [str(row.variables), "-" if row.rows is None else str(row.rows)]
    cells.append("-" if row.residual_max is None else f"{row.residual_max:.0e}")
    line = "  ".join([f"{method_name(row):{width}}", *(f"{cell:>9}" for cell in cells)])
    if row.missed_ticks:
        line += f"  {row.missed_ticks} of {row.ticks} ticks FAILED"
    return line


def method_name(row: TickResult) -> str:
    """Which controller, how it solves, and on what schedule it was timed."""
    own = row.controller in CONTROLLERS
    name = f"{row.controller} {row.solver}" if own else row.solver
    return name if row.schedule == "tick" else f"{name}, in batches"


def _time(microseconds: float | None) -> str:
    return "-" if microseconds is None else f"{microseconds:.0f}"
