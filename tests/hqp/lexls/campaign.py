"""20,000 random hierarchies of all kinds: `python -m tests.hqp.lexls.campaign [PROBLEMS]`.

Every answer's optimality conditions are checked; of every tenth problem, `direct` and the cascade
on DAQP are asked too, and no level may be better met by them than by `lexls`.
"""

import sys
from collections import Counter
from time import perf_counter

import numpy as np

from poise.hqp import CascadeSolver, DirectSolver
from poise.hqp.lexls import LexicographicSolver

from .conditions import worst_violation
from .families import FAMILIES

TOLERANCE = 1e-8
AGREEMENT = 1e-6


def examine(family, seeds, solver):
    """Solve a family cold; return statuses, silent failures, lost levels, changes and times."""
    statuses, silent, lost, changes, spent = Counter(), [], [], [], []
    for seed in seeds:
        problem = family(seed)
        solver.reset()
        begin = perf_counter()
        status = solver.run(problem)
        spent.append(perf_counter() - begin)
        changes.append(solver.changes)
        statuses[status.value] += 1
        if not status.ok:
            continue
        if not worst_violation(problem, solver.x, solver.multipliers) <= TOLERANCE:
            silent.append(seed)
        if seed % 10 == 0 and loses(problem, solver.relative_residuals):
            lost.append(seed)
    return statuses, silent, lost, changes, spent


def loses(problem, residuals):
    """Whether another method meets some level better, all levels above it as well as `lexls`."""
    for other in (DirectSolver(), CascadeSolver("daqp")):
        solution = other.solve(problem)
        if not solution.ok:
            continue
        for ours, theirs in zip(residuals, solution.relative_residuals, strict=True):
            if ours > theirs + AGREEMENT * max(1.0, theirs):
                return True
            # What it gains below with what it gives up here is no gain; nor is rounding of that.
            if ours < theirs - 1e-10 * max(1.0, theirs):
                break
    return False


def main(problems=20_000):
    """Print one line a family and one for all."""
    solver, count = LexicographicSolver(), -(-problems // len(FAMILIES))
    total = Counter()
    for family in FAMILIES:
        statuses, silent, lost, changes, spent = examine(family, range(count), solver)
        total += statuses
        total["silent"] += len(silent)
        print(
            f"{family.__name__:18} {dict(statuses)} silent {silent[:5]} lost {lost[:5]} "
            f"changes {np.percentile(changes, [50, 99, 100])} "
            f"p50 {np.median(spent) * 1e6:.0f} us",
            flush=True,
        )
    print(dict(total))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
