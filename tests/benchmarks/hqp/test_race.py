"""The race: who is timed when, who is right, and what comes of it. Points are made up by hand."""

import numpy as np
import pytest

from benchmarks.hqp import bench
from benchmarks.hqp.bench import HqpBench, bench_hqp
from benchmarks.hqp.judge import best_known, judge_point, measure_point
from benchmarks.hqp.methods import Answer
from benchmarks.hqp.problem_set import ProblemSequence
from benchmarks.hqp.race import COLD, GIVEN_UP, LATE, PATIENCE, WARM, Runner, take_turns
from poise.hqp import HierarchicalProblem, Level, solve


def conflict(height: float = 4.0) -> HierarchicalProblem:
    """x1 <= 1 above (x1, x2) = (3, height): (1, height) is right, 2 off in level 1."""
    limit = Level([[1.0, 0.0]], -np.inf, 1.0)
    return HierarchicalProblem([limit, Level(np.eye(2), [3.0, height], [3.0, height])])


def sequence(count: int, *, consecutive: bool = False) -> ProblemSequence:
    return ProblemSequence(
        name="by-hand",
        family="random",
        description="A limit and a target beyond it.",
        consecutive=consecutive,
        problems=tuple(conflict(4.0 + 0.1 * i) for i in range(count)),
    )


class Fake:
    """Answers with the right point plus an error, claims what it is told to, and logs its calls."""

    def __init__(self, name="fake", error=(0.0, 0.0), claimed=True, log=None):
        self.name, self.error, self.claimed = name, np.array(error), claimed
        self.log = [] if log is None else log

    def forget(self):
        self.log.append((self.name, "forget"))

    def take(self, problem):
        self.problem = problem

    def solve(self):
        self.log.append((self.name, float(self.problem.upper[4])))

    def answer(self):
        right = np.array([1.0, self.problem.upper[4]])
        return Answer(x=right + self.error, status="optimal", claimed=self.claimed)


def race_fakes(monkeypatch, fakes, *, count=5, consecutive=False):
    """Races made-up contestants in the place of the real ones of these names."""
    monkeypatch.setattr(bench, "make_contestant", lambda name, cap: fakes[name])
    others = tuple(name for name in fakes if name != "direct")
    plan = HqpBench(methods=others)
    found = bench_hqp([sequence(count, consecutive=consecutive)], plan)
    return {(r.method, r.start): r for r in found.results}, found


def test_a_point_is_measured_on_the_rows_in_the_levels_scale():
    problem = conflict()
    found = measure_point(problem, np.array([1.5, 4.0]))
    np.testing.assert_allclose(found.residuals, [0.5, 1.5 / 5.0])
    assert found.cost == pytest.approx(0.5 * (1.5**2 + 16.0))
    solution = solve(problem)
    np.testing.assert_allclose(
        measure_point(problem, solution.x).residuals, solution.relative_residuals, atol=1e-12
    )


def test_the_best_known_goes_level_by_level_among_those_that_tie():
    problem = conflict()
    points = {
        "right": [1.0, 4.0],
        "lower first": [3.0, 4.0],
        "neither": [0.0, 0.0],
        "worse cost": [1.0, 4.0],
    }
    measured = {name: measure_point(problem, np.array(x)) for name, x in points.items()}
    best = best_known(list(measured.values()))
    np.testing.assert_allclose(best.residuals, [0.0, 0.4])
    assert judge_point(measured["right"], best).right
    lower_first = judge_point(measured["lower first"], best)
    assert not lower_first.right
    assert lower_first.gap == pytest.approx(2.0)
    assert lower_first.cost_gap is None
    assert judge_point(measured["neither"], best).gap == pytest.approx(1.0 - 0.4)


def test_what_a_sloppy_point_gains_below_makes_no_exact_one_wrong():
    # Levels 1e-5 apart in direction: 1e-7 given away above is worth 1e-2 below.
    above = Level([[1.0, 0.0]], -np.inf, 0.0)
    below = Level([[1.0, 1e-5], [0.0, 1.0]], [1.0, 0.0], [1.0, 0.0])
    problem = HierarchicalProblem([above, below])
    exact = measure_point(problem, solve(problem).x)
    sloppy = measure_point(problem, solve(problem).x + [9e-7, 0.0])
    for order in ([exact, sloppy], [sloppy, exact]):
        best = best_known(order)
        assert best.residuals[1] == exact.residuals[1]
        assert judge_point(exact, best).right


def test_a_wrong_answer_with_a_good_status_is_silent(monkeypatch):
    results, _ = race_fakes(
        monkeypatch, {"direct": Fake(), "weighted": Fake(error=(0.0, 1e-2)), "daqp-hard": Fake()}
    )
    wrong = results["weighted", COLD]
    assert (wrong.solved, wrong.silent) == (0.0, 5)
    assert wrong.gap == pytest.approx((np.hypot(2.0, 1e-2) - 2.0) / np.hypot(3.0, 4.0), rel=0.1)
    assert results["direct", COLD].solved == results["daqp-hard", COLD].solved == 1.0
    assert results["direct", COLD].silent == 0


def runner(fake, count, *, start=COLD, quick=True, cap=1.0):
    problems = sequence(count).problems
    return Runner(fake.name, start, fake, problems, cap, quick=quick)


def test_cold_forgets_before_every_solve_and_warm_never():
    cold, warm = Fake("cold"), Fake("warm")
    list(take_turns([runner(cold, 4), runner(warm, 4, start=WARM)], 4))
    assert [what == "forget" for _, what in cold.log] == 5 * [True, False]
    assert "forget" not in [what for _, what in warm.log]


def test_what_is_late_is_unsolved_and_after_some_the_method_is_out():
    one = runner(Fake(), 6, cap=1e-12)
    list(take_turns([one], 6))
    assert one.statuses == PATIENCE * [LATE] + (6 - PATIENCE) * [GIVEN_UP]
    assert not one.claimed.any()
    assert np.isfinite(one.seconds).sum() == PATIENCE
