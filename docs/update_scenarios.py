"""Runs the shipped scenarios on robots of the catalog and puts the table into scenarios.md.

    python docs/update_scenarios.py [--robots g1,talos] [--scenarios stand,walk] [--keep runs.json]

Runs that the file of `--keep` has already are not made again, so that a run that was stopped goes
on. Without it everything is run anew.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

PAGE = Path(__file__).with_name("scenarios.md")
TABLE = re.compile(r"(<!-- begin of the table -->\n).*(<!-- end of the table -->)", re.DOTALL)

ROBOTS = ("humanoid33", "g1", "talos", "icub", "romeo")
SCENARIOS = (
    "stand",
    "squat",
    "reach",
    "push",
    "balance_one_leg",
    "walk",
    "walk_sideways",
    "walk_turn",
    "walk_step",
    "drive",
)
"""Those of a whole humanoid under torque control."""

_FELT = ("run ended early", "missed ticks")
"""Checks that follow from a fall and say nothing more."""


def main() -> None:
    """Runs what is missing, then replaces what stands between the marks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--scenarios", default=",".join(SCENARIOS))
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    known: dict[str, Any] = {}
    if options.keep is not None and options.keep.is_file():
        known = json.loads(options.keep.read_text(encoding="utf-8"))
    robots, scenarios = options.robots.split(","), options.scenarios.split(",")
    for scenario in scenarios:
        for robot in robots:
            key = f"{scenario} {robot}"
            if key not in known:
                known[key] = outcome(scenario, robot)
                print(f"{key}: {known[key]['reason'] or 'passes'}", flush=True)
            if options.keep is not None:
                options.keep.write_text(json.dumps(known, indent=1), encoding="utf-8")
    page = PAGE.read_text(encoding="utf-8")
    made = table(known, robots, scenarios)
    PAGE.write_text(TABLE.sub(lambda m: f"{m[1]}{made}{m[2]}", page), encoding="utf-8")


def outcome(scenario: str, robot: str) -> dict[str, Any]:
    """Whether a scenario passes on a robot, and if not, why in one line."""
    with tempfile.TemporaryDirectory() as folder:
        words = [scenario, "--robot", robot, "--no-video", "--json", "--out", folder]
        command = [sys.executable, "-m", "poise", "run", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 2:
        return {"ok": False, "reason": done.stderr.strip().removeprefix("poise: ")}
    return {"ok": done.returncode == 0, "reason": reason(json.loads(done.stdout))}


def reason(summary: dict[str, Any]) -> str:
    """Why a run failed, in one line; "" for one that did not."""
    failed = [c for c in summary["checks"] if not c["ok"]]
    if not failed:
        return ""
    if summary["fell"]:
        fell = next(c for c in failed if c["metric"] == "fell")
        how = f": {fell['mechanism']}" if fell["mechanism"] else ""
        return f"fell at {fell['worst_time_s']:.1f} s{how}"
    # The check that is farthest beyond its bound, as it says itself.
    worst = max((c for c in failed if c["name"] not in _FELT), default=failed[0], key=excess)
    value = "not measured" if worst["value"] is None else f"{worst['value']:.3g} {worst['unit']}"
    at = "" if worst["worst_time_s"] is None else f" at {worst['worst_time_s']:.1f} s"
    how = f"; {worst['mechanism']}" if worst["mechanism"] else ""
    bound = f"{worst['relation']} {worst['bound']:.3g}"
    return f"{worst['name']}: {value.strip()} ({bound}){at}{how}"


def excess(check: dict[str, Any]) -> float:
    """How far a value is beyond its bound, by the bound."""
    if check["value"] is None:
        return float("inf")
    return abs(check["value"] - check["bound"]) / max(abs(check["bound"]), 1e-9)


def table(known: dict[str, Any], robots: list[str], scenarios: list[str]) -> str:
    """A row a scenario, a column a robot; and a line on each failure."""
    head = ["scenario", *(f"`{robot}`" for robot in robots)]
    lines = ["| " + " | ".join(head) + " |", "| --- " * len(head) + "|"]
    failures: list[str] = []
    for scenario in scenarios:
        cells = [f"`{scenario}`"]
        for robot in robots:
            run = known.get(f"{scenario} {robot}")
            cells.append("not run" if run is None else "passes" if run["ok"] else "fails")
            if run is not None and not run["ok"]:
                failures.append(f"- `{scenario}` on `{robot}`: {run['reason']}.")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n\n" + "\n".join(failures) + "\n"


if __name__ == "__main__":
    main()
