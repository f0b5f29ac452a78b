from pathlib import Path
from tempfile import mkdtemp

FOLDER = Path(mkdtemp())  # workers that import this file make one each
(FOLDER / "stand.yaml").write_text("name: stand\nrobot: biped20\nduration: 0.02\n")
FILE = FOLDER / "friction.yaml"
FILE.write_text("name: friction\nscenario: stand.yaml\nvary: {plant.friction: [0.4, 0.8]}\n")

# %% run_campaign LocalWorkers
from poise.apps.campaigns import LocalWorkers, run_campaign

if __name__ == "__main__":  # workers import this file
    rows = run_campaign(FILE, FOLDER / "runs", LocalWorkers(2))

# %% Design
from poise.apps.campaigns import Design

design = Design.load(FILE)
print(design.count, design.job(0))  # episodes, and the first of them

# %% RowLog
from poise.apps.campaigns import RowLog

log = RowLog(FOLDER / "rows.jsonl")
log.add({"episode": 0, "fell": False})
print(log.rows)
