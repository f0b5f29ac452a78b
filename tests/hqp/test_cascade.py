"""Parts of the cascade by themselves: the space that levels leave, and how a backend is called."""

import numpy as np
import pytest

from poise.hqp import HierarchicalProblem, Level, SolveStatus
from poise.hqp._backends import QP, SETTINGS, make_backend
from poise.hqp._cascade import CascadeSolver


@pytest.mark.parametrize("backend", sorted(SETTINGS), indirect=True)
def test_a_time_limit_reaches_the_one_backend_that_has_a_name_for_it(backend, monkeypatch):
    import qpsolvers

    solve, given = make_backend(backend), []

    def solve_problem(problem, solver, **settings):
        given.append(settings.get("time_limit"))
        return qpsolvers.Solution(problem)

    monkeypatch.setattr(qpsolvers, "solve_problem", solve_problem)
    qp = QP(P=np.eye(1), q=np.zeros(1), A=np.eye(1), lower=-np.ones(1), upper=np.ones(1))
    for limit in (0.25, 0.0, np.inf):
        solve(qp, limit)
    assert given == ([0.25, 1e-6, None] if backend == "osqp" else [None] * 3)


@pytest.mark.parametrize(
    ("took", "status"), [(2.0, SolveStatus.TIME_LIMIT), (0.1, SolveStatus.INACCURATE)]
)
def test_a_final_cost_that_is_not_solved_is_not_called_optimal(monkeypatch, took, status):
    now = [0.0]
    for module in ("_cold", "_cascade"):
        monkeypatch.setattr(f"poise.hqp.{module}.perf_counter", lambda: now[0])
    solver = CascadeSolver("daqp", time_limit=1.0)
    solve_qp = solver._solve_qp

    def fail_at_the_end(qp, limit):
        if len(qp.lower) > 0:
            return solve_qp(qp, limit)
        now[0] += took
        return None

    solver._solve_qp = fail_at_the_end
    solution = solver.solve(HierarchicalProblem([Level([[1.0, 0.0]], 1.0, 1.0)]))
    assert now[0] >= took
    assert solution.status is status
    np.testing.assert_allclose(solution.x, [1.0, 0.0])


@pytest.mark.parametrize("size", [1e-5, 1e-8, 1e-12])
def test_rows_that_are_short_count_as_long_ones_do(size):
    """As of a task in other units: its slack is below what a backend takes for none."""
    cascade = CascadeSolver()
    first = Level([[size, 0.0]], size, size)
    solution = cascade.solve(HierarchicalProblem([first, Level(np.eye(2), 0.0, 0.0)]))
    assert solution.status is SolveStatus.OPTIMAL
    np.testing.assert_allclose(solution.x, [1.0, 0.0], atol=1e-8)
    # Within a level against each other, too: x is 1 and 2 x is 0.
    targets = [size, 0.0, 1.0]
    mixed = Level([[size, 0.0], [2.0 * size, 0.0], [0.0, 1.0]], targets, targets)
    solution = cascade.solve(HierarchicalProblem([mixed]))
    np.testing.assert_allclose(solution.x, [0.2, 1.0], atol=1e-6)
