import numpy as np
import pytest
from unchecked import run_unchecked

from poise.errors import ConfigurationError, ProblemError, UnknownNameError
from poise.hqp import (
    HierarchicalProblem,
    Level,
    SolveStatus,
    make_solver,
    solve,
)
from poise.hqp._weighted import WeightedSolver

I2 = np.eye(2)


def problem(**changes):
    return HierarchicalProblem([Level(I2, 0.0, 1.0)], **changes)


BAD = {
    "no levels": (lambda: HierarchicalProblem([]), "no levels"),
    "NaN coefficient": (lambda: Level([[np.nan, 1.0]], 0, 1), "not finite at row 0, column 0"),
    "vector for a matrix": (lambda: Level([1.0, 2.0], 0, 1), "not a matrix"),
    "words for numbers": (lambda: Level([["a", "b"]], 0, 1), "not an array of numbers"),
    "NaN bound": (lambda: Level(I2, [0.0, np.nan], 1), "NaN at row 1"),
    "crossing bounds": (lambda: Level(I2, [0.0, 2.0], 1), "cross at row 1"),
    "negative weight": (lambda: Level(I2, 0, 1, weights=[1.0, -1.0]), "wrong at row 1"),
    "labels do not add up": (lambda: Level(I2, 0, 1, labels=[("a", 1)]), "add up"),
    "unequal columns": (
        lambda: HierarchicalProblem([Level(I2, 0, 1), Level(np.eye(3), 0, 1)]),
        "level 1 has another number of variables",
    ),
    "bounds_level": (lambda: problem(bounds_level=1), "bounds_level is not a level"),
    "H of the wrong shape": (lambda: problem(H=np.eye(3)), "H has the wrong shape"),
    "H with NaN": (lambda: problem(H=[[1.0, np.nan], [0.0, 1.0]]), "H is not finite"),
    "H not symmetric": (lambda: problem(H=[[1.0, 1.0], [0.0, 1.0]]), "not symmetric"),
    "H indefinite": (lambda: problem(H=-I2), "semidefinite"),
    "cost without a minimum": (
        lambda: HierarchicalProblem([Level([[0.0, 1.0]], 0, 1)], H=0 * I2, g=[1.0, 0.0]),
        "no minimum",
    ),
    "g infinite": (lambda: problem(g=[np.inf, 0.0]), "g is not finite"),
    "x bounds cross": (lambda: problem(x_lower=1.0, x_upper=0.0), "bounds of x cross"),
    "no variables": (lambda: HierarchicalProblem.allocate(0, [1]), "not a problem's size"),
    "names missing": (
        lambda: HierarchicalProblem.allocate(1, [1], names=[]),
        "one entry a level",
    ),
    "negative rows": (lambda: HierarchicalProblem.allocate(1, [-1]), "not a problem's size"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_with_what_was_got_and_wanted(name):
    make, text = BAD[name]
    with pytest.raises(ProblemError, match=text) as error:
        make()
    assert "got" in str(error.value)
    assert "wanted" in str(error.value)


def test_a_label_may_have_no_rows():
    assert Level(I2, 0.0, 1.0, labels=[("a", 0), ("b", 2)]).labels == [("a", 0), ("b", 2)]


def test_numbers_spoiled_after_allocation_are_refused_by_solve_and_survived_by_a_solver():
    spoiled = HierarchicalProblem.allocate(2, [1])
    spoiled.A[0, 0] = np.nan
    with pytest.raises(ProblemError, match="not finite"):
        solve(spoiled)
    solution = make_solver().solve(spoiled)
    assert solution.status is SolveStatus.BAD_PROBLEM


@pytest.mark.parametrize("strategy", ["direct", "cascade", "weighted"])
@pytest.mark.parametrize("spoil", ["A", "lower", "upper", "H", "g", "weights", "cross"])
def test_no_strategy_raises_or_returns_nan_on_spoiled_numbers(strategy, spoil):
    solver = make_solver(strategy, None if strategy == "direct" else "daqp")
    good = HierarchicalProblem([Level(I2, [1.0, 0.0], [1.0, 2.0]), Level([[1.0, 1.0]], 5, 5)])
    assert solver.solve(good).x[0] == pytest.approx(1.0, abs=2e-3)
    if spoil == "cross":
        good.lower[2], good.upper[2] = 3.0, -3.0
    else:
        getattr(good, spoil).flat[-1] = np.nan
    solution = solver.solve(good)
    assert solution.status is SolveStatus.BAD_PROBLEM
    assert np.isfinite(np.concatenate([solution.x, solution.slacks, solution.residuals])).all()
    fine = HierarchicalProblem([Level(I2, [1.0, 0.0], [1.0, 2.0]), Level([[1.0, 1.0]], 5, 5)])
    assert solver.solve(fine).ok


def test_unknown_names_list_the_choices():
    with pytest.raises(UnknownNameError, match="direct, cascade, weighted"):
        make_solver("newton")
    with pytest.raises(UnknownNameError, match="osqp"):
        make_solver("cascade", "osqq")
    with pytest.raises(UnknownNameError, match="no backends"):
        make_solver("direct", "osqp")


def test_a_ratio_of_one_is_refused():
    with pytest.raises(ConfigurationError, match="ratio"):
        WeightedSolver(ratio=1.0)


@pytest.mark.parametrize("strategy", ["direct", "cascade", "weighted"])
@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan])
def test_a_time_limit_that_cannot_be_is_refused_by_all(strategy, limit):
    with pytest.raises(ConfigurationError, match="time_limit"):
        make_solver(strategy, time_limit=limit)


def test_no_row_has_a_number_below_zero():
    with pytest.raises(ProblemError, match="no such row"):
        problem().label(-1)


LABELS = """
import json
import numpy as np
from poise.errors import ProblemError
from poise.hqp import Level

said = []
for labels in (["a", "b"], ["a1", "b1"], 5):
    try:
        Level(np.eye(2), 0.0, 1.0, labels=labels)
    except ProblemError as error:
        said.append(str(error))
print(json.dumps(said))
"""


def test_labels_that_are_no_pairs_are_refused():
    said = run_unchecked(LABELS)
    assert len(said) == 3
    assert all("labels of a level" in one and "sum to 2" in one for one in said)
