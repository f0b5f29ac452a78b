"""The ZMP in the support polygon, from above and over time, and ground forces of the soles."""

from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.pages import COM, EVENT, INK, SUPPORT, ZMP, inline_svg, line_style, plain
from poise.apps.report._plots._sheet import (
    DASHED,
    WIDTH,
    PlotFigure,
    TimeSheet,
    colour_bar,
    legend_beside,
    name_rows,
    stretches,
    time_span,
)
from poise.apps.report._record import RunSignals

_TIME_COLOURS = "cividis"
"""Colour map for time: even in lightness, and made for colour-blind readers."""


def draw_forces(run: RunSignals) -> list[PlotFigure]:
    """Draw the normal force of every sole, their sum, and a bar while each contact is planned."""
    if not run.soles:
        return []
    sheet = TimeSheet(run, [2.0, max(0.22 * len(run.soles), 0.3)])
    force, phases = sheet.axes
    if len(run.soles) > 1:
        total = np.nansum([sole.force for sole in run.soles.values()], axis=0)
        sheet.plot(force, total, color=EVENT, linewidth=0.9, label="sum")
    for i, (name, sole) in enumerate(run.soles.items()):
        sheet.plot(force, sole.force, label=plain(name), **line_style(i))
        bars = stretches(run.time, sole.planned > 0.5, sheet.end)
        phases.broken_barh(bars, (i - 0.32, 0.64), color=line_style(i)["color"], alpha=0.75)
    force.set_ylim(bottom=min(0.0, force.get_ylim()[0]))
    force.set_ylabel("normal force [N]")
    name_rows(phases, [plain(name, 14) for name in run.soles])
    legend_beside(force)
    return [sheet.finish("forces", "Ground forces of the soles")]


def draw_zmp(run: RunSignals) -> list[PlotFigure]:
    """Draw the view from above, and the ZMP over time."""
    return [_from_above(run), _over_time(run)]


def _from_above(run: RunSignals) -> PlotFigure:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    centre, half = _view(run)
    # The two views of a long ground stand one above the other.
    wide = bool(half[0] > 1.8 * half[1])
    figure: Any = Figure(figsize=(WIDTH, _height(half, wide)))
    rows, columns = (2, 1) if wide else (1, 2)
    bottom = 0.6 / figure.get_figheight()
    grid = {"left": 0.08, "right": 0.9, "bottom": bottom, "top": 1.0 - 0.6 * bottom}
    axes = figure.subplots(rows, columns, gridspec_kw={**grid, "hspace": 0.35, "wspace": 0.2})
    norm = Normalize(*time_span(run))
    trails = (("ZMP", run.zmp), ("CoM, seen from above", run.com[:, :2]))
    for ax, (name, trail) in zip(axes, trails, strict=True):
        _draw_polygons(ax, run)
        _draw_trail(ax, run.time, trail, norm)
        ax.set(title=name, xlabel="x, forward [m]", ylabel="y, left [m]", aspect="equal")
        ax.set_xlim(centre[0] - half[0], centre[0] + half[0])
        ax.set_ylim(centre[1] - half[1], centre[1] + half[1])
    colours = ScalarMappable(norm, _TIME_COLOURS)
    colour_bar(figure, colours, (0.925, 0.2, 0.012, 0.6), "time [s]")
    title = "ZMP and CoM in the support polygon, from above"
    svg = inline_svg(figure, "support", title)
    return PlotFigure(name="support", title=title, svg=svg)


