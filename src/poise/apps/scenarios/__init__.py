"""Scenarios: files of robot, controller, references, disturbances and checks, and their runs."""

from poise.apps.scenarios._checks import (
    measure as measure,
    missed_ticks as missed_ticks,
    validate_checks as validate_checks,
)
from poise.apps.scenarios._outputs import (
    LOG as LOG,
    discard_video as discard_video,
    report,
    summarise as summarise,
    write_page as write_page,
    write_summary as write_summary,
    write_video as write_video,
)
from poise.apps.scenarios._replay import drawn_shapes as drawn_shapes
from poise.apps.scenarios._run import (
    INTERRUPTED as INTERRUPTED,
    Progress as Progress,
    Run,
    run_scenario,
    run_stage as run_stage,
)
from poise.apps.scenarios._scenario import (
    Measurement as Measurement,
    Scenario,
    load_scenario,
    make_scenario as make_scenario,
    parse_scenario as parse_scenario,
    read_scenario as read_scenario,
    shipped_scenarios as shipped_scenarios,
)
from poise.apps.scenarios._stage import (
    Stage as Stage,
    controller_names as controller_names,
    stage_scenario,
)
from poise.apps.scenarios._symptoms import explain as explain, symptoms_of as symptoms_of

__all__ = [
    "Run",
    "Scenario",
    "load_scenario",
    "report",
    "run_scenario",
    "stage_scenario",
]
