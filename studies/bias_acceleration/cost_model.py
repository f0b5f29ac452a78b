"""Eqs (42) to (46) and Table 1 of (Park, Jin, Kang 2022): floating point operations, exactly.

A robot has n degrees of freedom and k tasks of m rows each. Counts are integers and thirds.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import wraps

from poise.errors import ConfigurationError

Count = Fraction
"""A number of floating point operations [FLOP]."""

Formula = Callable[[int, int, int], Count]
"""Operations of n degrees of freedom, k tasks, m rows a task; each a whole number >= 1."""


def _exact(formula: Callable[[Fraction, Fraction, Fraction], Fraction]) -> Formula:
    """The formula, computed in fractions, of sizes that are some."""

    @wraps(formula)
    def of(n: int, k: int, m: int) -> Count:
        for value, what in ((n, "n"), (k, "k"), (m, "m")):
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:  # pyright: ignore[reportUnnecessaryIsInstance]
                raise ConfigurationError(
                    f"{what} of the cost model is out of range",
                    got=value,
                    wanted="a whole number >= 1",
                )
        return formula(Fraction(n), Fraction(k), Fraction(m))

    return of


Step = Callable[[Fraction, Fraction], Fraction]
"""What a step costs once, from n and m."""


@dataclass(frozen=True)
class Row:
    """One row of Table 1: what a calculation costs each of its k - 1 times."""

    name: str  # the calculation, as the table writes it
    original: Step | None  # cost within the original formula (23); None where it has no such step
    proposed: Step | None  # cost within the proposed formula (31); None where there is none
    source: str  # how the cost comes about


def _drift(n: Fraction, m: Fraction) -> Fraction:
    return 4 * m * n - m


TABLE_1 = (
    Row(
        "Λᵢ",
        lambda _n, m: m**3 / 3,
        None,
        "inverse of an m x m positive definite matrix by Cholesky",
    ),
    Row(
        "Λᵢ⁻¹ = Jᵢ M⁻¹ Jᵢᵀ",
        lambda n, m: 2 * m * n**2 + m**2 * n - (m**2 + m) / 2,
        None,
        "Jᵢ M⁻¹: mn(2n − 1); its product with Jᵢᵀ, one triangle only: m(m + 1)/2 (2n − 1)",
    ),
    Row("J̇ᵢ q̇", _drift, _drift, "J̇ᵢ as a difference of Jᵢ: 2mn; times q̇: 2mn − m"),
    Row(
        "μᵢ + pᵢ",
        lambda n, m: 2 * m * n**2 + m * n + 2 * m**2 - m,
        None,
        "Jᵢ M⁻¹: mn(2n − 1); times V + G: 2mn − m; minus J̇ᵢ q̇: m; times Λᵢ: 2m² − m",
    ),
    Row(
        "Jᵢ M⁻¹ Σ Γⱼ",
        lambda n, m: 2 * m * n**2 + m * n - m,
        None,
        "Jᵢ M⁻¹: mn(2n − 1); times the sum: 2mn − m",
    ),
    Row(
        "ẍ bias, original: last step",
        lambda _n, m: 4 * m**2,
        None,
        "two products of m x m with m, two sums",
    ),
    Row(
        "Jᵢ Σ J̄ⱼ|ₚ (ẍⱼ|ₚ,ref − J̇ⱼ|ₚ q̇)",
        None,
        lambda n, m: 4 * m * n + m,
        "two differences: 2m; times J̄: 2mn − n; into the sum: n; times Jᵢ: 2mn − m",
    ),
    Row("ẍ bias, proposed: last step", None, lambda _n, m: 2 * m, "two sums"),
)
"""Table 1, row by row."""


def row_cost(step: Step | None, n: int, k: int, m: int) -> Count:
    """What a step of Table 1 costs in all of its k - 1 times; 0 for one that is not there."""
    if step is None:
        return Fraction(0)
    return _exact(lambda n, k, m: (k - 1) * step(n, m))(n, k, m)


@_exact
def osf_without_bias(n: Fraction, k: Fraction, m: Fraction) -> Fraction:
    """Eq (42): all of the operational space formulation except its bias accelerations."""
    return (
        n**3 / 3
        + ((6 * k - 4) * m + 1) * n**2
        + (3 * k * m**2 + (5 * k + 1) * m - 1) * n
        + k * (m**3 / 3 + 7 * m**2 / 2 - 3 * m / 2)
    )


@_exact
def bias_original(n: Fraction, k: Fraction, m: Fraction) -> Fraction:
    """Eq (43): all k - 1 bias accelerations by the original formula (23)."""
    once = 6 * m * n**2 + (m**2 + 6 * m) * n + m**3 / 3 + 11 * m**2 / 2 - 7 * m / 2
    return (k - 1) * once


@_exact
def osf_original(n: Fraction, k: Fraction, m: Fraction) -> Fraction:
    """Eq (44), corrected: the formulation with the original formula, (42) + (43).

    The paper prints `(11k + 5) m` in the coefficient of n. The sum of (42) and (43) has
    `(5k + 1) m + 6 (k - 1) m = (11k - 5) m` there, and only that gives the totals that its text
    quotes; see `osf_original_as_printed`.
    """
    return _eq_44(n, k, m, (11 * k - 5) * m)


@_exact
def osf_original_as_printed(n: Fraction, k: Fraction, m: Fraction) -> Fraction:
    """Eq (44) letter by letter, misprint included: too large by 10 m n."""
    return _eq_44(n, k, m, (11 * k + 5) * m)


def _eq_44(n: Fraction, k: Fraction, m: Fraction, linear: Fraction) -> Fraction:
    return (
        n**3 / 3
        + ((12 * k - 10) * m + 1) * n**2
        + (3 * k * m**2 + (k - 1) * m**2 + linear - 1) * n
        + (2 * k - 1) * m**3 / 3
        + (9 * k - Fraction(11, 2)) * m**2
        - (5 * k - Fraction(7, 2)) * m
    )


@_exact
def bias_proposed(n: Fraction, k: Fraction, m: Fraction) -> Fraction:
    """Eq (45): all k - 1 bias accelerations by the proposed formula (31)."""
    return 2 * m * (4 * n + 1) * (k - 1)


@_exact
def osf_proposed(n: Fraction, k: Fraction, m: Fraction) -> Fraction:
    """Eq (46): the formulation with the proposed formula; as printed, it is (42) + (45)."""
    return (
        n**3 / 3
        + ((6 * k - 4) * m + 1) * n**2
        + (3 * k * m**2 + (5 * k + 1) * m + 8 * (k - 1) * m - 1) * n
        + k * m**3 / 3
        + 7 * k * m**2 / 2
        + (k / 2 - 2) * m
    )


def plain(value: Fraction) -> int | float:
    """A count as a plain number: whole where it is."""
    return value.numerator if value.denominator == 1 else float(value)


Size = tuple[int, int, int]
"""Degrees of freedom n, number of tasks k, rows of a task m."""


SWEEPS: dict[str, tuple[Size, ...]] = {
    "n": tuple((n, 2, 3) for n in range(6, 51, 2)),
    "k": tuple((30, k, 3) for k in range(2, 11)),
    "m": tuple((30, 2, m) for m in range(2, 16)),
}
"""Panels of Figures 1 and 3, by the letter that grows; the paper does not give its steps."""


@dataclass(frozen=True)
class Quoted:
    """Numbers that the paper's section III.F quotes for one size."""

    size: Size  # n, k, m
    bias_original: int  # operations of the original formula [FLOP]
    osf_original: int  # operations of the formulation with it [FLOP]
    share: float  # of the former in the latter [%]
    bias_proposed: int  # operations of the proposed formula [FLOP]
    ratio: float  # of the proposed formula to the original [%]
    saved: float  # by how much the formulation becomes smaller [%]


QUOTED = (
    Quoted((50, 2, 3), 46_398, 154_937, 29.9, 1_206, 2.6, 29.2),
    Quoted((30, 10, 3), 153_522, 327_642, 46.9, 6_534, 4.3, 44.9),
    Quoted((30, 2, 15), 92_760, 259_860, 35.7, 3_630, 3.9, 34.3),
)
"""One size at the end of each sweep."""

FIGURE_2: Size = (30, 4, 3)
"""The size that Figure 2 takes apart."""
