"""A scenario of your own: a YAML file in, a run with checks and a report out."""

import argparse
from pathlib import Path

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("runs/wave"))
options = parser.parse_args()

# The same from the command line: poise run examples/wave.yaml --out runs/wave
scenario = Path(__file__).parent / "wave.yaml"  # or the name of a shipped one, such as "squat"
options.out.mkdir(parents=True, exist_ok=True)
run = poise.run_scenario(scenario, log=options.out / "log.mcap", progress=True)
page = poise.report(run, options.out)  # with summary.json beside it
for check in run.checks:
    print("ok  " if check.ok else "FAIL", f"{check.name}: {check.value:.3g} {check.unit}")
run.plot().savefig(options.out / "run.png")
print(f"report: {page}")
raise SystemExit(0 if run.ok else 1)
