"""Operations by the paper's formulas beside the numbers that it quotes: Table 1, Figures 1 to 3."""

from collections.abc import Callable
from fractions import Fraction
from functools import partial
from math import floor
from typing import Any

from studies.bias_acceleration import cost_model as cost
from studies.bias_acceleration.cost_model import FIGURE_2, QUOTED, SWEEPS, Formula, Size, plain
from studies.finding import Figure, Finding, Section, Table, draw, number_text, one_legend
from studies.plan import Progress, StudyOptions

_LARGE_SHARE = 5.0
""""2-4%" at the paper's own steps means below this [%]."""

_SIZES = list(dict.fromkeys(size for sizes in SWEEPS.values() for size in sizes))


def cost_findings() -> tuple[Finding, ...]:
    """All findings of Table 1, eqs (42) to (46) and Figures 1 to 3."""
    return (*_quoted(), *_figure_2(), *_misprints(), *_sums(), *_claims())


def _words(size: Size) -> str:
    return "(n = {}, k = {}, m = {})".format(*size)


def _rounded(value: Fraction) -> int:
    """To the nearest whole number, halves upwards."""
    return floor(value + Fraction(1, 2))


def _count(name: str, paper: int, ours: Fraction, source: str) -> Finding:
    return Finding(
        name=name,
        paper=paper,
        ours=plain(ours),
        unit="FLOP",
        ok=_rounded(ours) == paper,
        note=f"The quoted number, from {source}.",
    )


def _percent(name: str, paper: float, ours: Fraction) -> Finding:
    return Finding(
        name=name,
        paper=paper,
        ours=float(100 * ours),
        unit="%",
        ok=_rounded(1000 * ours) == round(10 * paper),
        note="The quoted percentage, to the tenth.",
    )


def _quoted() -> list[Finding]:
    findings: list[Finding] = []
    for case in QUOTED:
        at, size = _words(case.size), case.size
        original, total = cost.bias_original(*size), cost.osf_original(*size)
        proposed, saved = cost.bias_proposed(*size), total - cost.osf_proposed(*size)
        findings += [
            _count(f"original bias acceleration {at}", case.bias_original, original, "eq (43)"),
            _count(f"OSF with the original formula {at}", case.osf_original, total, "(42) + (43)"),
            _percent(f"original bias acceleration in OSF {at}", case.share, original / total),
            _count(f"proposed bias acceleration {at}", case.bias_proposed, proposed, "eq (45)"),
            _percent(f"proposed to original bias acceleration {at}", case.ratio,
                     proposed / original),
            _percent(f"OSF saved by the proposed formula {at}", case.saved, saved / total),
        ]  # fmt: skip
    return findings


def _figure_2() -> list[Finding]:
    at, rows = _words(FIGURE_2), "rows of Table 1"
    parts = [cost.row_cost(row.original, *FIGURE_2) for row in cost.TABLE_1]
    unneeded, preceding = parts[0] + parts[1] + parts[3], parts[4]
    whole = cost.bias_original(*FIGURE_2)
    return [
        _count(f"Figure 2: Λ⁻¹, Λ and μ + p {at}", 33_534, unneeded, rows),
        _percent(f"Figure 2: Λ⁻¹, Λ and μ + p in the original {at}", 65.5, unneeded / whole),
        _count(f"Figure 2: J M⁻¹ Σ Γ {at}", 16_461, preceding, rows),
        _percent(f"Figure 2: J M⁻¹ Σ Γ in the original {at}", 32.2, preceding / whole),
    ]


