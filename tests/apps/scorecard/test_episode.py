"""Real runs: who survives, and what happened first to who does not."""

import re
import sys
import time

import numpy as np
import pytest

from poise.apps.scenarios import parse_scenario, run_scenario, symptoms_of
from poise.apps.scorecard._plan import QUICK, Case, Plan
from poise.apps.scorecard._run import lean, mechanism, run_trial, survived
from poise.apps.scorecard._trials import TRIALS

STAND = """
name: short
robot: biped20
controller: {controller}
duration: {duration}
plant: {{control_dt: 0.002, friction: {friction}}}
pushes: [{{body: torso, at: 0.1, duration: 0.1, velocity_change: [0.0, {push}, 0.0]}}]
checks: [{{metric: com_speed_end, at_most: 0.03}}]
"""


def run(push, duration=0.4, friction=1.0, controller="osf"):
    text = STAND.format(push=push, duration=duration, friction=friction, controller=controller)
    return run_scenario(parse_scenario(text, "short.yaml"))


def symptoms(run):
    return symptoms_of(run.signals, run.robot, run.scenario)


@pytest.fixture(scope="module")
def hard():
    """Pushed hard enough to fall, as far as its first half second."""
    return run(3.0, duration=1.5)


def test_a_robot_that_is_hardly_pushed_survives():
    calm = run(0.001)
    assert survived(calm)
    assert lean(calm) < 0.01
    assert [s.what for s in symptoms(calm) if s.begin(calm.signals.time) is not None] == []


def test_what_happened_first_is_told_first_and_how_it_ended_last(hard):
    assert not survived(hard)
    told = mechanism(hard)
    assert told.endswith(hard.ended_early)
    times = [float(time) for time in re.findall(r"\((\d+\.\d+) s\)", told)]
    assert len(times) >= 2
    assert times == sorted(times)
    # Nothing is told of before the push.
    begun = [s.begin(hard.signals.time) for s in symptoms(hard)]
    begun = sorted(time for time in begun if time is not None)
    assert times[0] == pytest.approx(begun[0], abs=0.005)
    assert all(0.1 <= time <= hard.signals.time[-1] for time in begun)


def test_a_fall_is_the_same_however_busy_the_machine_is(hard, monkeypatch):
    """Each look at the clock takes a while, as where others want the processor."""
    from time import perf_counter

    ahead = iter(range(10**9))
    monkeypatch.setattr("time.perf_counter", lambda: perf_counter() + 0.01 * next(ahead))
    for name, module in [*sys.modules.items()]:
        if name.startswith("poise.") and hasattr(module, "perf_counter"):
            monkeypatch.setattr(module, "perf_counter", time.perf_counter)
    again = run(3.0, duration=1.5)
    assert np.array_equal(again.signals.q, hard.signals.q)


def test_the_row_of_an_episode_says_whether_it_was_survived():
    plan = Plan(robot="biped20", controller="osf", extent=QUICK)
    push = next(trial for trial in TRIALS if trial.name == "push")
    job = plan.job(Case(push, 0, 0.0), seed=1, look=0, level=1.0)
    job.scenario["duration"] = 0.6
    row = run_trial(job)
    assert row["survived"] is False
    assert row["mechanism"]
    assert (row["trial_name"], row["case"], row["level"]) == ("push", 0, 1.0)


def test_a_walk_that_cannot_be_planned_is_refused_and_says_why():
    plan = Plan(robot="biped20", controller="osf", extent=QUICK)
    speed = next(trial for trial in TRIALS if trial.name == "speed")
    row = run_trial(plan.job(Case(speed), seed=1, look=0, level=1.0))
    assert row["outcome"] == "refused"
    assert "survived" not in row
    assert row["reason"]
