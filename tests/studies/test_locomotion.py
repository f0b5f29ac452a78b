"""The study of locomotion: what it says of outcomes, whatever they are."""

from dataclasses import replace
from importlib import import_module

import pytest

pytest.importorskip("mujoco")

from poise.errors import ConfigurationError
from poise.sim import Plant, PlantConfig
from poise.stack import default_stack
from studies.locomotion.courses import COURSES, make_course
from studies.locomotion.estimated_walk import Outcome, Trial
from studies.locomotion.led_walk import LedOutcome, LedTrial, run_led
from studies.locomotion.standing_references import (
    RandomReferences,
    ReferenceOutcome,
    ReferenceTrial,
    run_reference_trial,
)
from studies.locomotion.torque_steps import StandOutcome, StandTrial, run_pushed_stand
from studies.plan import StudyOptions

# By its name: the package has the function of that name.
section = import_module("studies.locomotion.estimation_section")
references = import_module("studies.locomotion.references_section")
steps = import_module("studies.locomotion.steps_section")

GOOD = Outcome(
    trial=Trial(robot="g1", seed=0, seconds=1.0),
    fell=False,
    way=5.0,
    slipped=0.0,
    velocity_rms=0.01,
    tilt_rms=0.002,
    drift=0.01,
    height=0.01,
    nees=5.0,
    estimator_us=50.0,
)


def findings(monkeypatch, change):
    def run(_, kind, trials, progress, options):
        return {trial: replace(GOOD, trial=trial, **change(trial)) for trial in trials}

    monkeypatch.setattr(section, "run_each", run)
    found = section.estimation_section(StudyOptions(), lambda done, total: None).findings
    return {finding.name: finding.ok for finding in found}


def test_good_walks_hold(monkeypatch):
    found = findings(monkeypatch, lambda trial: {})
    assert all(found.values())
    assert len(found) == 17


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"fell": True}, "g1: falls"),
        ({"velocity_rms": 0.06}, "g1: velocity error, rms"),
        ({"tilt_rms": 0.01}, "g1: tilt error, rms"),
        ({"drift": 0.03}, "g1: drift over the way"),
        ({"nees": 200.0}, "g1: NEES of tilt and velocity"),
    ],
)
def test_one_bad_seed_of_a_robot_fails_that_finding_alone(monkeypatch, change, name):
    found = findings(
        monkeypatch,
        lambda t: change if t == Trial(robot="g1", seed=3, seconds=60.0) else {},
    )
    assert [key for key, ok in found.items() if not ok] == [name]


def test_a_fall_on_a_slippery_floor_is_the_controllers_and_one_with_bad_cells_is_not(monkeypatch):
    found = findings(monkeypatch, lambda t: {"fell": t.friction < 1.0 or t.fault == "dead"})
    assert [key for key, ok in found.items() if not ok] == ["cells that say nothing: falls"]


def test_a_fault_that_does_not_exist_is_refused():
    with pytest.raises(ConfigurationError, match="stuck"):
        Trial(robot="g1", seed=0, seconds=1.0, fault="cracked")


WALKED = LedOutcome(
    trial=LedTrial(robot="g1", seed=0, seconds=1.0),
    fell=False,
    seconds=1.0,
    rested=True,
    reached=(0.6, 0.26, 0.65),
    steps=9,
    torque_step=0.1,
    torque_steps=0,
    worst_physics=1e-12,
)


STOOD = ReferenceOutcome(
    trial=ReferenceTrial(robot="g1", seed=0),
    fell=False,
    time=5.0,
    asked="com jumps",
    held=0.5,
    torque_step=0.3,
    worst_physics=1e-9,
)


def test_a_fall_by_a_reference_fails_its_robot_and_strategy_and_says_what_was_asked(monkeypatch):
    def run(_, kind, trials, progress, options):
        return {
            t: replace(STOOD, trial=t, fell=t.robot == "g1" and t.strategy == "weighted")
            for t in trials
        }

    monkeypatch.setattr(references, "run_each", run)
    found = references.references_section(StudyOptions(quick=True), lambda done, total: None)
    fallen = [f for f in found.findings if not f.ok]
    assert [f.name for f in fallen] == ["g1, weighted: falls by random references"]
    assert "com jumps" in fallen[0].note
    assert len(found.findings) == 4
    assert len(found.tables[0].rows) == 6


def test_random_references_are_the_same_for_the_same_seed_and_differ_for_another(get_robot):
    robot = get_robot("g1")
    asked = [RandomReferences(robot, bound(robot), seed).asked for seed in (3, 3, 4)]
    assert asked[0] == asked[1] != asked[2]


def bound(robot):
    stack = default_stack(robot)
    stack.bind(robot)
    return stack


@pytest.mark.slow
@pytest.mark.parametrize("limited", [True, False])
def test_a_far_pelvis_topples_the_robot_without_the_limit_alone(get_robot, limited):
    """A seed in which the pelvis swings far; for the whole time."""
    get_robot("g1")
    outcome = run_reference_trial(ReferenceTrial(robot="g1", seed=31, limited=limited))
    assert outcome.fell is not limited
    assert (outcome.held > 0.0) is limited


