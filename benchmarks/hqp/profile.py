"""Performance profiles: how many problems a method solves within a factor of the quickest.

(Dolan and Moré 2002, "Benchmarking optimization software with performance profiles".)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from benchmarks.hqp.race import Lap


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """A step function of one method.

    Attributes:
        method: its name.
        factors: of the quickest method's time, in rising order; each at least 1.
        shares: of all problems that are solved within each of them.
    """

    method: str
    factors: Float64[np.ndarray, " solved"]
    shares: Float64[np.ndarray, " solved"]

    def at(self, factor: float) -> float:
        """Share of all problems solved within a factor of the quickest method's time.

        Args:
            factor: 1 for the share on which this method is the quickest.
        """
        within = int(np.searchsorted(self.factors, factor, side="right"))
        return float(self.shares[within - 1]) if within else 0.0


def profiles_of(laps: Sequence[Lap], start: str) -> list[Profile]:
    """Profiles of all methods over all problems of all sequences.

    Args:
        laps: of a race.
        start: "cold" or "warm".
    """
    own = [lap for lap in laps if lap.start == start]
    sequences = list(dict.fromkeys(lap.sequence for lap in own))
    seconds: dict[str, Float64[np.ndarray, " all"]] = {}
    solved: dict[str, Bool[np.ndarray, " all"]] = {}
    for method in dict.fromkeys(lap.method for lap in own):
        by_sequence = {lap.sequence: lap for lap in own if lap.method == method}
        in_order = [by_sequence[name] for name in sequences]
        seconds[method] = np.concatenate([lap.seconds for lap in in_order])
        solved[method] = np.concatenate([lap.solved for lap in in_order])
    return make_profiles(seconds, solved)


def make_profiles(
    seconds: Mapping[str, Float64[np.ndarray, " all"]],
    solved: Mapping[str, Bool[np.ndarray, " all"]],
) -> list[Profile]:
    """Profiles of methods on the same problems, which weigh the same.

    A problem that nobody solves counts for nobody.

    Args:
        seconds: time of each method on each problem [s].
        solved: whether it solved it; a wrong answer has no time.
    """
    if not seconds:
        return []
    counted = {name: np.where(solved[name], seconds[name], np.inf) for name in seconds}
    quickest = np.min(list(counted.values()), axis=0)
    profiles: list[Profile] = []
    for name, times in counted.items():
        done = np.isfinite(times)
        factors = np.sort(times[done] / quickest[done])
        shares = np.arange(1, len(factors) + 1) / len(times)
        profiles.append(Profile(method=name, factors=factors, shares=shares))
    return profiles
