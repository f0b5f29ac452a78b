"""Runs of `poise run` in processes of their own, each made once a session."""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from unchecked import run_poise

pytest.importorskip("mujoco")
sys.path.insert(0, str(Path(__file__).parent))


@dataclass(frozen=True)
class Outcome:
    status: int
    out: str
    err: str
    folder: Path

    @property
    def summary(self):
        return json.loads((self.folder / "summary.json").read_text())


def poise_run(folder, *arguments):
    """Run `poise run ARGUMENTS --out FOLDER` as a user does."""
    done = run_poise("run", *arguments, "--out", str(folder))
    return Outcome(done.status, done.out, done.err, folder)


@pytest.fixture(scope="session")
def shipped_run(tmp_path_factory, get_robot):
    """The outcome of a shipped scenario on a robot, without the video."""
    known = {}

    def run(scenario, robot, *options):
        get_robot(robot)  # skips where its files are not installed
        key = (scenario, robot, *options)
        if key not in known:
            folder = tmp_path_factory.mktemp(f"{scenario}-{robot}")
            arguments = (scenario, "--robot", robot, "--no-video", "--json", *options)
            known[key] = poise_run(folder, *arguments)
        return known[key]

    return run
