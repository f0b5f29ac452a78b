import tempfile
from pathlib import Path

import poise

FOLDER = Path(tempfile.mkdtemp())

# %% load_scenario Scenario
from dataclasses import replace

scenario = replace(poise.load_scenario("stand"), duration=0.2, robot="biped20")  # a Scenario; [s]

# %% run_scenario Run
run = poise.run_scenario(scenario)  # a Run
print(run.ok, [check.name for check in run.checks])

# %% report
page = poise.report(run, FOLDER / "stand")  # writes report.html

# %% stage_scenario
from poise.apps.scenarios import stage_scenario

stage = stage_scenario(scenario)
for _ in poise.rollout(stage.plant, stage.controller, stage.leader, duration=0.01):
    pass
