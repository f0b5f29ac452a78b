"""The part of the study that counts operations by the paper's formulas: Table 1, Figures 1 to 3."""

from studies.bias_acceleration import cost_model as cost
from studies.bias_acceleration.cases import FIGURE_2, QUOTED
from studies.bias_acceleration.cost_findings import cost_findings, plain
from studies.bias_acceleration.figures import figure_1, figure_2, figure_3
from studies.figure import Figure
from studies.plan import Progress, StudyOptions
from studies.section import Section, Table

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