def _over_time(run: RunSignals) -> PlotFigure:
    sheet = TimeSheet(run, [1.35, 1.35, 1.15])
    flight = np.full((1, 2), np.nan)
    edges = [time for phase in run.support for time in (phase.start, phase.end)]
    corners = [p.vertices if len(p.vertices) else flight for p in run.support for _ in range(2)]
    for i, name in enumerate(("x", "y")):
        ax = sheet.axes[i]
        bounds = ([min(c[:, i]) for c in corners], [max(c[:, i]) for c in corners])
        ax.fill_between(edges, *bounds, color=SUPPORT, alpha=0.16, linewidth=0, label="support")
        sheet.plot(ax, run.zmp[:, i], color=ZMP, label="ZMP")
        if np.isfinite(run.zmp_reference).any():
            sheet.plot(ax, run.zmp_reference[:, i], label="reference", **DASHED)
            sheet.plot(ax, run.com[:, i], color=COM, label="CoM")
        ax.set_ylabel(f"{name} [m]")
    sheet.plot(sheet.axes[2], run.zmp_margin, color=ZMP, label="margin")
    sheet.axes[2].axhline(0.0, color=INK, linewidth=1.0, label="edge")
    sheet.axes[2].set_ylabel("margin [m]")
    for ax in (sheet.axes[0], sheet.axes[2]):
        legend_beside(ax)
    return sheet.finish("zmp", "ZMP over time")


def _draw_polygons(ax: Any, run: RunSignals) -> None:
    from matplotlib.patches import Polygon

    seen: set[bytes] = set()
    for phase in run.support:
        # The same stance comes back many times while walking on the spot: draw it once.
        key = np.round(phase.vertices, 4).tobytes()
        if len(phase.vertices) < 2 or key in seen:
            continue
        seen.add(key)
        ax.add_patch(Polygon(phase.vertices, facecolor=SUPPORT, alpha=0.07, zorder=0))
        ax.add_patch(Polygon(phase.vertices, fill=False, edgecolor=SUPPORT, lw=0.9, zorder=2))


def _draw_trail(
    ax: Any, time: Float64[np.ndarray, " T"], trail: Float64[np.ndarray, "T 2"], norm: Any
) -> None:
    from matplotlib.collections import LineCollection

    index = np.unique(np.linspace(0, len(time) - 1, min(len(time), 600)).astype(int))
    points, times = trail[index], time[index]
    segments = np.stack([points[:-1], points[1:]], axis=1)
    whole = np.isfinite(segments).all(axis=(1, 2))
    coloured = {"cmap": _TIME_COLOURS, "norm": norm}
    lines = LineCollection(
        list(segments[whole]), linewidths=1.8, capstyle="round", zorder=3, **coloured
    )
    lines.set_array(times[:-1][whole])
    ax.add_collection(lines, autolim=False)
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    if finite.size:
        ends = finite[[0, -1]]
        ax.scatter(*points[ends].T, c=times[ends], s=34, zorder=4, edgecolor="w", **coloured)


def _view(run: RunSignals) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
    """Centre and half-widths [m] of what the view from above must show."""
    corners = [phase.vertices for phase in run.support if len(phase.vertices)]
    everything = np.concatenate([run.zmp, run.com[:, :2], *corners])
    everything = everything[np.isfinite(everything).all(axis=1)]
    if len(everything) == 0:
        return np.zeros(2), np.full(2, 0.5)
    # A fall throws the ZMP far away for a few ticks; they must not shrink everything else.
    low, high = np.percentile(everything, [0.2, 99.8], axis=0)
    if corners:
        soles = np.concatenate(corners)
        first, last = soles.min(axis=0), soles.max(axis=0)
        room = last - first + 0.3
        low, high = np.clip(low, first - room, first), np.clip(high, last, last + room)
    half = np.maximum((high - low) / 2.0 * 1.1, 0.12)
    return (low + high) / 2.0, half


def _height(half: Float64[np.ndarray, "2"], wide: bool) -> float:
    """Height of the figure [in] that leaves little of it empty."""
    if wide:
        panel = 0.82 * WIDTH * half[1] / half[0]
        return float(2.0 * min(max(panel, 1.3), 3.5) + 1.75)
    panel = 0.37 * WIDTH * half[1] / half[0]
    return float(min(max(panel, 2.5), 5.5) + 1.1)
