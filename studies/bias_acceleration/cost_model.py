"""Eqs (42) to (46) and Table 1 of (Park, Jin, Kang 2022): floating point operations, exactly.

A robot has n degrees of freedom and k tasks of m rows each. Counts are exact: integers and thirds,
no rounding anywhere, because the paper's formulas have thirds of cubes in them.

The robots and tasks for which the paper counts operations, and the numbers that it quotes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from poise.errors import ConfigurationError

Count = Fraction
"""A number of floating point operations [FLOP]."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One row of Table 1: what a calculation costs each of its k - 1 times.

    Attributes:
        name: the calculation, as the table writes it.
        original: cost within the original formula (23), from n and m; None where it has no such
            step.
        proposed: cost within the proposed formula (31), from n and m; None likewise.
        source: how the cost comes about.
    """

    name: str
    original: Callable[[int, int], Count] | None
    proposed: Callable[[int, int], Count] | None
    source: str


def _drift(n: int, m: int) -> Count:
    return Fraction(4 * m * n - m)


TABLE_1 = (
    Row(
        name="Λᵢ",
        original=lambda _n, m: Fraction(m**3, 3),
        proposed=None,
        source="inverse of an m x m positive definite matrix by Cholesky",
    ),
    Row(
        name="Λᵢ⁻¹ = Jᵢ M⁻¹ Jᵢᵀ",
        original=lambda n, m: 2 * m * n**2 + m**2 * n - Fraction(m**2 + m, 2),
        proposed=None,
        source="Jᵢ M⁻¹: mn(2n − 1); its product with Jᵢᵀ, one triangle only: m(m + 1)/2 (2n − 1)",
    ),
    Row(
        name="J̇ᵢ q̇",
        original=_drift,
        proposed=_drift,
        source="J̇ᵢ as a difference of Jᵢ: 2mn; times q̇: 2mn − m",
    ),
    Row(
        name="μᵢ + pᵢ",
        original=lambda n, m: Fraction(2 * m * n**2 + m * n + 2 * m**2 - m),
        proposed=None,
        source="Jᵢ M⁻¹: mn(2n − 1); times V + G: 2mn − m; minus J̇ᵢ q̇: m; times Λᵢ: 2m² − m",
    ),
    Row(
        name="Jᵢ M⁻¹ Σ Γⱼ",
        original=lambda n, m: Fraction(2 * m * n**2 + m * n - m),
        proposed=None,
        source="Jᵢ M⁻¹: mn(2n − 1); times the sum: 2mn − m",
    ),
    Row(
        name="ẍ bias, original: last step",
        original=lambda _n, m: Fraction(4 * m**2),
        proposed=None,
        source="two products of m x m with m, two sums",
    ),
    Row(
        name="Jᵢ Σ J̄ⱼ|ₚ (ẍⱼ|ₚ,ref − J̇ⱼ|ₚ q̇)",
        original=None,
        proposed=lambda n, m: Fraction(4 * m * n + m),
        source="two differences: 2m; times J̄: 2mn − n; into the sum: n; times Jᵢ: 2mn − m",
    ),
    Row(
        name="ẍ bias, proposed: last step",
        original=None,
        proposed=lambda _n, m: Fraction(2 * m),
        source="two sums",
    ),
)
"""Table 1, row by row."""


def osf_without_bias(n: int, k: int, m: int) -> Count:
    """Eq (42): all of the operational space formulation except its bias accelerations.

    Args:
        n: degrees of freedom of the robot.
        k: number of tasks.
        m: rows of each task.

    Raises:
        ConfigurationError: one of them is not a whole number >= 1.
    """
    _check(n, k, m)
    return (
        Fraction(n**3, 3)
        + ((6 * k - 4) * m + 1) * n**2
        + (3 * k * m**2 + (5 * k + 1) * m - 1) * n
        + k * (Fraction(m**3, 3) + Fraction(7 * m**2, 2) - Fraction(3 * m, 2))
    )


def bias_original(n: int, k: int, m: int) -> Count:
    """Eq (43): all k - 1 bias accelerations by the original formula (23).

    Args and errors as for `osf_without_bias`.
    """
    _check(n, k, m)
    return (k - 1) * (
        6 * m * n**2
        + (m**2 + 6 * m) * n
        + Fraction(m**3, 3)
        + Fraction(11 * m**2, 2)
        - Fraction(7 * m, 2)
    )


def bias_original_shared(n: int, k: int, m: int) -> Count:
    """Eq (43) if J_i M^-1, which three rows of Table 1 count anew, is computed once a task.

    Not in the paper: it says how much of the original formula's cost an implementation saves
    without a new formula.

    Args and errors as for `osf_without_bias`.
    """
    return bias_original(n, k, m) - (k - 1) * 2 * (2 * m * n**2 - m * n)


def osf_original(n: int, k: int, m: int) -> Count:
    """Eq (44), corrected: the formulation with the original formula, (42) + (43).

    The paper prints `(11k + 5) m` in the coefficient of n. The sum of (42) and (43) has
    `(5k + 1) m + 6 (k - 1) m = (11k - 5) m` there, and only that gives the totals that its text
    quotes; see `osf_original_as_printed`.

    Args and errors as for `osf_without_bias`.
    """
    return _eq_44(n, k, m, (11 * k - 5) * m)


def osf_original_as_printed(n: int, k: int, m: int) -> Count:
    """Eq (44) letter by letter, misprint included: too large by 10 m n.

    Args and errors as for `osf_without_bias`.
    """
    return _eq_44(n, k, m, (11 * k + 5) * m)


def bias_proposed(n: int, k: int, m: int) -> Count:
    """Eq (45): all k - 1 bias accelerations by the proposed formula (31).

    Args and errors as for `osf_without_bias`.
    """
    _check(n, k, m)
    return Fraction(2 * m * (4 * n + 1) * (k - 1))


def osf_proposed(n: int, k: int, m: int) -> Count:
    """Eq (46): the formulation with the proposed formula; as printed, it is (42) + (45).

    Args and errors as for `osf_without_bias`.
    """
    _check(n, k, m)
    return (
        Fraction(n**3, 3)
        + ((6 * k - 4) * m + 1) * n**2
        + (3 * k * m**2 + (5 * k + 1) * m + 8 * (k - 1) * m - 1) * n
        + Fraction(k * m**3, 3)
        + Fraction(7 * k * m**2, 2)
        + (Fraction(k, 2) - 2) * m
    )


def row_cost(cost: Callable[[int, int], Count] | None, n: int, k: int, m: int) -> Count:
    """What a row of Table 1 costs in all of its k - 1 times; 0 for a step that is not there.

    Args:
        cost: `Row.original` or `Row.proposed`.
        n: degrees of freedom of the robot.
        k: number of tasks.
        m: rows of each task.

    Raises:
        ConfigurationError: n, k or m is not a whole number >= 1.
    """
    _check(n, k, m)
    return Fraction(0) if cost is None else (k - 1) * cost(n, m)


def _eq_44(n: int, k: int, m: int, linear: int) -> Count:
    _check(n, k, m)
    return (
        Fraction(n**3, 3)
        + ((12 * k - 10) * m + 1) * n**2
        + (3 * k * m**2 + (k - 1) * m**2 + linear - 1) * n
        + Fraction((2 * k - 1) * m**3, 3)
        + (9 * k - Fraction(11, 2)) * m**2
        - (5 * k - Fraction(7, 2)) * m
    )


def _check(n: int, k: int, m: int) -> None:
    for value, what in ((n, "n"), (k, "k"), (m, "m")):
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ConfigurationError(
                f"{what} of the cost model is out of range", got=value, wanted="a whole number >= 1"
            )


Size = tuple[int, int, int]
"""Degrees of freedom n, number of tasks k, rows of a task m."""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """One panel of Figures 1 and 3: one of n, k and m grows while the others stay.

    Attributes:
        letter: which of them grows.
        axis: label of the axis.
        fixed: what stays, in words.
        sizes: the points.
    """

    letter: str
    axis: str
    fixed: str
    sizes: tuple[Size, ...]

    @property
    def values(self) -> list[int]:
        """What grows, at each point."""
        return [size["nkm".index(self.letter)] for size in self.sizes]


SWEEPS = (
    Sweep(
        letter="n",
        axis="degrees of freedom of the robot, n [-]",
        fixed="k = 2 tasks of m = 3 rows",
        sizes=tuple((n, 2, 3) for n in range(6, 51, 2)),
    ),
    Sweep(
        letter="k",
        axis="tasks, k [-]",
        fixed="n = 30, tasks of m = 3 rows",
        sizes=tuple((30, k, 3) for k in range(2, 11)),
    ),
    Sweep(
        letter="m",
        axis="rows of a task, m [-]",
        fixed="n = 30, k = 2 tasks",
        sizes=tuple((30, 2, m) for m in range(2, 16)),
    ),
)
"""The paper's sweeps (a), (b), (c); it does not say at which steps it drew them."""


