"""The search as machine code: one signature each, nothing counted, nothing compiled in a loop."""

import numpy as np
from numba.core import event

from poise._compiled import functions_of
from poise.hqp import LexicographicSolver
from poise.hqp._active_set.search import search

from .families import FAMILIES


def test_nothing_is_compiled_by_any_problem_and_every_function_has_one_signature():
    solver = LexicographicSolver()
    with event.install_recorder("numba:compile") as compiling:
        for family in FAMILIES:
            for seed in range(3):
                problem = family(seed)
                solver.run(problem)
                for array in (problem.A, problem.lower, problem.upper, problem.H, problem.g):
                    array.flags.writeable = False
                solver.solve(problem)
        LexicographicSolver(time_limit=1.0, damping=0.01).solve(FAMILIES[0](0))
    assert not compiling.buffer
    assert len(search.signatures) == 1
    # Those that came from disk as a part of the search have none.
    counts = {f.__name__: len(f.signatures) for f in functions_of(search)}
    assert len(counts) > 60
    assert max(counts.values()) == 1


def test_the_search_allocates_nothing_and_counts_no_owners():
    LexicographicSolver()
    (found,) = search.overloads.values()
    names = [function.name for function in found.library._get_module_for_linking().functions]
    assert any("search" in name for name in names)
    assert not [name for name in names if name.startswith("NRT_")]


def test_the_workspace_is_where_it_was_after_a_solve():
    solver, problem = LexicographicSolver(), FAMILIES[0](0)
    solver.run(problem)
    x, address = solver.x, solver._work.address
    solver.run(problem)
    assert solver.x is x
    assert solver._work.address == address
    np.testing.assert_array_equal(x, solver.solve(problem).x)
