"""Results as a picture: how long a tick takes, and where the time goes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.drawing import INK, PALETTE, plain_number
from benchmarks.result import PHASES, TickResult, method_name
from poise.apps.report import house_style

_BAR = "#9AA5B1"
"""Colour of the whole tick: none of the phases'."""


def write_figure(results: Sequence[TickResult], path: Path) -> Path:
    """Draws, a row a stack, how long each tick takes and how its time is shared by the phases.

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

        height = 1.1 + len(stacks) * (0.6 + 0.36 * tallest)
        figure: Any = Figure(figsize=(9.0, height), layout="constrained")
        panels = figure.subplots(
            len(stacks), 2, squeeze=False, sharex="col", width_ratios=(1.5, 1.0)
        )
        for (times, shares), stack in zip(panels, stacks, strict=True):
            rows = [r for r in results if r.stack == stack]
            _draw_times(times, rows)
            _draw_shares(shares, rows)
        longest = max(r.p99_us for r in results)
        # Room for the words behind the longest line.
        panels[-1, 0].set_xlim(min(r.p50_us for r in results) / 3.0, 12.0 * longest)
        panels[-1, 0].set_xlabel("tick, median [µs]; line to the 99th percentile")
        panels[-1, 1].set_xlabel("share of the tick, medians [%]")
        handles, labels = panels[0, 1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))
        figure.savefig(path, facecolor="white", dpi=150)
    return path


def _draw_times(ax: Any, rows: list[TickResult]) -> None:
    first = rows[0]
    for y, row in enumerate(rows):
        ax.barh(y, row.p50_us, height=0.55, color=_BAR)
        ax.plot([row.p50_us, row.p99_us], [y, y], color=INK, linewidth=1.0)
        words = f"{row.p50_us:.0f} µs, {row.ratio_to_direct:.2f} × direct"
        words += f", {row.missed_ticks} failed" if row.missed_ticks else ""
        ax.annotate(words, (row.p99_us, y), xytext=(5, 0), textcoords="offset points", va="center")
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(plain_number)
    ax.set_yticks(range(len(rows)), [_name(r) for r in rows])
    ax.invert_yaxis()
    ax.grid(visible=False, axis="y")
    ax.set_title(f"{first.robot}, {first.contacts} support, stack {first.stack}")


def _name(row: TickResult) -> str:
    return method_name(row).replace(", ", "\n")


def _draw_shares(ax: Any, rows: list[TickResult]) -> None:
    for y, row in enumerate(rows):
        known = [row.phases_us[phase] or 0.0 for phase in PHASES]
        left = 0.0
        for i, value in enumerate(known):
            share = 100.0 * value / sum(known)
            label = PHASES[i] if y == 0 else None
            ax.barh(y, share, left=left, height=0.55, color=PALETTE[i], label=label)
            left += share
    ax.set_xlim(0.0, 100.0)
    ax.set_yticks([])
    ax.invert_yaxis()
    ax.grid(visible=False)
