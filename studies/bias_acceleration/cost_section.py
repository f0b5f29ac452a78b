"""Operations by the paper's formulas beside the numbers that it quotes: Table 1, Figures 1 to 3."""

from collections.abc import Generator
from fractions import Fraction
from functools import partial
from math import floor
from typing import Any

from benchmarks.drawing import PALETTE
from studies.bias_acceleration import cost_model as cost
from studies.bias_acceleration.cost_model import (
    FIGURE_2,
    QUOTED,
    SWEEPS,
    Formula,
    Quoted,
    Size,
    Sweep,
    plain,
)
from studies.finding import Figure, Finding, Section, Table, draw, number_text, one_legend
from studies.plan import Progress, StudyOptions

_LARGE_SHARE = 5.0
"""[%] "2-4%" at the paper's own steps means below this."""


def cost_findings() -> tuple[Finding, ...]:
    """All findings of Table 1, eqs (42) to (46) and Figures 1 to 3."""
    quoted = [finding for case in QUOTED for finding in _quoted(case)]
    return (*quoted, *_figure_2(), *_misprints(), *_sums(), *_claims(), _shared())


def _quoted(case: Quoted) -> list[Finding]:
    n, k, m = case.size
    at = f"(n = {n}, k = {k}, m = {m})"
    original, total = cost.bias_original(n, k, m), cost.osf_original(n, k, m)
    proposed, saved = cost.bias_proposed(n, k, m), total - cost.osf_proposed(n, k, m)
    return [
        _count(f"original bias acceleration {at}", case.bias_original, original, "eq (43)"),
        _count(f"OSF with the original formula {at}", case.osf_original, total, "(42) + (43)"),
        _percent(f"original bias acceleration in OSF {at}", case.share, original / total),
        _count(f"proposed bias acceleration {at}", case.bias_proposed, proposed, "eq (45)"),
        _percent(f"proposed to original bias acceleration {at}", case.ratio, proposed / original),
        _percent(f"OSF saved by the proposed formula {at}", case.saved, saved / total),
    ]


def _figure_2() -> list[Finding]:
    at = "(n = {}, k = {}, m = {})".format(*FIGURE_2)
    parts = [cost.row_cost(row.original, *FIGURE_2) for row in cost.TABLE_1]
    inertia, forces, preceding = parts[0] + parts[1], parts[3], parts[4]
    whole = cost.bias_original(*FIGURE_2)
    unneeded = inertia + forces
    rows = "rows of Table 1"
    return [
        _count(f"Figure 2: Λ⁻¹, Λ and μ + p {at}", 33_534, unneeded, rows),
        _percent(f"Figure 2: Λ⁻¹, Λ and μ + p in the original {at}", 65.5, unneeded / whole),
        _count(f"Figure 2: J M⁻¹ Σ Γ {at}", 16_461, preceding, rows),
        _percent(f"Figure 2: J M⁻¹ Σ Γ in the original {at}", 32.2, preceding / whole),
    ]


def _misprints() -> list[Finding]:
    findings: list[Finding] = []
    for case in QUOTED:
        n, k, m = case.size
        printed, corrected = cost.osf_original_as_printed(n, k, m), cost.osf_original(n, k, m)
        summed = cost.osf_without_bias(n, k, m) + cost.bias_original(n, k, m)
        findings.append(
            Finding(
                name=f"(44) corrected (n = {n}, k = {k}, m = {m})",
                paper=case.osf_original,
                ours=plain(corrected),
                unit="FLOP",
                ok=corrected == summed and _rounded(corrected) == case.osf_original,
                note="A misprint: with (11k − 5) m the formula is the sum of (42) and (43) and "
                "gives the total that the text quotes; as printed, with (11k + 5) m, it gives "
                f"{number_text(plain(printed))}, which is {number_text(plain(printed - summed))} "
                "= 10 m n too many.",
            )
        )
    return findings


def _sums() -> list[Finding]:
    n, k, m = FIGURE_2
    pairs: dict[str, tuple[Formula, Formula]] = {
        "original column of Table 1 and (43)": (
            lambda *s: _column("original", s),
            cost.bias_original,
        ),
        "proposed column of Table 1 and (45)": (
            lambda *s: _column("proposed", s),
            cost.bias_proposed,
        ),
        "(42) + (45) and (46) as printed": (
            lambda *s: cost.osf_without_bias(*s) + cost.bias_proposed(*s),
            cost.osf_proposed,
        ),
    }
    findings: list[Finding] = []
    for name, (summed, printed) in pairs.items():
        always = all(summed(*s) == printed(*s) for s in _all_sizes())
        findings.append(
            Finding(
                name=f"{name} (n = {n}, k = {k}, m = {m})",
                paper=plain(printed(*FIGURE_2)),
                ours=plain(summed(*FIGURE_2)),
                unit="FLOP",
                ok=always,
                note="They add up, at every size of the three sweeps; under “paper” stands the "
                "printed formula's value, under “ours” the sum."
                if always
                else "They do not add up.",
            )
        )
    return findings


