"""Results of `bench_dof` as a table for a terminal."""

from collections.abc import Sequence

from benchmarks.result import PHASES, TickResult
from benchmarks.table import method_name
from benchmarks.targets import speed_targets

_TIMES = ("p50", "p99", "max", "cpu p99", *PHASES)
_HEADS = ("joints", "variables", "rows", *_TIMES, "x whole", "residual", "relaxed")


def format_dof_table(results: Sequence[TickResult]) -> str:
    """A block a stance and method, a line a robot, times in microseconds; then the targets.

    Args:
        results: of `bench_dof`.
    """
    lines: list[str] = []
    for stance in dict.fromkeys(r.contacts for r in results):
        rows = [r for r in results if r.contacts == stance]
        for name in dict.fromkeys(method_name(r) for r in rows):
            own = [r for r in rows if method_name(r) == name]
            lines += ["", f"{name}, {stance} support, stack {own[0].stack!r}, times in us"]
            lines.append("  ".join(f"{head:>9}" for head in _HEADS))
            lines += [_line(row) for row in own]
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


def _line(row: TickResult) -> str:
    cells = [str(row.joints), str(row.variables), str(row.rows)]
    times = (
        row.p50_us,
        row.p99_us,
        row.max_us,
        row.cpu_p99_us,
        *(row.phases_us[p] for p in PHASES),
    )
    cells += ["-" if t is None else f"{t:.0f}" for t in times]
    cells.append("-" if row.ratio_to_whole is None else f"{row.ratio_to_whole:.2f}")
    cells.append("-" if row.residual_max is None else f"{row.residual_max:.0e}")
    # By its own tolerance a cascade on OSQP never meets a level in full.
    known = row.solver == "direct" and row.relaxed_ticks is not None
    cells.append(f"{row.relaxed_ticks}/{row.ticks}" if known else "-")
    line = "  ".join(f"{cell:>9}" for cell in cells)
    return line + (f"  {row.missed_ticks} ticks FAILED" if row.missed_ticks else "")
