"""One call from levels to a solution, for tests that state small problems."""

from poise.hqp import HierarchicalProblem, LexicographicSolver


def solve(levels, cost=None, warm_start=None, *, damping=0.0, **bounds):
    """Solve levels and a final cost (H, g), with simple bounds and a warm start where given."""
    H, g = (None, None) if cost is None else cost
    problem = HierarchicalProblem(levels, H, g, **bounds)
    solver = LexicographicSolver(damping=damping)
    if warm_start is not None:
        solver.begin_with(problem, warm_start)
    return solver.solve(problem)
