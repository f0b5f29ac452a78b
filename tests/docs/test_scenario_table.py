"""The table of which scenario passes on which robot: what is made of a run's summary."""

import pytest

from docs import update_scenarios


def check(name, value, bound, **more):
    made = {"name": name, "metric": "m", "value": value, "relation": "<=", "bound": bound}
    return made | {"unit": "m", "ok": False, "worst_time_s": 1.25, "mechanism": ""} | more


def summary(*checks, fell=False):
    return {"fell": fell, "checks": list(checks)}


def test_what_passes_has_no_reason():
    assert update_scenarios.reason(summary(check("a", 1.0, 2.0, ok=True))) == ""


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (
            summary(
                check("robot fell", 1.0, 0.0, metric="fell", mechanism="left_sole slips (0.9 s)"),
                check("run ended early", 1.0, 0.0),
                fell=True,
            ),
            "fell at 1.2 s: left_sole slips (0.9 s)",
        ),
        (
            summary(check("near", 0.011, 0.01), check("far", 0.2, 0.1, mechanism="a stop")),
            "far: 0.2 m (<= 0.1) at 1.2 s; a stop",
        ),
        (
            summary(check("missed ticks", 3.0, 0.0), check("near", 0.2, 0.1)),
            "near: 0.2 m (<= 0.1) at 1.2 s",
        ),
        (
            summary(check("none", None, 0.1, worst_time_s=None)),
            "none: not measured (<= 0.1)",
        ),
    ],
)
def test_a_failure_is_one_line(found, said):
    assert update_scenarios.reason(found) == said


def test_a_row_is_a_scenario_and_a_column_a_robot():
    runs = {"stand g1": {"ok": True, "reason": ""}, "walk g1": {"ok": False, "reason": "fell"}}
    lines = update_scenarios.table(runs, ["g1", "talos"], ["stand", "walk"]).splitlines()
    assert lines[0] == "| scenario | `g1` | `talos` |"
    assert lines[2:] == [
        "| `stand` | passes | not run |",
        "| `walk` | fails | not run |",
        "",
        "- `walk` on `g1`: fell.",
    ]
