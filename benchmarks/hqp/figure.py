"""The race as a picture: performance profiles, cold and warm.

Performance profiles: how many problems a method solves within a factor of the quickest.

(Dolan and Moré 2002, "Benchmarking optimization software with performance profiles".)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from benchmarks.hqp.methods import REFERENCE
from benchmarks.hqp.race import COLD, WARM, Lap
from poise.apps.pages import house_style


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """A step function of one method."""

    method: str  # its name
    # Of the quickest method's time, in rising order; each at least 1
    factors: Float64[np.ndarray, " solved"]
    shares: Float64[np.ndarray, " solved"]  # of all problems that are solved within each of them

    def at(self, factor: float) -> float:
        """Share of all problems solved within a factor of the quickest method's time."""
        within = int(np.searchsorted(self.factors, factor, side="right"))
        return float(self.shares[within - 1]) if within else 0.0


def profiles_of(laps: Sequence[Lap], start: str) -> list[Profile]:
    """Profiles of all methods over all problems of all sequences."""
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
    seconds: Mapping[str, Float64[np.ndarray, " all"]],  # time of each method on each problem [s]
    # Whether it solved it; a wrong answer has no time
    solved: Mapping[str, Bool[np.ndarray, " all"]],
) -> list[Profile]:
    """Profiles of methods on the same problems, which weigh the same.

    A problem that nobody solves counts for nobody.
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


LARGEST_FACTOR = 1024.0
"""Where the axis ends at the latest: what is slower than this is slow."""

_TITLES = {COLD: "cold start", WARM: "warm start, tick after tick"}


def write_profile_figure(laps: Sequence[Lap], path: Path) -> Path:
    """Draws, for a cold and a warm start, how many problems are solved within a factor of the time.

    A line's left end says on how many problems a method is the quickest of those that are right,
    its right end how many it solves at all.
    """
    starts = [start for start in (COLD, WARM) if any(lap.start == start for lap in laps)]
    with house_style():
        from matplotlib.figure import Figure

        figure: Any = Figure(figsize=(9.0, 4.4), layout="constrained")
        panels = figure.subplots(1, len(starts), squeeze=False, sharey=True)[0]
        for ax, start in zip(panels, starts, strict=True):
            profiles = profiles_of(laps, start)
            _draw(ax, profiles)
            count = sum(len(lap.seconds) for lap in laps if _is_reference(lap, start))
            ax.set_title(f"{_TITLES[start]}: {count} solves")
            ax.set_xlabel("time by that of the quickest right answer")
        panels[0].set_ylabel("solved within that factor [%]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, handlelength=3.2)
        figure.savefig(path, facecolor="white", dpi=110)
    return path


def _is_reference(lap: Lap, start: str) -> bool:
    return lap.start == start and lap.method == REFERENCE


def _draw(ax: Any, profiles: Sequence[Profile]) -> None:
    slowest = max((float(one.factors[-1]) for one in profiles if len(one.factors)), default=2.0)
    end = min(max(2.0 * slowest, 4.0), LARGEST_FACTOR)
    for one in profiles:
        # From the first step on; a method that is never right lies on the axis.
        x = [1.0, *one.factors[one.factors <= end].tolist(), end]
        y = [one.at(factor) for factor in x]
        own = one.method == REFERENCE
        style = {"color": "black", "linestyle": "-", "linewidth": 2.6, "zorder": 3} if own else {}
        percent = [100.0 * share for share in y]
        ax.plot(x, percent, drawstyle="steps-post", label=one.method, **style)
    ax.set_xscale("log", base=2)
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_xlim(1.0, end)
    ax.set_ylim(-2.0, 102.0)