@dataclass(frozen=True, kw_only=True)
class Quoted:
    """What the paper's section III.F quotes for one size.

    Attributes:
        size: n, k, m.
        bias_original: operations of the original formula [FLOP].
        osf_original: operations of the formulation with it [FLOP].
        share: of the former in the latter [%].
        bias_proposed: operations of the proposed formula [FLOP].
        ratio: of the proposed formula to the original [%].
        saved: by how much the formulation becomes smaller [%].
    """

    size: Size
    bias_original: int
    osf_original: int
    share: float
    bias_proposed: int
    ratio: float
    saved: float


QUOTED = (
    Quoted(
        size=(50, 2, 3),
        bias_original=46_398,
        osf_original=154_937,
        share=29.9,
        bias_proposed=1_206,
        ratio=2.6,
        saved=29.2,
    ),
    Quoted(
        size=(30, 10, 3),
        bias_original=153_522,
        osf_original=327_642,
        share=46.9,
        bias_proposed=6_534,
        ratio=4.3,
        saved=44.9,
    ),
    Quoted(
        size=(30, 2, 15),
        bias_original=92_760,
        osf_original=259_860,
        share=35.7,
        bias_proposed=3_630,
        ratio=3.9,
        saved=34.3,
    ),
)
"""One size at the end of each sweep."""

FIGURE_2: Size = (30, 4, 3)
"""The size that Figure 2 takes apart."""
