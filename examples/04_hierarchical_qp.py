"""The hierarchical QP alone, with arrays: no robot, no simulator."""

import numpy as np

from poise import HierarchicalProblem, Level, solve

# Two numbers x. First: x[0] may not exceed 1. Second: x should be (3, 4). Third: x[0] = x[1].
limit = Level([[1.0, 0.0]], -np.inf, 1.0, name="limit", labels="elbow limit")
task = Level(np.eye(2), [3.0, 4.0], [3.0, 4.0], name="task", labels=[("hand x", 1), ("hand y", 1)])
wish = Level([[1.0, -1.0]], 0.0, 0.0, name="wish", labels="equal joints")
problem = HierarchicalProblem([limit, task, wish])

for strategy in ("direct", "weighted"):
    solution = solve(problem, strategy)
    print(f"{strategy:9} x = {solution.x.round(4)}, residuals = {solution.residuals.round(4)}")
# Strict levels give (1, 4): the wish takes nothing from the task. One weighted QP only comes near.
print(solve(problem).explain(problem))
