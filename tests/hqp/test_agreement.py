"""Random hierarchies: direct and cascade against each other and the optimality conditions."""

import numpy as np
import pytest
from slow import slow

from poise.hqp import certify_point, make_solver
from poise.hqp._cascade import CascadeSolver
from poise.hqp._measure import measure_point

from .random_problems import random_problem

BATCH = 125
AGREEMENT = 1e-6  # of level residuals, relative to the level's scale
OPTIMALITY = {"direct": 1e-8, "cascade": 1e-6}  # of forces that do not balance, relative


@pytest.mark.parametrize("feasible", [True, False], ids=["feasible", "degenerate"])
@pytest.mark.parametrize("first", [0, *(slow(first) for first in range(BATCH, 1000, BATCH))])
def test_direct_and_cascade_agree_and_are_optimal(feasible, first):
    direct, cascade = make_solver(), CascadeSolver("daqp")
    failures = []
    for seed in range(first, first + BATCH):
        problem = random_problem(seed, feasible=feasible)
        a, b = direct.solve(problem), cascade.solve(problem)
        assert np.isfinite(np.concatenate([a.x, a.slacks, b.x, b.slacks])).all()
        gap = np.abs(a.residuals - b.residuals) / measure_point(problem, a.x).scales
        errors = [certify_point(problem, solution.x).worst for solution in (a, b)]
        good = a.ok and b.ok and gap.max() <= AGREEMENT
        good &= errors[0] <= OPTIMALITY["direct"] and errors[1] <= OPTIMALITY["cascade"]
        if feasible:
            good &= not a.relaxed and a.relative_residuals.max() <= 1e-8
        if not good:
            failures.append((seed, a.status, b.status, float(gap.max()), errors))
    assert not failures, f"random_problem(seed, feasible={feasible}): {failures}"
