"""20,000 random hierarchies of all kinds.

`python -m tests.hqp.active_set.campaign 20000 daqp quadprog piqp clarabel osqp`: how many problems,
and which backends.

Every answer's optimality conditions are checked, and every problem is given to the cascade, too, on
these backends or on all that are installed: no level may be better met by them than by `direct`.
ProxQP takes minutes for some problems whose levels have units of their own.
"""

import sys
from collections import Counter
from time import perf_counter

import numpy as np

from poise.errors import MissingExtraError
from poise.hqp import ACCURACY, LexicographicSolver
from poise.hqp._cascade import CascadeSolver

from .conditions import worst_violation
from .families import FAMILIES

TOLERANCE = 1e-8
AGREEMENT = 1e-6


def cascades(backends):
    """The cascade on each of these backends that is installed."""
    found = []
    for backend in backends:
        try:
            found.append(CascadeSolver(backend))
        except MissingExtraError as error:
            print(error)
    return found


def examine(family, seeds, solver, others):
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
        lost += [(seed, name) for name in beaten_by(problem, solver.relative_residuals, others)]
    return statuses, silent, lost, changes, spent


def beaten_by(problem, residuals, others):
    """Which methods meet some level better, all levels above it as well as `direct`."""
    return [
        other.name
        for other in others
        if (solution := other.solve(problem)).ok and _beats(solution.relative_residuals, residuals)
    ]


def _beats(theirs, ours):
    for their, our in zip(theirs, ours, strict=True):
        if our > their + AGREEMENT * max(1.0, their):
            return True
        # What it gains below with what it gives up here is no gain; nor is rounding of that.
        if our < their - 1e-10 * max(1.0, their):
            return False
    return False


def main(problems=20_000, *backends):
    """Print one line a family and one for all."""
    solver, others = LexicographicSolver(), cascades(backends or tuple(ACCURACY))
    print("against", ", ".join(other.name for other in others), flush=True)
    total, count = Counter(), -(-int(problems) // len(FAMILIES))
    for family in FAMILIES:
        statuses, silent, lost, changes, spent = examine(family, range(count), solver, others)
        total += statuses
        total["silent"] += len(silent)
        total["lost"] += len(lost)
        print(
            f"{family.__name__:18} {dict(statuses)} silent {silent[:5]} lost {lost[:5]} "
            f"changes {np.percentile(changes, [50, 99, 100])} "
            f"p50 {np.median(spent) * 1e6:.0f} us",
            flush=True,
        )
    print(dict(total))


if __name__ == "__main__":
    main(*sys.argv[1:])
