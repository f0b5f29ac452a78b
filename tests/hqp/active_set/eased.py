"""What damping does to the shipped problems: how many it eases, how they end, what is lost above.

`python -m tests.hqp.active_set.eased`; all levels but the first two are damped, every solve is
cold.
"""

from collections import Counter
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.hqp import load_sequence
from poise.hqp import LexicographicSolver

PROBLEMS = Path(__file__).parents[3] / "problems"
DAMPINGS = (1e-3, 1e-2, 1e-1)
EXACT_LEVELS = 2
REPEATS = 5


def quickest(solver, problem):
    """Least time of some cold solves."""
    spent = []
    for _ in range(REPEATS):
        solver.reset()
        begin = perf_counter()
        solver.run(problem)
        spent.append(perf_counter() - begin)
    return min(spent)


def main():
    """Print one line a damping."""
    problems = [p for path in sorted(PROBLEMS.glob("*.npz")) for p in load_sequence(path).problems]
    exact = LexicographicSolver()
    for damping in DAMPINGS:
        ends, lost, costs = Counter(), {True: [0.0], False: [0.0]}, []
        for problem in problems:
            levels = len(problem.levels)
            # The last level is always damped, however few there are.
            first = min(EXACT_LEVELS, levels - 1)
            solver = LexicographicSolver(damping=np.where(np.arange(levels) < first, 0.0, damping))
            time, without = quickest(solver, problem), quickest(exact, problem)
            solver.reset()
            ok = solver.run(problem).ok
            eased = np.flatnonzero(solver.eased)
            ends["eased" if len(eased) else "not eased", "ok" if ok else "inaccurate"] += 1
            if len(eased):
                above = slice(0, int(eased[0]))
                worse = solver.relative_residuals[above] - exact.relative_residuals[above]
                lost[ok].append(float(worse.max(initial=0.0)))
            elif solver.changes == exact.changes:
                costs.append(time / without)
        print(
            f"damping {damping:g}: {dict(ends)}, worse above by at most {max(lost[True]):.0e} where"
            f" ok, {max(lost[False]):.0e} where not; where nothing is eased, {np.median(costs):.2f}"
            " times the time"
        )


if __name__ == "__main__":
    main()
