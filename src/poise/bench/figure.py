"""Results as a picture: how long a tick takes, and where the time goes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from poise.bench.result import PHASES, TickResult
from poise.report.plots.style import INK, PALETTE, house_style, plain_number

_UNKNOWN = "#CBD2D9"
"""Colour of what a peer does not tell apart."""


def write_figure(results: Sequence[TickResult], path: Path) -> Path:
    """Draws the median tick by phase, with the 99th percentile, one panel a stack.

    The axis is logarithmic in the total; the phases share each bar in proportion.

    Args:
        results: of one benchmark.
        path: file to write; its suffix says the format.

    Returns:
        The path.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    stacks = list(dict.fromkeys(r.stack for r in results))
    tallest = max(sum(r.stack == stack for r in results) for stack in stacks)
    with house_style():
        from matplotlib.figure import Figure

        figure: Any = Figure(
            figsize=(7.2, 0.9 + len(stacks) * (0.9 + 0.32 * tallest)), layout="constrained"
        )
        axes = figure.subplots(len(stacks), 1, squeeze=False, sharex=True)[:, 0]
        for ax, stack in zip(axes, stacks, strict=True):
            _panel(ax, [r for r in results if r.stack == stack])
        axes[-1].set_xlabel("tick from state to command, median [µs]; line to the 99th percentile")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=5)
        figure.savefig(path, facecolor="white", dpi=150)
    return path


def _panel(ax: Any, rows: list[TickResult]) -> None:
    lowest = min(r.p50_us for r in rows) / 4.0
    for y, row in enumerate(rows):
        known = [row.phases_us[phase] for phase in PHASES]
        if any(value is None for value in known):
            _bar(ax, y, lowest, row.p50_us, _UNKNOWN, "not told apart")
        else:
            shares = np.cumsum([0.0, *(value or 0.0 for value in known)])
            edges = lowest * (row.p50_us / lowest) ** (shares / shares[-1])
            for i, phase in enumerate(PHASES):
                label = phase if y == 0 else None
                _bar(ax, y, edges[i], edges[i + 1], PALETTE[i], label)
        ax.plot([row.p50_us, row.p99_us], [y, y], color=INK, linewidth=1.0)
        failed = f"  {row.missed_ticks} failed" if row.missed_ticks else ""
        ratio = f"{row.p50_us:.0f} µs, {row.ratio_to_direct:.2f} × direct{failed}"
        ax.annotate(ratio, (row.p99_us, y), xytext=(5, 0), textcoords="offset points", va="center")
    first = rows[0]
    ax.set_xscale("log")
    ax.set_xlim(lowest, 8.0 * max(r.p99_us for r in rows))
    ax.xaxis.set_major_formatter(plain_number)
    ax.set_yticks(range(len(rows)), [r.solver for r in rows])
    ax.invert_yaxis()
    ax.grid(visible=False, axis="y")
    ax.set_title(
        f"{first.robot}, {first.contacts} support, stack {first.stack}: "
        f"{first.variables} variables, {first.rows} rows"
    )


def _bar(ax: Any, y: int, left: float, right: float, colour: str, label: str | None) -> None:
    ax.barh(y, right - left, left=left, height=0.62, color=colour, label=label)
