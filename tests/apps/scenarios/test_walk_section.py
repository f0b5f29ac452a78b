"""The walk of a scenario file: read strictly, and led beside what else moves."""

import pytest
from dry_run import forbid_ticks, prepare

from poise.apps.scenarios import parse_scenario, shipped_scenarios
from poise.errors import PoiseError
from poise.locomotion import walking_stack

WALK = """
name: w
duration: 8.0
walk:
  strides:
    - {steps: 4, length: 0.1}
    - {steps: 2, turn: 0.05}
  gait: {step_time: 0.8, crouch: 0.02}
  feedback: {dcm_gain: 5.0}
"""


@pytest.fixture(autouse=True)
def _no_ticks(monkeypatch):
    forbid_ticks(monkeypatch, times=(0.0, 0.1, 0.5))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("length: 0.1", "lenght: 0.1", "unknown key.*lenght.*choices: length"),
        ("length: 0.1", "length: 0.7", "out of reach"),
        ("feedback: {dcm_gain: 5.0}", "carry: [nose]", "no frame task to carry.*nose"),
        ("name: w\n", "name: w\nrobot: arm6\n", "cannot walk on two feet"),
        ("name: w\n", "name: w\ncontroller: differential_ik\n", "cannot follow the walk"),
    ],
)
def test_a_walk_that_cannot_be_is_refused_before_the_first_tick(old, new, message):
    assert old in WALK
    with pytest.raises(PoiseError, match=message):
        prepare(WALK.replace(old, new, 1))


@pytest.mark.parametrize(
    ("beside", "message"),
    [
        (
            "motions:\n  - {task: com, at: 0.5, over: 1.0, by: [0, 0, 0.1]}",
            "a motion of a task that the walk leads.*com",
        ),
        (
            "motions:\n  - {task: left_hand, at: 0.5, over: 1.0, to: [0, 0, 0.1]}",
            "goes along with the walk.*got 'to'",
        ),
        ("contacts:\n  - {unload: left_sole, at: 1.0}", "contact change of a sole that walks"),
    ],
)
def test_nothing_else_may_move_what_the_walk_leads(beside, message):
    with pytest.raises(PoiseError, match=message):
        prepare(f"{WALK}{beside}\n")


def test_a_block_that_the_walk_is_not_told_of_is_no_ground_of_its_plan(get_robot):
    block = "plant: {blocks: [{center: [0.7, 0.0], size: [0.9, 1.0, 0.02], told: %s}]}"
    robot, found = get_robot("humanoid33"), {}
    for told in ("true", "false"):
        scenario = parse_scenario(WALK + block % told, "walk.yaml")
        walker = scenario.walker(robot, walking_stack(robot))
        found[told] = [step.goal.position[2] for step in walker.plan.steps]
    assert max(found["true"]) == pytest.approx(min(found["false"]) + 0.02, abs=1e-6)
    assert max(found["false"]) == min(found["false"])


DRIVE = """
name: d
duration: 8.0
drive:
  velocities:
    - {at: 0.0, velocity: [0.3, 0.0, 0.0]}
    - {at: 2.0, velocity: [0.0, 0.0, 0.5]}
  limits: {ahead: 0.5}
"""


def test_a_drive_is_read_and_led():
    drive = parse_scenario(DRIVE, "drive.yaml").drive
    assert [v.at for v in drive.velocities] == [0.0, 2.0]
    assert (drive.velocities[1].velocity[2], drive.limits.ahead) == (0.5, 0.5)
    prepare(DRIVE)
    assert "drive" in shipped_scenarios()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("at: 2.0", "at: 0.0", "not one after the other"),
        ("at: 2.0", "at: 9.0", "a velocity of the drive begins outside the run"),
        ("name: d\n", "name: d\nwalk: {strides: [{steps: 2}]}\n", "walks and is driven"),
    ],
)
def test_a_drive_that_cannot_be_is_refused_before_the_first_tick(old, new, message):
    assert old in DRIVE
    with pytest.raises(PoiseError, match=message):
        prepare(DRIVE.replace(old, new, 1))
