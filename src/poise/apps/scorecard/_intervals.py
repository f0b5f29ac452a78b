"""Medians and shares with confidence intervals that assume nothing of the distribution."""

from collections.abc import Sequence
from typing import NamedTuple

CONFIDENCE = 0.95
"""Probability that intervals aim at; few seeds give less, and the interval says how much."""


class Estimate(NamedTuple):
    """A figure, its interval, and the probability that such an interval holds the true figure."""

    value: float
    low: float
    high: float
    confidence: float


def median_of(values: Sequence[float]) -> Estimate:
    """The median, with the interval between two order statistics.

    The r-th smallest and the r-th largest of n values hold the median between them with probability
    1 - 2 P(B < r), B binomial with n and 1/2 (David and Nagaraja, Order Statistics, 2003, 7.1). r
    is the largest for which that is `CONFIDENCE` or more; 1 where none is.
    """
    from scipy.stats import binom  # takes a second, which commands without episodes do without

    found, n = sorted(values), len(values)
    held = {r: max(0.0, 1.0 - 2.0 * float(binom.cdf(r - 1, n, 0.5))) for r in range(1, n // 2 + 1)}
    rank = max((r for r, probability in held.items() if probability >= CONFIDENCE), default=1)
    middle = 0.5 * (found[(n - 1) // 2] + found[n // 2])
    return Estimate(middle, found[rank - 1], found[n - rank], held.get(rank, 0.0))


def share_of(count: int, of: int) -> Estimate:
    """A share, with Wilson's interval (Wilson 1927, J. Am. Stat. Assoc. 22)."""
    from scipy.stats import binomtest

    interval = binomtest(count, of).proportion_ci(CONFIDENCE, method="wilson")
    return Estimate(count / of, float(interval.low), float(interval.high), CONFIDENCE)
