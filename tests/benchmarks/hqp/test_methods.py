"""The methods that are raced: each is asked the right question, and what is not there is said."""

import numpy as np
import pytest

from benchmarks.hqp.bench import HqpBench
from benchmarks.hqp.judge import measure_point
from benchmarks.hqp.methods import (
    METHODS,
    checked_methods,
    daqp_rows,
    make_contestant,
    usual_methods,
    what_is_missing,
)
from poise.errors import MissingExtraError, UnknownNameError
from poise.hqp import ACCURACY, HierarchicalProblem, Level, _backends, solve


def problem(*, possible: bool, weight: float = 1.0) -> HierarchicalProblem:
    """Bounds, an equality, and two wishes for x1 of unlike size that agree or do not."""
    above = Level([[0.0, 1.0, 1.0]], 2.0, 2.0)
    wish = 3.0 if possible else 6.0
    below = Level([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]], [1.0, wish], [1.0, wish], [weight, 1.0])
    x_upper = np.array([np.inf, 0.5, np.inf])
    return HierarchicalProblem([above, below], x_lower=-5.0, x_upper=x_upper)


def answer_of(method, one):
    contestant = make_contestant(method, 1.0)
    contestant.forget()
    contestant.take(one)
    contestant.solve()
    return contestant.answer()


@pytest.mark.parametrize("method", [name for name in METHODS if "weighted/" not in name])
@pytest.mark.parametrize("possible", [True, False])
def test_every_method_answers(method, possible):
    if method.startswith("cascade") and method not in usual_methods():
        pytest.skip("not installed")
    one = problem(possible=possible)
    answer = answer_of(method, one)
    if method == "daqp-hard" and not possible:
        assert answer.status in ("infeasible", "overdetermined")
        assert not answer.claimed
        return
    assert answer.claimed, answer.status
    found, best = measure_point(one, answer.x), measure_point(one, solve(one).x)
    strict = not method.startswith("weighted") and "own-scale" not in method
    tolerance = 1e-2 if possible else 0.5
    tolerance = 2e-4 if strict else tolerance
    np.testing.assert_allclose(found.residuals, best.residuals, atol=tolerance)


@pytest.mark.parametrize("weight", [1.0, 5.0])
def test_daqp_gets_the_users_weights_and_would_not_keep_them_by_itself(weight):
    one = problem(possible=False, weight=weight)
    right = solve(one).x
    assert answer_of("daqp-hierarchical", one).x[0] == pytest.approx(right[0], abs=1e-5)
    # By itself: as if both rows were of length one and weighed the same, half way from 1 to 2.
    own = answer_of("daqp-hierarchical/own-scale", one)
    assert own.claimed
    assert own.x[0] == pytest.approx(1.5, abs=1e-5)
    assert abs(own.x[0] - right[0]) > 0.1


def test_a_method_that_persists_answers_the_next_problem_too():
    for method in ("direct", "daqp-hard", "daqp-hierarchical"):
        contestant = make_contestant(method, 1.0)
        for shift in (0.0, 0.5, 1.0):
            one = problem(possible=True)
            one.x_lower[0] = 1.0 + shift
            contestant.take(one)
            contestant.solve()
            answer = contestant.answer()
            if method == "daqp-hard" and shift > 0.0:
                assert not answer.claimed
            else:
                assert answer.x[0] == pytest.approx(1.0 + shift, abs=2e-5), method


def test_rows_for_daqp_keep_their_levels():
    one = HierarchicalProblem(
        [Level([[1.0, 2.0]], 0.0, 1.0), Level([[0.0, 0.0], [3.0, 4.0]], 5.0, 6.0, [7.0, 8.0])],
        x_lower=[-1.0, -np.inf],
        bounds_level=1,
    )
    rows = daqp_rows(one)
    np.testing.assert_array_equal(rows.ends, [0, 1, 4])
    np.testing.assert_array_equal(rows.A, [[1.0, 2.0], [1.0, 0.0], [0.0, 0.0], [3.0, 4.0]])
    np.testing.assert_array_equal(rows.lower, [0.0, -1.0, -np.inf, 5.0])
    np.testing.assert_array_equal(rows.upper, [1.0, np.inf, np.inf, 6.0])
    np.testing.assert_array_equal(rows.weights, [1.0, 1.0, 7.0, 8.0])
    # What was given is left alone.
    assert one.lower[3] == 5.0


def test_bounds_of_the_first_level_stay_simple():
    one = problem(possible=True)
    rows = daqp_rows(one)
    assert rows.A is one.A
    np.testing.assert_array_equal(rows.lower, one.lower)
    np.testing.assert_array_equal(rows.ends, [0, 4, 6])


def test_names_that_are_none_are_refused_with_the_choices():
    with pytest.raises(UnknownNameError, match="cascade/osqp"):
        HqpBench(methods=("cascade/gurobi",))


def test_direct_always_comes_first():
    assert checked_methods(["weighted", "direct"]) == ("direct", "weighted")
    assert checked_methods(None)[0] == "direct"


def test_what_is_not_installed_is_left_out_or_an_error_where_it_is_asked_for(monkeypatch):
    monkeypatch.setattr(_backends, "find_spec", lambda name: None)
    assert {name for name in usual_methods() if "cascade" in name} == {"cascade/daqp"}
    missing = what_is_missing()
    assert len(missing) == len(ACCURACY) - 1
    assert all('pip install "poise[solvers]"' in reason for reason in missing)
    with pytest.raises(MissingExtraError, match="osqp"):
        HqpBench(methods=("cascade/osqp",))
