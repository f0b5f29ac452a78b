"""Results of `bench bias` as a table for a terminal."""

from collections.abc import Sequence

from benchmarks.bias import BiasResult

_HEADS = ("mean", "std", "p50", "p99", "max", "x original", "FLOP")


def format_bias_table(results: Sequence[BiasResult]) -> str:
    """One line a formula; times in microseconds.

    Args:
        results: of one benchmark.
    """
    first = results[0]
    width = max(len(r.formula) for r in results)
    lines = [
        f"{first.robot}, {first.joints} joints, {first.tasks} tasks: all bias accelerations of a "
        f"tick; {first.ticks} ticks, times in us",
        "  ".join([" " * width, *(f"{head:>10}" for head in _HEADS)]),
    ]
    for r in results:
        times = (r.mean_us, r.std_us, r.p50_us, r.p99_us, r.max_us)
        cells = [*(f"{t:.2f}" for t in times), f"{r.ratio_to_original:.3f}", str(r.flops)]
        lines.append("  ".join([f"{r.formula:{width}}", *(f"{cell:>10}" for cell in cells)]))
    return "\n".join(lines)
