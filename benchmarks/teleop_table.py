"""Results of `bench tick --controller teleop` as a table for a terminal."""

from collections.abc import Sequence

from benchmarks.teleop import TeleopResult

_HEADS = ("p50", "p99", "max", "% of T", "in sim.", "real time", "by CPU")


def format_teleop_table(results: Sequence[TeleopResult]) -> str:
    """One line a robot; times in microseconds.

    Args:
        results: of one benchmark.
    """
    first = results[0]
    width = max(len(r.robot) for r in results)
    lines = [
        f"step teleoperator, {first.scenario}, T = {first.period_us / 1e3:g} ms; times in us",
        "  ".join([" " * width, *(f"{head:>9}" for head in _HEADS)]),
    ]
    for r in results:
        cells = [
            *(f"{t:.0f}" for t in (r.p50_us, r.p99_us, r.max_us)),
            f"{100.0 * r.share_of_period:.1f}",
            f"{r.simulation_p50_us:.0f}",
            f"x {r.real_time_factor:.1f}",
            f"x {r.real_time_factor_cpu:.1f}",
        ]
        line = "  ".join([f"{r.robot:{width}}", *(f"{cell:>9}" for cell in cells)])
        line += f"  {r.joints} joints, {r.ticks} ticks, {100.0 * r.single_support:.0f}% on one foot"
        if r.missed_ticks:
            line += f", {r.missed_ticks} FAILED"
        lines.append(line)
    return "\n".join(lines)
