"""Medians and shares with confidence intervals that assume nothing of the distribution."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

CONFIDENCE = 0.95
"""What intervals are to have; few seeds give less, and the interval says how much."""

_NORMAL = 1.959963984540054
"""Quantile of the normal distribution for a confidence of 0.95 on both sides."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A figure with its interval.

    Attributes:
        value: the figure.
        low: lower end of the interval.
        high: upper end.
        confidence: probability that such an interval holds the true figure.
    """

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
    found = sorted(values)
    n = len(found)
    rank, confidence = 1, _between(n, 1)
    while rank + 1 <= n // 2 and _between(n, rank + 1) >= CONFIDENCE:
        rank += 1
        confidence = _between(n, rank)
    middle = 0.5 * (found[(n - 1) // 2] + found[n // 2])
    return Estimate(value=middle, low=found[rank - 1], high=found[n - rank], confidence=confidence)


def share_of(count: int, of: int) -> Estimate:
    """A share, with Wilson's interval (Wilson 1927, J. Am. Stat. Assoc. 22)."""
    share, z2 = count / of, _NORMAL**2
    middle = (share + z2 / (2 * of)) / (1 + z2 / of)
    half = _NORMAL / (1 + z2 / of) * math.sqrt(share * (1 - share) / of + z2 / (4 * of**2))
    low, high = max(0.0, middle - half), min(1.0, middle + half)
    return Estimate(value=share, low=low, high=high, confidence=CONFIDENCE)


def _between(n: int, rank: int) -> float:
    below = sum(math.comb(n, k) for k in range(rank)) / 2**n
    return max(0.0, 1.0 - 2.0 * below)
