"""Times the strategies on a problem of the size of a humanoid in double support.

51 variables and 116 rows in four levels that move every tick; run with
`OMP_NUM_THREADS=1 python -m tests.hqp.timing`.
"""

from time import perf_counter

import daqp
import numpy as np

from poise.hqp import HierarchicalProblem, LexicographicSolver
from poise.hqp._cascade import CascadeSolver
from poise.hqp._weighted import WeightedSolver

EQUALITIES = (18, 0, 6, 9)


def fill(problem, base, inside, time, *, conflict):
    """Move every row; in a conflict four task rows want what four limit rows forbid."""
    for view, A, equalities in zip(problem.levels, base, EQUALITIES, strict=True):
        view.A[:] = A * (1.0 + 0.02 * np.sin(time + np.arange(A.shape[1])))
        centre = view.A @ inside
        view.lower[:], view.upper[:] = centre - 1.0, centre + 1.0
        view.lower[:equalities] = view.upper[:equalities] = centre[:equalities]
    if conflict:
        task, limit = problem.level(2), problem.level(1)
        limit.A[:4] = task.A[:4]
        limit.upper[:4] = task.A[:4] @ inside - 0.5
        limit.lower[:4] = limit.upper[:4] - 2.0


def measure(name, solve, ticks, *, conflict):
    """Print the median and the 99th percentile of a call."""
    rng = np.random.default_rng(0)
    problem = HierarchicalProblem.allocate(51, [18, 62, 18, 18])
    base = [rng.standard_normal(view.A.shape) for view in problem.levels]
    root = 0.1 * rng.standard_normal((51, 51))
    problem.H[:] = np.eye(51) + root @ root.T
    start = rng.standard_normal(51)
    spent = []
    for tick in range(ticks):
        inside = start + 0.3 * np.sin(0.01 * tick + np.arange(51))
        fill(problem, base, inside, 0.01 * tick, conflict=conflict)
        before = perf_counter()
        solve(problem)
        spent.append(perf_counter() - before)
    p50, p99 = np.percentile(spent[1:], [50, 99]) * 1e6
    print(
        f"{name:16} {'conflict' if conflict else 'all met':9} p50 {p50:8.0f} us  p99 {p99:8.0f} us"
    )


def bare_daqp():
    """Return DAQP alone on all rows, warm, unchecked."""
    model = daqp.Model()
    ready = False

    def solve(problem):
        nonlocal ready
        data = (problem.H, problem.g, problem.A, problem.upper, problem.lower)
        model.update(*data) if ready else model.setup(*data)
        ready = True
        model.solve()

    return solve


def main():
    measure("daqp alone", bare_daqp(), 1000, conflict=False)
    for conflict in (False, True):
        measure("direct", LexicographicSolver().solve, 500, conflict=conflict)
        for backend in ("osqp", "daqp", "proxqp"):
            solver = CascadeSolver(backend)
            measure(solver.name, solver.solve, 60, conflict=conflict)
        measure("weighted/daqp", WeightedSolver().solve, 60, conflict=conflict)


if __name__ == "__main__":
    main()