def _column(name: str, size: Size) -> Fraction:
    """Sum of a column of Table 1."""
    return sum((cost.row_cost(getattr(row, name), *size) for row in cost.TABLE_1), Fraction(0))


def _claims() -> list[Finding]:
    """What the abstract says in general, over all points of the sweeps."""
    sizes = _all_sizes()
    shares = {s: cost.bias_original(*s) / cost.osf_original(*s) for s in sizes}
    ratios = {s: cost.bias_proposed(*s) / cost.bias_original(*s) for s in sizes}
    saved = {s: 1 - cost.osf_proposed(*s) / cost.osf_original(*s) for s in sizes}
    ends = [100 * ratios[case.size] for case in QUOTED]
    dearest = max(sizes, key=ratios.__getitem__)
    cheap_from = min(n for n, k, m in sizes if (k, m) == (2, 3) and _is_low(ratios, n))
    return [
        _bound(
            "least share of the original formula in OSF, Figure 1",
            30,
            min(shares.values()),
            at_least=True,
            note="“30-50%”: at least 30 to the whole percent",
        ),
        _bound(
            "greatest share of the original formula in OSF, Figure 1",
            50,
            max(shares.values()),
            at_least=False,
            note="“30-50%”: at most 50",
        ),
        _bound(
            "least saving in OSF, Figures 1 and 3",
            30,
            min(saved.values()),
            at_least=True,
            tens=True,
            note="“a 30-50% reduction”: it holds to the nearest ten; the paper itself quotes 29.2",
        ),
        Finding(
            name="greatest ratio of proposed to original at the quoted sizes",
            paper=4,
            ours=float(max(ends)),
            unit="%",
            ok=_rounded(min(ends)) >= 2 and _rounded(max(ends)) <= 4,
            note="“needs 2-4% computations of the original”: it holds, to the whole percent, at "
            "the three sizes that the text quotes.",
        ),
        Finding(
            name="greatest ratio of proposed to original over all sizes, Figure 3",
            ours=float(100 * ratios[dearest]),
            unit="%",
            ok=ratios[dearest] < 1,
            note="Holds: the proposed formula is the cheaper one at every size. But “2-4%” is for "
            f"robots with many joints: the ratio is highest at n = {dearest[0]}, k = {dearest[1]}, "
            f"m = {dearest[2]}, and below {_LARGE_SHARE:g}% only from n = {cheap_from} on "
            "(k = 2, m = 3).",
        ),
    ]


def _shared() -> Finding:
    n, k, m = FIGURE_2
    shared, proposed = cost.bias_original_shared(n, k, m), cost.bias_proposed(n, k, m)
    return Finding(
        name=f"original bias acceleration with J M⁻¹ computed once (n = {n}, k = {k}, m = {m})",
        ours=plain(shared),
        unit="FLOP",
        ok=all(cost.bias_proposed(*s) < cost.bias_original_shared(*s) for s in _all_sizes()),
        note="Holds: the proposed formula stays cheaper at every size. But Table 1, as we "
        "read its sums, charges Jᵢ M⁻¹ in three rows; an implementation that keeps it needs "
        f"{number_text(float(100 * shared / cost.bias_original(n, k, m)))}% of the original's "
        f"{number_text(plain(cost.bias_original(n, k, m)))}, and the proposed formula is "
        f"{number_text(float(100 * proposed / shared))}% of that.",
    )


def _is_low(ratios: dict[Size, Fraction], n: int) -> bool:
    return 100 * ratios[n, 2, 3] < _LARGE_SHARE


def _all_sizes() -> list[Size]:
    return list(dict.fromkeys(size for sweep in SWEEPS for size in sweep.sizes))


def _count(name: str, paper: int, ours: Fraction, source: str) -> Finding:
    exact = ours.denominator == 1
    whole, rest = divmod(ours, 1)
    remark = "" if exact else f"; exactly {whole:,} {rest}, which the paper rounds"
    return Finding(
        name=name,
        paper=paper,
        ours=plain(ours),
        unit="FLOP",
        ok=_rounded(ours) == paper,
        note=f"The quoted number, from {source}{remark}.",
    )


