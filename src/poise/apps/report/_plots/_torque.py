"""Torques over their limits, and the joints that come nearest to their position limits."""

import re
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise.apps.pages import INK, LINE, MUTED, line_style, number, plain
from poise.apps.report._plots._sheet import (
    PlotFigure,
    TimeSheet,
    bucket_max,
    colour_bar,
    legend_beside,
)
from poise.apps.report._record import RunSignals

_LOAD_COLOURS = "YlOrRd"
"""Colour map for loads: pale at rest, darker all the way to the limit."""
_PARTS = (
    ("leg", ("hip", "knee", "ankle", "leg", "thigh", "foot", "toe")),
    ("arm", ("shoulder", "elbow", "wrist", "arm", "hand", "grip", "finger", "thumb")),
    ("head", ("head", "neck", "eye")),
    ("waist", ("waist", "torso", "chest", "spine", "back", "trunk", "lumbar", "abdomen")),
)
_SIDES = (
    ("left", re.compile(r"(^|_|\b)(left|l)(_|\d|\b)|^[lL](?=[A-Z][a-z])|Left", re.ASCII)),
    ("right", re.compile(r"(^|_|\b)(right|r)(_|\d|\b)|^[rR](?=[A-Z][a-z])|Right", re.ASCII)),
)


def grouped_order(names: Sequence[str]) -> tuple[list[int], list[tuple[str, int]]]:
    """Order joints by group; size of each group."""
    of_joint = [guess_group(name) for name in names]
    order: list[int] = []
    counts: list[tuple[str, int]] = []
    for group in dict.fromkeys(of_joint):
        members = [i for i, g in enumerate(of_joint) if g == group]
        order.extend(members)
        counts.append((group, len(members)))
    return order, counts


def guess_group(name: str) -> str:
    """Group of a joint, by words in its name; "other" without a match."""
    lower = name.lower()
    part = next((part for part, words in _PARTS if any(w in lower for w in words)), "other")
    if part in ("leg", "arm"):
        side = next((side for side, pattern in _SIDES if pattern.search(name)), "")
        return f"{side} {part}".strip()
    return part


def short_names(names: Sequence[str]) -> list[str]:
    """Names as labels, without the ending "_joint" where all joints have it."""
    ending = "_joint"
    if all(name.endswith(ending) for name in names):
        names = [name.removesuffix(ending) for name in names]
    return [plain(name, 21) for name in names]


def draw_joints(run: RunSignals) -> list[PlotFigure]:
    """Draw the distance of the six tightest joints to the nearer of their limits."""
    margin = np.minimum(run.position - run.position_min, run.position_max - run.position)
    sheet = TimeSheet(run, [2.1])
    ax = sheet.axes[0]
    names = short_names(run.joint_names)
    least = np.where(np.isfinite(margin), margin, np.inf).min(axis=0)
    for place, i in enumerate(np.argsort(least, kind="stable")[:6]):
        if np.isfinite(least[i]):
            label = names[i]
            sheet.plot(ax, margin[:, i], label=label, **line_style(place))
    ax.axhline(0.0, color=INK, linewidth=1.1, zorder=1)
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -0.03 * (high - low)), high)
    ax.set_ylabel("distance to limit [rad]")
    legend_beside(ax, title="nearest to a limit")
    return [sheet.finish("joints", "Joint positions near their limits")]


def draw_torques(run: RunSignals) -> list[PlotFigure]:
    """Draw a heat map of all joints over time, and the six that come nearest to their limits."""
    ratio = torque_ratio(run)
    sheet = TimeSheet(run, [max(0.155 * len(run.joint_names), 0.6), 2.1])
    _heat_map(sheet, run, np.abs(ratio))
    _highest(sheet, run, ratio)
    return [sheet.finish("torque", "Joint torques over their limits")]


def torque_ratio(run: RunSignals) -> Float64[np.ndarray, "T nj"]:
    """Torque over its limit [-]; NaN for a joint without a limit."""
    limit = np.where(run.torque_max > 0.0, run.torque_max, np.nan)
    limit = np.where(np.isfinite(limit), limit, np.nan)
    return run.torque / limit


def _heat_map(sheet: TimeSheet, run: RunSignals, ratio: Float64[np.ndarray, "T nj"]) -> None:
    ax = sheet.axes[0]
    order, groups = grouped_order(run.joint_names)
    names = short_names(run.joint_names)
    buckets, rows = bucket_max(ratio[:, order])
    end = sheet.start + (sheet.end - sheet.start) * rows / len(ratio)
    place = {"extent": (sheet.start, end, len(order) - 0.5, -0.5), "zorder": 0.5}
    shown = {"cmap": _LOAD_COLOURS, "vmin": 0.0, "vmax": 1.0, "interpolation": "nearest"}
    image = ax.imshow(buckets.T, aspect="auto", **place, **shown)
    ax.set_xlim(sheet.start, sheet.end)
    ax.grid(visible=False)
    ax.set_yticks(range(len(order)), [names[i] for i in order])
    ax.tick_params(axis="y", labelsize=6.8, length=0, pad=2)
    first = 0
    for name, count in groups:
        if first:
            ax.axhline(first - 0.5, color="white", linewidth=2.5)
        middle = first + count / 2.0 - 0.5
        place = {"transform": ax.get_yaxis_transform(), "va": "center", "color": MUTED}
        ax.text(1.01, middle, plain(name), fontsize=8, **place)
        first += count
    box = ax.get_position()
    height = min(box.height, 2.0 / sheet.figure.get_figheight())
    place = (0.945, box.y1 - height, 0.01, height)
    colour_bar(sheet.figure, image, place, "torque / limit [-]")


def _highest(sheet: TimeSheet, run: RunSignals, ratio: Float64[np.ndarray, "T nj"]) -> None:
    ax = sheet.axes[1]
    names = short_names(run.joint_names)
    filled = np.where(np.isfinite(ratio), np.abs(ratio), 0.0).max(axis=0)
    for place, i in enumerate(np.argsort(-filled, kind="stable")[:6]):
        limit = run.torque_max[i]
        label = f"{names[i]} ({number(float(limit))})"
        sheet.plot(ax, ratio[:, i], label=label, **line_style(place))
    for bound in (-1.0, 1.0):
        ax.axhline(bound, color=INK, linewidth=1.1, zorder=1)
    ax.axhline(0.0, color=LINE, linewidth=0.8, zorder=0)
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -1.08), max(high, 1.08))
    ax.set_ylabel("torque / limit [-]", color=INK)
    legend_beside(ax, title="highest (limit [N m])")
