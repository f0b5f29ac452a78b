"""The methods that are raced: each is asked the right question, and what is not there is said."""

import numpy as np
import pytest

from benchmarks.hqp.bench import HqpBench
from benchmarks.hqp.judge import measure_point
from benchmarks.hqp.methods import (
    METHODS,
    make_contestant,
    usual_methods,
    what_is_missing,
)
from poise.errors import MissingExtraError
from poise.hqp import ACCURACY, HierarchicalProblem, Level, _backends, solve


def problem(*, possible: bool, weight: float = 1.0) -> HierarchicalProblem:
    """Bounds, an equality, and two wishes for x1 of unlike size that agree or do not."""
    above = Level([[0.0, 1.0, 1.0]], 2.0, 2.0)
    wish = 3.0 if possible else 6.0
    below = Level([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]], [1.0, wish], [1.0, wish], [weight, 1.0])
    x_upper = np.array([np.inf, 0.5, np.inf])
    return HierarchicalProblem([above, below], x_lower=-5.0, x_upper=x_upper)


def answer_of(method, one):
    contestant = make_contestant(method, 60.0)
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


def test_what_is_not_installed_is_left_out_or_an_error_where_it_is_asked_for(monkeypatch):
    monkeypatch.setattr(_backends, "find_spec", lambda name: None)
    assert {name for name in usual_methods() if "cascade" in name} == {"cascade/daqp"}
    missing = what_is_missing()
    assert len(missing) == len(ACCURACY) - 1
    assert all('pip install "poise[solvers]"' in reason for reason in missing)
    with pytest.raises(MissingExtraError, match="osqp"):
        HqpBench(methods=("cascade/osqp",))
