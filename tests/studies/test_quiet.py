"""The study of levels that cannot be met: its quick form, and its trials."""

import json
import subprocess
import sys

import pytest

pytest.importorskip("mujoco")

from studies.quiet.reach import Reach, random_moves, run_reach

PARTS = ("targets", "priorities")


def test_the_quick_form_holds(tmp_path):
    """In a process of its own, without type checks."""
    parts = [word for part in PARTS for word in ("--part", part)]
    command = [sys.executable, "-m", "studies", "quiet", "--quick", *parts, "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    findings = json.loads((tmp_path / "study.json").read_text(encoding="utf-8"))
    exact = [finding for finding in findings if "sensors" not in finding["name"]]
    assert [finding["name"] for finding in exact if not finding["ok"]] == [], done.stderr
    assert (len(findings), len(exact)) == (8, 7)


def test_moves_are_drawn_among_the_tasks_of_the_default_stack():
    moves = random_moves("g1", 30, 0)
    assert {name for ((name, _),) in moves} == {"com", "left_hand pose", "right_hand pose"}
    assert moves == random_moves("g1", 30, 0) != random_moves("g1", 30, 1)


@pytest.mark.slow
def test_a_strict_level_out_of_reach_is_seen_to_shake():
    way = (("hand pose", (1.5, 0.0, 0.0)),)
    strict = run_reach(Reach(robot="panda", moves=way, softening=0.0))
    soft = run_reach(Reach(robot="panda", moves=way))
    assert strict.step > 0.1
    assert soft.step < 1e-3
