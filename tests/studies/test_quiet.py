"""The study of levels that cannot be met: its quick form, and its trials."""

import json

import pytest
from unchecked import run_unchecked

pytest.importorskip("mujoco")

from studies.quiet.reach import Reach, random_moves, run_reach

PARTS = ("targets", "cost", "priorities", "collisions", "standing")


def quick(folder):
    """Exit status and findings of the quick form, in a process of its own."""
    from studies.__main__ import main

    parts = [word for part in PARTS for word in ("--part", part)]
    status = main(["quiet", "--quick", *parts, "--out", str(folder)])
    return status, json.loads((folder / "study.json").read_text(encoding="utf-8"))


def test_the_quick_form_holds(tmp_path):
    status, findings = run_unchecked(quick, tmp_path)
    assert [finding["name"] for finding in findings if not finding["ok"]] == []
    assert status == 0
    assert len(findings) >= 9


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
    assert soft.to_1mm == float("inf")
