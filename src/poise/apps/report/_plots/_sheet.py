"""`TimeSheet`: a figure of rows over one time axis, with events on top and legends beside."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from poise.apps.pages import EVENT, REFERENCE, inline_svg, number, plain, power_of_ten
from poise.apps.report._record import Event, RunSignals

WIDTH = 12.0
"""Width of every figure [in]: 1152 px, so that a 9 pt label is 12 px high on the page."""
LEFT, RIGHT, BOTTOM, GAP = 1.25, 2.1, 0.5, 0.34
"""Margins [in], the same in all figures: time runs in line down the page, legends stand right."""
DASHED: dict[str, Any] = {"color": REFERENCE, "linestyle": (0, (4, 2)), "linewidth": 1.0}
"""Lines that others are compared with."""
_EVENT_ROW = 0.165
"""Height of a row of labels of events [in]."""


@dataclass(frozen=True, kw_only=True)
class PlotFigure:
    """A finished plot."""

    name: str  # its id in the page
    title: str  # its heading
    svg: str
    # Boxes (left, right, top, bottom as fractions of the drawing, first and last time [s]) in which
    # a time cursor can be drawn
    time_axes: tuple[tuple[float, ...], ...] = ()


class TimeSheet:
    """Rows of axes over the record's time."""

    def __init__(self, run: RunSignals, heights: Sequence[float]) -> None:
        from matplotlib.figure import Figure

        self._run = run
        self.start, self.end = time_span(run)
        labels = _place_labels(run.events, self.start, self.end, WIDTH - LEFT - RIGHT)
        rows = 1 + max((row for _, row, _ in labels), default=-1)
        top = 0.12 + rows * _EVENT_ROW
        height = top + sum(heights) + GAP * (len(heights) - 1) + BOTTOM
        self.figure: Any = Figure(figsize=(WIDTH, height))
        grid = self.figure.add_gridspec(
            len(heights),
            left=LEFT / WIDTH,
            right=1.0 - RIGHT / WIDTH,
            bottom=BOTTOM / height,
            top=1.0 - top / height,
            height_ratios=heights,
            hspace=GAP * len(heights) / sum(heights),
        )
        self.axes: list[Any] = grid.subplots(sharex=True, squeeze=False)[:, 0].tolist()
        self.axes[0].set_xlim(self.start, self.end)
        self.axes[-1].set_xlabel("time [s]")
        self._draw_events(labels, heights[0])

    def plot(self, ax: Any, values: Float64[np.ndarray, " T"], **style: Any) -> None:
        """Draw a signal of the record, decimated; a single sample becomes a dot."""
        time, kept = decimate(self._run.time, values)
        marker = "o" if len(time) == 1 else None
        ax.plot(time, kept, marker=marker, markersize=4, **style)

    def finish(self, name: str, title: str) -> PlotFigure:
        """Write the figure; nothing may be drawn on it afterwards."""
        boxes: list[tuple[float, ...]] = []
        for ax in self.axes:
            x0, y0, x1, y1 = ax.get_position().extents
            box = (x0, x1, 1.0 - y1, 1.0 - y0, self.start, self.end)
            boxes.append(tuple(round(float(v), 5) for v in box))
        svg = inline_svg(self.figure, name, title)
        return PlotFigure(name=name, title=title, svg=svg, time_axes=tuple(boxes))

    def _draw_events(self, labels: Sequence[tuple[Event, int, str]], first_height: float) -> None:
        for event in self._run.events:
            for ax in self.axes:
                ax.axvline(event.time, color=EVENT, linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
                if event.duration > 0.0:
                    end = event.time + event.duration
                    ax.axvspan(event.time, end, color=EVENT, alpha=0.16, linewidth=0, zorder=0)
        for event, row, side in labels:
            height = 1.0 + (0.05 + row * _EVENT_ROW) / first_height
            place = {"transform": self.axes[0].get_xaxis_transform(), "ha": side, "va": "bottom"}
            words = plain(event.label)
            self.axes[0].text(event.time, height, words, fontsize=8, color=REFERENCE, **place)


def time_span(run: RunSignals) -> tuple[float, float]:
    """First and last time of the plots [s]; half a second about a single sample."""
    start, end = float(run.time[0]), float(run.time[-1])
    return (start, end) if end > start else (start - 0.5, end + 0.5)


def legend_beside(ax: Any, title: str = "") -> None:
    """Put the legend right of the axes, where it covers nothing."""
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        place = {"loc": "upper left", "bbox_to_anchor": (1.015, 1.0), "alignment": "left"}
        legend = ax.legend(handles, labels, title=title or None, title_fontsize=8.5, **place)
        legend.set_in_layout(False)


def colour_bar(figure: Any, colours: Any, place: tuple[float, ...], label: str) -> None:
    """Draw a bar of colours in its own axes."""
    bar = figure.colorbar(colours, cax=figure.add_axes(place))
    bar.set_label(label)
    bar.outline.set_visible(False)


def name_rows(ax: Any, names: list[str]) -> None:
    """Make the values' axis one of rows with names, from the top."""
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.set_yticks(range(len(names)), names)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")


def log_axis(axis: Any, low: float, high: float) -> None:
    """Make an axis logarithmic between two bounds, with plain labels."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    (axis.axes.set_xscale if axis.axis_name == "x" else axis.axes.set_yscale)("log")
    (axis.axes.set_xlim if axis.axis_name == "x" else axis.axes.set_ylim)(low, high)
    # Over few decades there is room for labels at 2 and 5 of each.
    short = high < 300.0 * low
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if short else (1.0,), numticks=8))
    label = number if short else power_of_ten
    axis.set_major_formatter(FuncFormatter(lambda value, _: label(value)))
    axis.set_minor_locator(NullLocator())


def above_zero(
    values: Float64[np.ndarray, "*s"], least: float = 1e-17
) -> Float64[np.ndarray, "*s"]:
    """Values for a logarithmic axis: zero becomes a number below rounding."""
    return np.maximum(np.abs(values), least)


def greatest(values: Float64[np.ndarray, " T"]) -> float:
    """Greatest size of a finite value; zero where there is none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else 0.0


def decimate(
    time: Float64[np.ndarray, " T"], values: Float64[np.ndarray, " T"], buckets: int = 500
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """Keep the least and the greatest value of every bucket, at their own times.

    A bucket with nothing but NaN stays a gap. Short signals come back as they are.
    """
    if len(time) <= 2 * buckets:
        return time, values
    width = -(-len(values) // buckets)
    padded = np.full((-(-len(values) // width), width), np.nan)
    padded.flat[: len(values)] = values
    low = np.argmin(np.where(np.isnan(padded), np.inf, padded), axis=1)
    high = np.argmax(np.where(np.isnan(padded), -np.inf, padded), axis=1)
    starts = np.arange(len(padded)) * width
    index = np.unique(np.minimum(np.concatenate([low + starts, high + starts]), len(time) - 1))
    return time[index], values[index]


def bucket_max(
    values: Float64[np.ndarray, "T n"], buckets: int = 600
) -> tuple[Float64[np.ndarray, "m n"], int]:
    """Greatest value of every bucket of rows, NaN where a bucket holds nothing else."""
    width = -(-len(values) // buckets)
    starts = np.arange(0, len(values), width)
    return np.fmax.reduceat(values, starts, axis=0), len(starts) * width


def stretches(
    time: Float64[np.ndarray, " T"], on: Bool[np.ndarray, " T"], end: float
) -> list[tuple[float, float]]:
    """Start and length of each stretch in which a flag is set [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    times = np.append(time, end)
    return [
        (float(times[a]), float(times[b] - times[a]))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]


def _place_labels(
    events: Sequence[Event], start: float, end: float, width: float
) -> list[tuple[Event, int, str]]:
    """Find a row and a side for each event's label; one that fits nowhere gets none."""
    taken = [-np.inf] * 3
    placed: list[tuple[Event, int, str]] = []
    for event in sorted(events, key=lambda e: e.time):
        if not start <= event.time <= end:
            continue
        x = (event.time - start) / (end - start) * width
        length = 0.072 * len(plain(event.label)) + 0.08
        side = "left" if x + length <= width + RIGHT else "right"
        first = x if side == "left" else x - length
        row = next((row for row, last in enumerate(taken) if first >= last), None)
        if row is not None:
            taken[row] = first + length
            placed.append((event, row, side))
    return placed
