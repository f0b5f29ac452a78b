"""The part of the study that counts operations by the paper's formulas: Table 1, Figures 1 to 3.

Figures 1, 2 and 3 of the paper, from the cost model.
"""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from benchmarks.drawing import PALETTE
from studies.bias_acceleration import cost_model as cost
from studies.bias_acceleration.cost_findings import cost_findings, plain
from studies.bias_acceleration.cost_model import FIGURE_2, QUOTED, SWEEPS, Sweep
from studies.figure import Figure, draw
from studies.finding import Section, Table
from studies.plan import Progress, StudyOptions

_BLUE, _RED, _GREEN = PALETTE[0], PALETTE[1], PALETTE[2]
_GREY, _LIGHT, _YELLOW = "#9AA5B1", PALETTE[5], PALETTE[4]

Curve = tuple[str, Callable[[int, int, int], Fraction], str, str]
"""Label, cost, colour and marker of a curve."""

_OSF: Curve = ("whole OSF with the original formula", cost.osf_original, _BLUE, "o")
_ORIGINAL: Curve = ("original bias acceleration", cost.bias_original, _RED, "D")
_PROPOSED: Curve = ("proposed bias acceleration", cost.bias_proposed, _GREEN, "s")


def figure_1() -> Figure:
    """Cost of the whole formulation and of the original bias acceleration within it."""
    return draw(
        name="figure-1",
        title="Figure 1: what the original bias acceleration costs within the formulation",
        caption="Operations of one control tick as the robot gets more joints, as it gets more "
        "tasks, and as the tasks get more rows. Numbers at the right end are those that the paper "
        "quotes.",
        height=4.1,
        paint=lambda canvas: _paint_sweeps(canvas, (_OSF, _ORIGINAL)),
    )


def figure_3() -> Figure:
    """Cost of the bias acceleration by either formula."""
    return draw(
        name="figure-3",
        title="Figure 3: the bias acceleration by the original and by the proposed formula",
        caption="The same sweeps as in Figure 1, on a scale of their own: the proposed formula "
        "grows with n, not with its square, and with m, not with its cube.",
        height=4.1,
        paint=lambda canvas: _paint_sweeps(canvas, (_ORIGINAL, _PROPOSED)),
    )


def figure_2() -> Figure:
    """What each step of either formula costs for one robot."""
    n, k, m = FIGURE_2
    return draw(
        name="figure-2",
        title="Figure 2: where the operations go",
        caption=f"A robot with n = {n} degrees of freedom and k = {k} tasks of m = {m} rows. The "
        "proposed formula has only the grey step in common with the original one; it is drawn "
        "a second time below, enlarged.",
        height=3.9,
        paint=_paint_steps,
    )


def _paint_sweeps(canvas: Any, curves: tuple[Curve, ...]) -> None:
    panels = canvas.subplots(1, len(SWEEPS))
    for panel, sweep, letter in zip(panels, SWEEPS, "abc", strict=True):
        for curve in curves:
            _paint_curve(panel, sweep, curve)
        panel.set_title(f"({letter}) {sweep.fixed}", fontweight="normal")
        panel.set_xlabel(sweep.axis)
        # Room for the number at the end of the highest curve.
        panel.set_ylim(0.0, 1.1 * panel.dataLim.y1)
        panel.margins(x=0.04)
        panel.yaxis.set_major_formatter(_thousands)
    panels[0].set_ylabel("operations in a tick [FLOP]")
    handles, labels = panels[0].get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside upper left", ncols=len(labels))


def _paint_curve(panel: Any, sweep: Sweep, curve: Curve) -> None:
    label, function, colour, marker = curve
    values = [float(function(*size)) for size in sweep.sizes]
    panel.plot(sweep.values, values, color=colour, marker=marker, markersize=4, label=label)
    panel.annotate(
        f"{values[-1]:,.0f}",
        (sweep.values[-1], values[-1]),
        xytext=(0, 6),
        textcoords="offset points",
        ha="right",
        va="bottom",
        color=colour,
        fontweight="bold",
    )


def _thousands(value: float, _position: int = 0) -> str:
    return f"{value:,.0f}"


_STEPS = (
    ("Λ⁻¹ and Λ", (0, 1), _BLUE),
    ("μ + p", (3,), _RED),
    ("J M⁻¹ Σ Γ: by torques of preceding tasks", (4,), _YELLOW),
    ("J Σ J̄ (ẍ ref − J̇ q̇): by accelerations of preceding tasks", (6,), _GREEN),
    ("J̇ q̇: in both", (2,), _GREY),
    ("last step", (5, 7), _LIGHT),
)
"""Steps of Figure 2: name, rows of Table 1, colour."""


_NARROW = 0.03
"""A step with less than this share of its axis has no number on it; the legend has all numbers."""


