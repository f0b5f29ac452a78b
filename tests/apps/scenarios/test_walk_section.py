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


def test_a_walk_is_read():
    walk = parse_scenario(WALK, "walk.yaml").walk
    assert [s.steps for s in walk.strides] == [4, 2]
    assert (walk.gait.step_time, walk.feedback.dcm_gain, walk.carry) == (0.8, 5.0, None)


def test_walks_are_shipped():
    assert {"walk", "walk_sideways", "walk_step", "walk_turn"} <= set(shipped_scenarios())


def test_a_walk_gets_a_stack_that_can_walk():
    prepare(WALK)


def test_hands_move_beside_a_walk():
    prepare(f"{WALK}motions:\n  - {{task: left_hand, at: 0.5, over: 1.0, by: [0.1, 0, 0.1]}}\n")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("steps: 4", "steps: 4.5", "steps.*4.5.*whole number"),
        ("steps: 4", "steps: 400", "too many steps"),
        ("length: 0.1", "lenght: 0.1", "unknown key.*lenght.*choices: length"),
        ("length: 0.1", "length: 50", "length is out of range"),
        ("step_time: 0.8", "step_time: -1", r"gait.step_time is out of range.*positive.*\[s\]"),
        ("dcm_gain: 5.0", "gain: 5.0", "unknown key.*gain"),
        (
            "dcm_gain: 5.0",
            "early: 0.5",
            r"yaml:9: walk.feedback .*removed; got 'early'; wanted none: it is the",
        ),
        ("length: 0.1", "length: 0.7", "out of reach"),
        ("feedback: {dcm_gain: 5.0}", "carry: [nose]", "no frame task to carry.*nose"),
        ("name: w\n", "name: w\nrobot: arm6\n", "cannot walk on two feet"),
        ("name: w\n", "name: w\ncontroller: differential_ik\n", "cannot follow the walk"),
        ("name: w\n", "name: w\ncontroller: step_teleoperation\n", "cannot follow the walk"),
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
            "motions:\n  - {task: left_foot, at: 0.5, over: 1.0, by: [0, 0, 0.1]}",
            "a motion of a task that the walk leads.*left_foot",
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


def test_the_walk_section_needs_strides():
    with pytest.raises(PoiseError, match="lacks the key 'strides'"):
        parse_scenario("name: w\nduration: 1.0\nwalk: {}\n", "walk.yaml")


def test_a_block_that_the_walk_is_not_told_of_is_no_ground_of_its_plan(get_robot):
    block = "plant: {blocks: [{center: [0.7, 0.0], size: [0.9, 1.0, 0.02], told: %s}]}"
    robot, found = get_robot("humanoid33"), {}
    for told in ("true", "false"):
        scenario = parse_scenario(WALK + block % told, "walk.yaml")
        walker = scenario.walker(robot, walking_stack(robot))
        found[told] = [step.goal.position[2] for step in walker.plan.steps]
    assert max(found["true"]) == pytest.approx(min(found["false"]) + 0.02, abs=1e-6)
    assert max(found["false"]) == min(found["false"])


def test_whether_a_block_is_told_is_true_or_false():
    with pytest.raises(PoiseError, match="true or false"):
        parse_scenario(
            WALK + "plant: {blocks: [{center: [1, 0], size: [1, 1, 1], told: maybe}]}", "walk.yaml"
        )


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
        ("[0.3, 0.0, 0.0]", "[0.3, 0.0]", "velocity"),
        ("limits: {ahead: 0.5}", "limits: {ahead: -1}", "ahead"),
        ("name: d\n", "name: d\nrobot: arm6\n", "cannot walk on two feet"),
        ("name: d\n", "name: d\ncontroller: differential_ik\n", "cannot follow the walk"),
        ("name: d\n", "name: d\nwalk: {strides: [{steps: 2}]}\n", "walks and is driven"),
    ],
)
def test_a_drive_that_cannot_be_is_refused_before_the_first_tick(old, new, message):
    assert old in DRIVE
    with pytest.raises(PoiseError, match=message):
        prepare(DRIVE.replace(old, new, 1))