def _percent(name: str, paper: float, ours: Fraction) -> Finding:
    percent = 100 * ours
    return Finding(
        name=name,
        paper=paper,
        ours=float(percent),
        unit="%",
        ok=_rounded(10 * percent) == round(10 * paper),
        note="The quoted percentage, to the tenth.",
    )


def _bound(
    name: str, paper: int, ours: Fraction, *, at_least: bool, note: str, tens: bool = False
) -> Finding:
    percent = 100 * ours
    coarse = 10 * _rounded(percent / 10) if tens else _rounded(percent)
    return Finding(
        name=name,
        paper=paper,
        ours=float(percent),
        unit="%",
        ok=coarse >= paper if at_least else coarse <= paper,
        note=note + ".",
    )


def _rounded(value: Fraction) -> int:
    """To the nearest whole number, halves upwards: the way one rounds by hand."""
    return floor(value + Fraction(1, 2))


_BLUE, _RED, _GREEN = PALETTE[0], PALETTE[1], PALETTE[2]
_GREY, _LIGHT, _YELLOW = "#9AA5B1", PALETTE[5], PALETTE[4]

Curve = tuple[str, Formula, str, str]
"""Label, cost, colour and marker of a curve."""

_OSF: Curve = ("whole OSF with the original formula", cost.osf_original, _BLUE, "o")
_ORIGINAL: Curve = ("original bias acceleration", cost.bias_original, _RED, "D")
_PROPOSED: Curve = ("proposed bias acceleration", cost.bias_proposed, _GREEN, "s")


def _figures() -> Generator[Figure]:
    yield draw(
        "figure-1",
        "Figure 1: what the original bias acceleration costs within the formulation",
        "Operations of one control tick as the robot gets more joints, as it gets more tasks, and "
        "as the tasks get more rows. Numbers at the right end are those that the paper quotes.",
        4.1,
        partial(_paint_sweeps, curves=(_OSF, _ORIGINAL)),
    )
    n, k, m = FIGURE_2
    yield draw(
        "figure-2",
        "Figure 2: where the operations go",
        f"A robot with n = {n} degrees of freedom and k = {k} tasks of m = {m} rows. The proposed "
        "formula has only the grey step in common with the original one; it is drawn a second "
        "time below, enlarged.",
        3.9,
        _paint_steps,
    )
    yield draw(
        "figure-3",
        "Figure 3: the bias acceleration by the original and by the proposed formula",
        "The same sweeps as in Figure 1, on a scale of their own: the proposed formula grows with "
        "n, not with its square, and with m, not with its cube.",
        4.1,
        partial(_paint_sweeps, curves=(_ORIGINAL, _PROPOSED)),
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
    one_legend(canvas, panels[0])


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
    original, proposed = (
        [
            float(sum(cost.row_cost(getattr(cost.TABLE_1[i], column), *FIGURE_2) for i in rows))
            for _, rows, _ in _STEPS
        ]
        for column in ("original", "proposed")
    )
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
    for figure in _figures():
        figures.append(figure)
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
            *(
                plain(cost.row_cost(step, n, k, m)) if step else None
                for step in (row.original, row.proposed)
            ),
            row.source,
        )
        for row in cost.TABLE_1
    ]
    sums = plain(cost.bias_original(n, k, m)), plain(cost.bias_proposed(n, k, m))
    return Table(
        title="Table 1, evaluated",
        header="calculation | original [FLOP] | proposed [FLOP] | once costs",
        rows=(*rows, ("sum: (43) and (45)", *sums, "")),
        caption=f"All k − 1 bias accelerations of a robot with n = {n}, k = {k}, m = {m}. The "
        "paper gives the costs; how the original formula comes to them is our reading.",
    )


def _totals() -> Table:
    formulas = (
        cost.osf_without_bias,
        cost.osf_original,
        cost.osf_original_as_printed,
        cost.osf_proposed,
    )
    rows = [
        ("n = {}, k = {}, m = {}".format(*q.size), *(plain(f(*q.size)) for f in formulas))
        for q in QUOTED
    ]
    return Table(
        title="The whole formulation",
        header="size | without bias, (42) [FLOP] | original, (44) corrected [FLOP] | "
        "(44) as printed [FLOP] | proposed, (46) [FLOP]",
        rows=tuple(rows),
        caption="Whole numbers where the thirds add up to them, rounded elsewhere.",
    )
