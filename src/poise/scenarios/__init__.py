"""Scenarios: a file that says robot, controller, references, disturbances and checks; its run."""

from poise.scenarios.outputs import summarise, write_page, write_summary, write_video
from poise.scenarios.reader import load_scenario, parse_scenario, shipped_scenarios
from poise.scenarios.run import Run, run_scenario
from poise.scenarios.scenario import Scenario

__all__ = [
    "Run",
    "Scenario",
    "load_scenario",
    "parse_scenario",
    "run_scenario",
    "shipped_scenarios",
    "summarise",
    "write_page",
    "write_summary",
    "write_video",
]
