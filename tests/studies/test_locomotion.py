"""The study of locomotion: what it asks of outcomes, whatever they are, and its courses."""

from dataclasses import replace

import pytest

pytest.importorskip("mujoco")

from poise.errors import UnknownNameError
from poise.sim import Plant, PlantConfig
from studies import trial_section
from studies.locomotion import walks
from studies.locomotion.courses import COURSES, make_course
from studies.locomotion.estimated_walk import Outcome, Trial, cell_fault
from studies.locomotion.led_walk import LedOutcome, LedTrial, run_led
from studies.plan import StudyOptions

GOOD = Outcome(
    trial=Trial(robot="g1", seed=0, seconds=1.0),
    fell=False,
    way=5.0,
    velocity_rms=0.01,
    tilt_rms=0.002,
    drift=0.01,
    height=0.01,
    nees=5.0,
)

WALKED = LedOutcome(
    trial=LedTrial(robot="g1", seed=0, seconds=1.0),
    fell=False,
    seconds=1.0,
    rested=True,
    reached=(0.63, 0.26, 0.65),
    steps=9,
    torque_step=0.1,
    torque_steps=0,
    worst_physics=1e-12,
)


def failed(monkeypatch, section, good, change):
    """Names of the findings that do not hold, and the number of all."""

    def run(_, kind, trials, progress, options):
        return {trial: replace(good, trial=trial, **change(trial)) for trial in trials}

    monkeypatch.setattr(trial_section, "run_each", run)
    found = section(StudyOptions(), lambda done, total: None).findings
    return [f.name for f in found if not f.ok], len(found)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({}, None),
        ({"fell": True}, "g1: falls in 20 trials"),
        ({"velocity_rms": 0.06}, "g1: velocity error, rms"),
        ({"tilt_rms": 0.01}, "g1: tilt error, rms"),
        ({"drift": 0.03}, "g1: drift over the way"),
        ({"nees": 200.0}, "g1: NEES of tilt and velocity"),
    ],
)
def test_one_bad_seed_of_a_robot_fails_that_finding_alone(monkeypatch, change, name):
    bad = Trial(robot="g1", seed=3, seconds=60.0)
    names, count = failed(
        monkeypatch, walks.estimation_section, GOOD, lambda t: change if t == bad else {}
    )
    assert names == ([] if name is None else [name])
    assert count == 17


def test_a_fall_on_a_slippery_floor_is_the_controllers_and_one_with_bad_cells_is_not(monkeypatch):
    names, _ = failed(
        monkeypatch,
        walks.estimation_section,
        GOOD,
        lambda t: {"fell": t.friction < 1.0 or t.cells == "zero"},
    )
    assert names == ["cells: zero: falls in 2 trials"]


def test_a_fault_that_does_not_exist_is_refused(get_robot):
    with pytest.raises(UnknownNameError, match="stuck"):
        cell_fault(get_robot("g1"), "cracked", 0)


@pytest.mark.parametrize(
    ("fails", "change", "name"),
    [
        (lambda t: False, {}, None),
        (lambda t: t.push == 0.4 and t.direction == 0.0, {"fell": True}, "0.4 m/s walking, 0 deg"),
        (lambda t: t.push == 0.6 and t.direction == 0.0, {"rested": False}, "0.6 m/s standing, 0"),
        (lambda t: t.velocity == (0.62, 0.0, 0.0), {"reached": (0.5, 0.0, 0.0)}, "ahead"),
    ],
)
def test_a_weak_direction_or_speed_fails_its_finding_alone(monkeypatch, fails, change, name):
    names, count = failed(
        monkeypatch,
        walks.led_section,
        WALKED,
        lambda t: change if t.robot == "g1" and fails(t) and t.seed < 3 else {},
    )
    assert count == 2 * (3 + 2 * 12 + 1)
    if name is None:
        assert names == []
    else:
        (only,) = names
        assert only.startswith("g1")
        assert name in only


def test_two_falls_of_twenty_on_a_course_and_two_while_wandering_fail_alone(monkeypatch):
    falls = {"bumps": 2, "wandering": 2, "delay": 1}
    names, count = failed(
        monkeypatch,
        walks.ground_section,
        WALKED,
        lambda t: {"fell": t.robot == "g1" and t.seed < falls.get(t.course, 0)},
    )
    assert names == ["g1: bumps: falls in 20 trials", "g1: wandering: falls in 10 trials"]
    # Of flat ground and bumps torque steps are judged, too, and of the former contacts.
    assert count == 2 * (len(COURSES) + 1) + 6


def test_a_large_torque_step_on_flat_ground_fails_alone(monkeypatch):
    names, _ = failed(
        monkeypatch,
        walks.ground_section,
        WALKED,
        lambda t: {"torque_step": 0.3 if t.robot == "g1" and t.seed == 4 else 0.1},
    )
    assert names == ["g1: flat ground: torque step"]


@pytest.mark.parametrize("name", COURSES)
def test_a_course_begins_on_level_ground_under_the_feet(get_robot, name):
    """Nothing is higher there than where the robot stands, and it stands in the end."""
    robot, course = get_robot("g1"), make_course(name, 3)
    plant = Plant(robot, PlantConfig(blocks=course.blocks))
    q = robot.q_home.copy()
    q[2] += course.height
    state = plant.reset(q)
    carried = sum(wrench[2] for wrench in state.contacts.values())
    assert carried == pytest.approx(robot.weight, rel=1e-3)
    assert make_course(name, 3) == course


def test_changes_of_torque_are_found_while_walking(get_robot):
    get_robot("g1")
    walked = run_led(LedTrial(robot="g1", seed=0, seconds=2.0, velocity=(0.25, 0.0, 0.0)))
    assert 0.001 < walked.torque_step <= 0.5 + 1e-6
    assert not walked.fell
    assert walked.torque_steps == 0


def test_a_push_that_is_not_withstood_fails_its_stack_and_direction_alone(monkeypatch):
    def run(_, kind, trials, progress, options):
        def falls(t):
            return t.stack == "walking_stack" and t.push < 0.35 and t.direction == 6

        return {t: kind(trial=t, fell=falls(t)) for t in trials}

    monkeypatch.setattr(trial_section, "run_each", run)
    found = walks.standing_section(StudyOptions(), lambda done, total: None)
    assert [f.name for f in found.findings if not f.ok] == [
        "walking_stack, 0.33 m/s, 180 degrees: falls in 20 trials"
    ]
    assert len(found.findings) == 24
    assert len(found.tables[0].rows) == 72


@pytest.mark.parametrize(("push", "falls"), [(0.33, False), (0.7, True)])
def test_without_a_step_the_robot_withstands_what_the_pendulum_with_its_feet_does(push, falls):
    trial = walks.StandingPush(stack="walking_stack", seed=90, push=push, direction=6)
    assert walks.run_standing_push(trial).fell is falls