def _paint_steps(canvas: Any) -> None:
    original = [_step_cost([cost.TABLE_1[row].original for row in rows]) for _, rows, _ in _STEPS]
    proposed = [_step_cost([cost.TABLE_1[row].proposed for row in rows]) for _, rows, _ in _STEPS]
    both, enlarged = canvas.subplots(2, 1, height_ratios=(2.0, 1.0))
    _paint_bar(both, 0, original, sum(original))
    _paint_bar(both, 1, proposed, sum(original))
    _paint_bar(enlarged, 0, proposed, sum(proposed))
    both.set_yticks([0, 1], ["original", "proposed"])
    enlarged.set_yticks([0], ["proposed,\nenlarged"])
    for panel in (both, enlarged):
        panel.invert_yaxis()
        panel.grid(visible=False, axis="y")
        panel.tick_params(axis="y", length=0)
        panel.xaxis.set_major_formatter(_thousands)
        panel.margins(x=0.01)
    enlarged.set_xlabel("operations in a tick [FLOP]")
    bars, _ = both.get_legend_handles_labels()
    labels = [
        f"{name}: {_or_dash(a)} | {_or_dash(b)}"
        for (name, _, _), a, b in zip(_STEPS, original, proposed, strict=True)
    ]
    canvas.legend(
        bars[: len(_STEPS)],
        labels,
        loc="outside right upper",
        title="step: original | proposed [FLOP]",
        alignment="left",
    )


def _step_cost(costs: list[Callable[[int, int], Fraction] | None]) -> float:
    return float(sum(cost.row_cost(one, *FIGURE_2) for one in costs))


def _paint_bar(panel: Any, y: int, widths: list[float], whole: float) -> None:
    """One bar of steps; `whole` is the length of the axis."""
    start = 0.0
    for (name, _, colour), width in zip(_STEPS, widths, strict=True):
        panel.barh(y, width, left=start, height=0.6, color=colour, label=name)
        if width > _NARROW * whole:
            middle = start + width / 2.0
            panel.text(middle, y, _thousands(width), ha="center", va="center", color="white")
        start += width


def _or_dash(value: float) -> str:
    return _thousands(value) if value else "–"


_PROSE = (
    "The paper counts floating point operations (each of the four arithmetic operations is one) "
    "by formulas in n, the degrees of freedom of the robot, k, the number of tasks, and m, the "
    "rows of each task. The formulas are evaluated here exactly, in whole numbers and thirds. "
    "They are a model, not a measurement.",
    "All numbers that the paper quotes come out of (42), (43) and (45). Its (44), their total, is "
    "misprinted: `(11k + 5) m` must read `(11k − 5) m`. The other total, (46), is right as "
    "printed.",
)


def cost_section(_options: StudyOptions, progress: Progress) -> Section:
    """Table 1, eqs (42) to (46) and Figures 1 to 3; the same in the quick version."""
    figures: list[Figure] = []
    for make in (figure_1, figure_2, figure_3):
        figures.append(make())
        progress(float(len(figures)), 3.0)
    return Section(
        prose=_PROSE,
        findings=cost_findings(),
        figures=tuple(figures),
        tables=(_table_1(), _totals()),
    )


def _table_1() -> Table:
    n, k, m = FIGURE_2
    rows = [
        (
            row.name,
            plain(cost.row_cost(row.original, n, k, m)) if row.original else None,
            plain(cost.row_cost(row.proposed, n, k, m)) if row.proposed else None,
            row.source,
        )
        for row in cost.TABLE_1
    ]
    sums = plain(cost.bias_original(n, k, m)), plain(cost.bias_proposed(n, k, m))
    return Table(
        title="Table 1, evaluated",
        header=("calculation", "original [FLOP]", "proposed [FLOP]", "once costs"),
        rows=(*rows, ("sum: (43) and (45)", *sums, "")),
        caption=f"All k − 1 bias accelerations of a robot with n = {n}, k = {k}, m = {m}. The "
        "paper gives the costs; how the original formula comes to them is our reading.",
    )


def _totals() -> Table:
    rows = [
        (
            f"n = {n}, k = {k}, m = {m}",
            plain(cost.osf_without_bias(n, k, m)),
            plain(cost.osf_original(n, k, m)),
            plain(cost.osf_original_as_printed(n, k, m)),
            plain(cost.osf_proposed(n, k, m)),
        )
        for n, k, m in (case.size for case in QUOTED)
    ]
    return Table(
        title="The whole formulation",
        header=(
            "size",
            "without bias, (42) [FLOP]",
            "original, (44) corrected [FLOP]",
            "(44) as printed [FLOP]",
            "proposed, (46) [FLOP]",
        ),
        rows=tuple(rows),
        caption="Whole numbers where the thirds add up to them, rounded elsewhere.",
    )
