"""Worst time of a warm solve over recorded motion: `python -m tests.hqp.worst [TICKS]`.

A few hundred recorded ticks are replayed until there are as many as asked for, 100,000 by default.
On a core that others use, the largest time is theirs: so the worst of the ticks' own times is
printed beside it, a tick's own time being the least of its replays, and how many ticks take more
than five medians.
"""

import gc
import sys
from time import perf_counter

import numpy as np

from benchmarks.hqp import make_sequence
from poise.hqp import LexicographicSolver

SEQUENCES = (
    "stand-humanoid33",
    "squat-humanoid33",
    "reach-humanoid33",
    "reach-beyond-humanoid33",
    "walk-step-humanoid33",
    "walk-touch-down-humanoid33",
    "push-humanoid33",
    "walk-pushed-landing-humanoid33",
)
RECORDED = 400


def replay(problems, ticks):
    """Return the seconds of every solve, one row a replay; the first replay does not count."""
    solver = LexicographicSolver()
    spent = np.zeros((-(-ticks // len(problems)) + 1, len(problems)))
    for row in spent:
        gc.collect()
        gc.disable()
        # The first tick is warmed up by a solve of its own: the last one is none before it.
        solver.run(problems[0])
        for tick, problem in enumerate(problems):
            before = perf_counter()
            solver.run(problem)
            row[tick] = perf_counter() - before
        gc.enable()
    return spent[1:] * 1e6


def main(ticks=100_000):
    """Print one line a sequence."""
    print(
        f"{'':32}{'p50':>7}{'p99':>7}{'p99.99':>8}{'max':>8}  own:{'p50':>6}{'max':>7} ratio over"
    )
    for name in SEQUENCES:
        spent = replay(make_sequence(name, RECORDED).problems, ticks)
        own = spent.min(axis=0)
        print(
            f"{name:32}{np.median(spent):7.0f}{np.percentile(spent, 99):7.0f}"
            f"{np.percentile(spent, 99.99):8.0f}{spent.max():8.0f}"
            f"        {np.median(own):6.0f}{own.max():7.0f}{own.max() / np.median(own):7.1f}"
            f"{np.count_nonzero(own > 5 * np.median(own)):5d} of {len(own)}",
            flush=True,
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