def test_a_large_step_fails_its_run_alone_and_runs_without_the_bound_are_only_shown(monkeypatch):
    def led(trials):
        return {t: replace(WALKED, trial=t, torque_step=0.1 if t.bounded else 0.6) for t in trials}

    def stood(trials):
        return {
            t: StandOutcome(
                trial=t,
                fell=False,
                torque_step=0.6 if not t.bounded or t.robot == "g1" else 0.1,
                torque_steps=0,
                worst_physics=1e-12,
            )
            for t in trials
        }

    def run(_, kind, trials, progress, options):
        return (led if kind is LedOutcome else stood)(trials)

    monkeypatch.setattr(steps, "run_each", run)
    found = steps.steps_section(StudyOptions(quick=True), lambda done, total: None)
    assert [f.name for f in found.findings if not f.ok] == ["g1, stand: largest torque step"]
    assert len(found.findings) == 8
    assert len(found.tables[0].rows) == 12


def test_changes_of_torque_are_found_while_standing_and_walking(get_robot):
    get_robot("g1")
    stood = run_pushed_stand(StandTrial(robot="g1", seconds=1.5))
    walked = run_led(LedTrial(robot="g1", seed=0, seconds=2.0, velocity=(0.25, 0.0, 0.0)))
    assert 0.001 < stood.torque_step < walked.torque_step <= 0.5 + 1e-6
    for outcome in (stood, walked):
        assert not outcome.fell
        assert outcome.torque_steps == 0


led = import_module("studies.locomotion.led_section")


def led_findings(monkeypatch, change):
    def run(_, kind, trials, progress, options):
        return {t: replace(WALKED, trial=t, **change(t)) for t in trials}

    monkeypatch.setattr(led, "run_each", run)
    found = led.led_section(StudyOptions(), lambda done, total: None).findings
    return {finding.name: finding.ok for finding in found}


def test_robots_that_are_led_well_hold(monkeypatch):
    found = led_findings(monkeypatch, lambda trial: {})
    assert all(found.values())
    assert len(found) == 12


def test_counts_have_wilsons_interval():
    assert led._counted(19, 20) == "19 of 20 (76 to 99%)"
    assert led._counted(0, 36) == "0 of 36 (0 to 10%)"


@pytest.mark.parametrize(
    ("fails", "change", "name"),
    [
        (lambda t: t.push == 0.4 and t.direction == 0.0, {"fell": True}, "of 0.4 m/s walking"),
        (lambda t: t.push == 0.6 and t.direction == 0.0, {"rested": False}, "of 0.6 m/s standing"),
        (lambda t: t.velocity == (0.62, 0.0, 0.0), {"reached": (0.5, 0.0, 0.0)}, "speed ahead"),
    ],
)
def test_a_weak_direction_or_speed_fails_its_finding_alone(monkeypatch, fails, change, name):
    found = led_findings(
        monkeypatch, lambda t: change if t.robot == "g1" and fails(t) and t.seed < 3 else {}
    )
    failed = [finding for finding, ok in found.items() if not ok]
    assert len(failed) == 1
    assert failed[0].startswith("g1")
    assert name in failed[0]


ground = import_module("studies.locomotion.ground_section")


def test_two_falls_of_twenty_on_a_course_and_two_while_wandering_fail_alone(monkeypatch):
    def run(_, kind, trials, progress, options):
        return {
            t: replace(
                WALKED,
                trial=t,
                fell=t.robot == "g1"
                and t.seed < {"bumps": 2, "wandering": 2, "delay": 1}.get(t.course, 0),
                reached=(0.25, 0.0, 0.0),
            )
            for t in trials
        }

    monkeypatch.setattr(ground, "run_each", run)
    found = ground.ground_section(StudyOptions(), lambda done, total: None)
    failed = [finding.name for finding in found.findings if not finding.ok]
    assert failed == ["g1: bumps", "g1: falls under random velocities on tiles"]
    assert len(found.findings) == 2 * len(COURSES)


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


standing = import_module("studies.locomotion.standing_section")


def test_a_push_that_is_not_stood_fails_its_stack_and_shows_its_direction(monkeypatch):
    def run(_, kind, trials, progress, options):
        def falls(t):
            return t.stack == "walking_stack" and t.push < 0.35 and t.direction == 6

        return {t: kind(trial=t, fell=falls(t)) for t in trials}

    monkeypatch.setattr(standing, "run_each", run)
    found = standing.standing_section(StudyOptions(), lambda done, total: None)
    assert [f.ours for f in found.findings] == [100.0, 0.0]
    assert [f.ok for f in found.findings] == [True, False]
    assert len(found.tables[0].rows) == 6
    assert found.tables[0].rows[3][2:] == (0.0, "180")


@pytest.mark.parametrize(("push", "falls"), [(0.33, False), (0.7, True)])
def test_without_a_step_the_robot_stands_what_the_pendulum_with_its_feet_does(push, falls):
    trial = standing.StandingPush(stack="walking_stack", seed=90, push=push, direction=6)
    assert standing.run_standing_push(trial).fell is falls
