import numpy as np

# %% HierarchicalProblem Level solve Solution
from poise import HierarchicalProblem, Level, solve

limit = Level([[1.0, 0.0]], -np.inf, 1.0, name="limit")  # first: x[0] <= 1
task = Level(np.eye(2), [3.0, 4.0], [3.0, 4.0], name="task")  # then: x = (3, 4)
problem = HierarchicalProblem([limit, task])
solution = solve(problem)  # a Solution
print(solution.x, solution.residuals)  # (1, 4), (0, 2)

# %% SolveStatus
from poise.hqp import SolveStatus

if solution.status is not SolveStatus.OPTIMAL:
    print(solution.explain(problem))

# %% make_solver
from poise.hqp import make_solver

solver = make_solver("direct", time_limit=0.001)  # [s]
solution = solver.solve(problem)

# %% LexicographicSolver
from poise.hqp import LexicographicSolver

solver = LexicographicSolver()
print(solver.solve(problem).x, solver.changes)  # changes of the active set
