"""Scenarios: a file that says robot, controller, references, disturbances and checks; its run."""

from poise.apps.scenarios._outputs import (
    LOG,
    report,
    summarise,
    write_page,
    write_summary,
    write_video,
)
from poise.apps.scenarios._reader import load_scenario, parse_scenario, shipped_scenarios
from poise.apps.scenarios._replay import drawn_shapes
from poise.apps.scenarios._run import Run, run_scenario
from poise.apps.scenarios._scenario import Scenario
from poise.apps.scenarios._stage import Stage, stage_scenario

__all__ = [
    "LOG",
    "Run",
    "Scenario",
    "Stage",
    "drawn_shapes",
    "load_scenario",
    "parse_scenario",
    "report",
    "run_scenario",
    "shipped_scenarios",
    "stage_scenario",
    "summarise",
    "write_page",
    "write_summary",
    "write_video",
]