def _misprints() -> list[Finding]:
    findings: list[Finding] = []
    for case in QUOTED:
        printed = cost.osf_original_as_printed(*case.size)
        corrected = cost.osf_original(*case.size)
        summed = cost.osf_without_bias(*case.size) + cost.bias_original(*case.size)
        findings.append(
            Finding(
                name=f"(44) corrected {_words(case.size)}",
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
    def column(name: str) -> Callable[..., Fraction]:
        return lambda *size: sum(
            (cost.row_cost(getattr(row, name), *size) for row in cost.TABLE_1), Fraction(0)
        )

    pairs: dict[str, tuple[Callable[..., Fraction], Formula]] = {
        "original column of Table 1 and (43)": (column("original"), cost.bias_original),
        "proposed column of Table 1 and (45)": (column("proposed"), cost.bias_proposed),
        "(42) + (45) and (46) as printed": (
            lambda *size: cost.osf_without_bias(*size) + cost.bias_proposed(*size),
            cost.osf_proposed,
        ),
    }
    return [
        Finding(
            name=f"{name} {_words(FIGURE_2)}",
            paper=plain(printed(*FIGURE_2)),
            ours=plain(summed(*FIGURE_2)),
            unit="FLOP",
            ok=all(summed(*size) == printed(*size) for size in _SIZES),
            note="Asked: equal at every size of the three sweeps; under “paper” stands the printed "
            "formula's value, under “ours” the sum.",
        )
        for name, (summed, printed) in pairs.items()
    ]


def _claims() -> list[Finding]:
    """The general claims of the abstract, over all points of the sweeps."""
    shares = [cost.bias_original(*s) / cost.osf_original(*s) for s in _SIZES]
    ratios = {s: cost.bias_proposed(*s) / cost.bias_original(*s) for s in _SIZES}
    saved = min(1 - cost.osf_proposed(*s) / cost.osf_original(*s) for s in _SIZES)
    ends = [100 * ratios[case.size] for case in QUOTED]
    dearest = max(_SIZES, key=ratios.__getitem__)
    cheap_from = min(n for n, k, m in SWEEPS["n"] if 100 * ratios[n, k, m] < _LARGE_SHARE)
    claims = (
        ("least share of the original formula in OSF, Figure 1", 30, min(shares),
         _rounded(100 * min(shares)) >= 30, "“30-50%”: at least 30 to the whole percent."),
        ("greatest share of the original formula in OSF, Figure 1", 50, max(shares),
         _rounded(100 * max(shares)) <= 50, "“30-50%”: at most 50."),
        ("least saving in OSF, Figures 1 and 3", 30, saved, 10 * _rounded(10 * saved) >= 30,
         "“a 30-50% reduction”: it holds to the nearest ten; the paper itself quotes 29.2."),
        ("greatest ratio of proposed to original at the quoted sizes", 4, max(ends) / 100,
         _rounded(min(ends)) >= 2 and _rounded(max(ends)) <= 4,
         "“needs 2-4% computations of the original”: to the whole percent, at the three sizes "
         "that the text quotes."),
        ("greatest ratio of proposed to original over all sizes, Figure 3", None, ratios[dearest],
         ratios[dearest] < 1,
         "The proposed formula is the cheaper one at every size. But “2-4%” is for robots with "
         f"many joints: the ratio is highest at {_words(dearest)}, and below {_LARGE_SHARE:g}% "
         f"only from n = {cheap_from} on (k = 2, m = 3)."),
    )  # fmt: skip
    return [
        Finding(name=name, paper=paper, ours=float(100 * ours), unit="%", ok=ok, note=note)
        for name, paper, ours, ok, note in claims
    ]


Curve = tuple[str, Formula, str]
"""Label, cost and colour of a curve."""

_ORIGINAL: Curve = ("original bias acceleration", cost.bias_original, "C1")
_FIGURES: dict[str, tuple[str, tuple[Curve, Curve]]] = {
    "figure-1": (
        "Figure 1: the original bias acceleration within the formulation",
        (("whole OSF with the original formula", cost.osf_original, "C0"), _ORIGINAL),
    ),
    "figure-3": (
        "Figure 3: the bias acceleration by the original and by the proposed formula",
        (_ORIGINAL, ("proposed bias acceleration", cost.bias_proposed, "C2")),
    ),
}


def _figure(name: str) -> Figure:
    title, curves = _FIGURES[name]
    caption = (
        "Operations of one control tick as the robot gets more joints, as it gets more tasks, and "
        "as the tasks get more rows. Numbers at the right end are those that the paper quotes."
    )
    return draw(name, title, caption, 4.1, partial(_paint, curves=curves))


def _paint(canvas: Any, curves: tuple[Curve, ...]) -> None:
    panels = canvas.subplots(1, len(SWEEPS))
    for panel, (letter, sizes) in zip(panels, SWEEPS.items(), strict=True):
        grows = [size["nkm".index(letter)] for size in sizes]
        for label, function, colour in curves:
            values = [float(function(*size)) for size in sizes]
            panel.plot(grows, values, color=colour, marker="o", markersize=4, label=label)
            panel.annotate(
                f"{values[-1]:,.0f}", (grows[-1], values[-1]), xytext=(0, 6), color=colour,
                textcoords="offset points", ha="right", va="bottom", fontweight="bold",
            )  # fmt: skip
        panel.set_xlabel(f"{letter} [-]")
        panel.set_ylim(0.0, 1.1 * panel.dataLim.y1)
    panels[0].set_ylabel("operations in a tick [FLOP]")
    one_legend(canvas, panels[0])


def cost_section(_options: StudyOptions, progress: Progress) -> Section:
    """Table 1, eqs (42) to (46) and Figures 1 to 3; the same in the quick version."""
    figures = tuple(_figure(name) for name in _FIGURES)
    progress(1.0, 1.0)
    return Section(
        prose=(
            "The paper counts floating point operations (each of the four arithmetic operations "
            "is one) by formulas in n, the degrees of freedom of the robot, k, the number of "
            "tasks, and m, the rows of each task. The formulas are evaluated here exactly, in "
            "whole numbers and thirds. They are a model, not a measurement.",
            "All numbers that the paper quotes come out of (42), (43) and (45). Its (44), their "
            "total, is misprinted: `(11k + 5) m` must read `(11k − 5) m`. The other total, (46), "
            "is right as printed.",
        ),
        findings=cost_findings(),
        figures=figures,
        tables=(_table_1(),),
    )


def _table_1() -> Table:
    rows = [
        (
            row.name,
            *(
                plain(cost.row_cost(step, *FIGURE_2)) if step else None
                for step in (row.original, row.proposed)
            ),
            row.source,
        )
        for row in cost.TABLE_1
    ]
    sums = plain(cost.bias_original(*FIGURE_2)), plain(cost.bias_proposed(*FIGURE_2))
    return Table(
        title="Table 1, evaluated",
        header="calculation | original [FLOP] | proposed [FLOP] | once costs",
        rows=(*rows, ("sum: (43) and (45)", *sums, "")),
        caption=f"All k − 1 bias accelerations of a robot with {_words(FIGURE_2)}. The paper "
        "gives the costs; how the original formula comes to them is our reading.",
    )
