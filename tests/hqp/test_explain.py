import numpy as np
import pytest

from poise.hqp import HierarchicalProblem, Level, LexicographicSolver, make_solver, solve


def robot_in_a_corner():
    limit = Level(
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], -np.inf, 1.0, labels=[("elbow limit", 2)], name="limits"
    )
    tasks = Level(
        [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        [3.0, 0.5],
        [3.0, 0.5],
        labels=[("right hand", 1), ("head", 1)],
        name="tasks",
    )
    return HierarchicalProblem([limit, tasks])


def test_explain_names_the_task_the_amount_and_the_limit_in_its_way():
    problem = robot_in_a_corner()
    solution = solve(problem)
    text = solution.explain(problem)
    assert "right hand" in text
    assert "elbow limit" in text
    assert "head" not in text
    assert "by up to 2 below its bound" in text
    (conflict,) = solution.conflicts(problem)
    assert (conflict.label, conflict.level, conflict.row) == ("right hand", 1, 5)
    assert conflict.conflicting_with == ("elbow limit",)
    assert abs(conflict.violation + 2.0) < 1e-9


def test_explain_says_so_when_everything_is_met():
    problem = HierarchicalProblem([Level(np.eye(2), 0.0, 1.0)])
    assert "every row of every level is met" in solve(problem).explain(problem)


def test_two_tasks_of_one_level_name_each_other():
    problem = HierarchicalProblem(
        [Level([[1.0], [1.0]], [0.0, 1.0], [0.0, 1.0], labels=[("left", 1), ("right", 1)])]
    )
    conflicts = solve(problem).conflicts(problem)
    assert [(c.label, c.conflicting_with) for c in conflicts] == [
        ("left", ("right",)),
        ("right", ("left",)),
    ]


def test_what_is_no_problem_is_named():
    problem = robot_in_a_corner()
    problem.lower[3], problem.A[2, 2] = 1.5, np.nan
    for solver in (LexicographicSolver(), make_solver("cascade"), make_solver("weighted")):
        text = solver.solve(problem).explain(problem)
        assert text == (
            "bad_problem: numbers that are not finite in right hand; "
            "bounds that cross in elbow limit"
        )


def test_simple_bounds_are_named():
    problem = HierarchicalProblem([Level([[1.0]], 5.0, 5.0, labels="reach")], x_upper=1.0)
    conflicts = solve(problem).conflicts(problem)
    assert {c.label for c in conflicts} == {"reach", "bounds on x"}


@pytest.mark.parametrize(
    "solver", [LexicographicSolver(max_changes=1), make_solver("cascade", time_limit=1e-9)]
)
def test_what_is_only_not_met_yet_is_not_said_to_be_impossible(solver):
    rng = np.random.default_rng(5)
    A, x = rng.normal(size=(60, 20)), rng.normal(size=20)
    limits = Level(A, A @ x - 0.01, A @ x + 0.01, labels="limits")
    problem = HierarchicalProblem([limits, Level(np.eye(20), 0.0, 0.0)])
    assert solve(problem).residuals[0] < 1e-9
    solution = solver.solve(problem)
    assert not solution.ok
    text = solution.explain(problem)
    assert "are not met" in text
    assert "'limits' misses" in text
    assert "cannot" not in text
    assert "by itself" not in text


def test_where_levels_are_only_weighted_nothing_is_proven():
    """Level 1 is met and A could be: only B, below it, pulls it away."""
    rows = ([[0.0, 1.0]], 0.0, "y"), ([[1.0, 0.0]], 0.0, "A"), ([[1.0, 0.0]], 1.0, "B")
    problem = HierarchicalProblem([Level(A, at, at, labels=name) for A, at, name in rows])
    text = make_solver("weighted").solve(problem).explain(problem)
    assert text.startswith("optimal: 2 rows are not met")
    assert "by itself" not in text
