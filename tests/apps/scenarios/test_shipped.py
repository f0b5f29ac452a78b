"""Every shipped scenario on both robots, through the command line, from file to report."""

import itertools
import json

import pytest
from slow import slow

from poise.apps.scenarios import shipped_scenarios
from poise.sim import read_log

KEYS = {
    "robot": str,
    "controller": str,
    "scenario": str,
    "seed": int,
    "fell": bool,
    "checks": list,
    "com_error_max_m": float,
    "torque_ratio_max": float,
    "torque_step_max": float,
    "residual_max": list,
    "missed_ticks": int,
    "tick_us": dict,
    "real_time_factor": float,
}


BIPEDS = [
    name
    for name in shipped_scenarios()
    if name != "reach_arm" and not name.startswith(("walk", "over_an_obstacle"))
]
"""Scenarios of a robot on two feet that is commanded torques; walks are long, and come below."""


QUICK = ("squat", "g1")
"""Run with all tests; the others take minutes together."""


@pytest.mark.parametrize(
    ("scenario", "robot"),
    [
        run if run == QUICK else slow(*run)
        for run in itertools.product(BIPEDS, ("humanoid33", "g1"))
    ],
)
def test_a_shipped_scenario_holds(shipped_run, scenario, robot):
    outcome = shipped_run(scenario, robot)
    assert outcome.status == 0, outcome.out + outcome.err
    assert outcome.err == ""
    summary = outcome.summary
    assert json.loads(outcome.out) == summary
    assert {key: type(value) for key, value in summary.items()} == KEYS
    assert (summary["robot"], summary["scenario"]) == (robot, scenario)
    assert summary["fell"] is False
    assert summary["missed_ticks"] == 0
    assert [c for c in summary["checks"] if not c["ok"]] == []
    keys = [
        "name",
        "metric",
        "value",
        "relation",
        "bound",
        "unit",
        "ok",
        "worst_time_s",
        "mechanism",
    ]
    assert all(list(c) == keys for c in summary["checks"])
    assert max(summary["residual_max"][:2]) < 1e-6
    assert set(summary["tick_us"]) == {"p50", "p99", "max"}
    assert 0.0 < summary["tick_us"]["p50"] <= summary["tick_us"]["p99"] <= summary["tick_us"]["max"]
    assert 0.0 < summary["torque_ratio_max"] <= 1.0 + 1e-12
    assert {p.name for p in outcome.folder.iterdir()} == {"report.html", "log.mcap", "summary.json"}
    assert scenario in (outcome.folder / "report.html").read_text()
    log = read_log(outcome.folder / "log.mcap")
    assert log.complete
    about = {"robot": robot, "scenario": scenario, "controller": "whole_body", "seed": "0"}
    assert about.items() <= log.metadata.items()
    # The log agrees with the summary, and holds the run to its end.
    time, residuals = log.signal("residuals")
    assert residuals.shape[1] == len(summary["residual_max"])
    assert log.end == pytest.approx(time[-1], abs=0.01)
    assert (residuals[:, :2].max(axis=0) <= summary["residual_max"][:2]).all()


def assert_holds(outcome):
    assert outcome.status == 0, outcome.out + outcome.err
    assert outcome.summary["fell"] is False
    assert outcome.summary["missed_ticks"] == 0
    assert max(outcome.summary["residual_max"][:2]) < 1e-6
    assert outcome.summary["controller"] == "osf"


@pytest.mark.parametrize("robot", [slow("panda"), "arm6", slow("ur5")])
def test_an_arm_reaches_under_the_operational_space_formulation(shipped_run, robot):
    assert_holds(shipped_run("reach_arm", robot))


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "robot"), [("squat", "g1"), ("reach", "humanoid33")])
def test_a_humanoid_scenario_holds_under_the_operational_space_formulation(
    shipped_run, scenario, robot
):
    assert_holds(shipped_run(scenario, robot, "--controller", "osf"))
