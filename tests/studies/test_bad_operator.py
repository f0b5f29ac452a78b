"""The study of the bad operator: same outcome on any number of cores, and falls that are kept."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from unchecked import run_unchecked

pytest.importorskip("mujoco")

from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    read_recording,
    replay_teleop,
    run_teleop,
)
from poise.locomotion import ScriptedDevice
from studies.bad_operator import FALLS, allowed, conditions, led_trial
from studies.bad_operator.led_trial import Outcome, Trial, run_trial
from studies.bad_operator.operator_section import Asked, none_but_mixed
from studies.trial_section import part
from studies.trials import run_each


def trial(seed, seconds, **changes):
    values = {"robot": "biped20", "level": "velocity", "condition": conditions.NOISE} | changes
    return Trial(seed=seed, seconds=seconds, **values)


@pytest.mark.slow
def test_outcomes_do_not_depend_on_the_processes():
    trials = [trial(200_000 + i, 1.5) for i in range(3)]
    seen = []

    def run(progress, workers):
        return run_each(run_trial, Outcome, trials, progress, workers=workers)

    outcomes = run(lambda done, total: seen.append((done, total)), 2)
    assert list(outcomes) == trials
    assert outcomes == run(lambda done, total: None, 1)
    assert outcomes[trials[0]] == run_trial(trials[0])
    assert seen == [(1.0, 3.0), (2.0, 3.0), (3.0, 3.0)]
    assert not any(o.fell for o in outcomes.values())


def test_a_run_without_a_fall_leaves_no_file(tmp_path):
    outcome = run_trial(trial(200_000, 1.0, folder=tmp_path / "kept"))
    assert not outcome.fell
    assert list((tmp_path / "kept").iterdir()) == []


def test_an_input_that_made_the_robot_fall_is_kept_and_runs_again(tmp_path, monkeypatch):
    def fall(*arguments, **options):
        return replace(run_teleop(*arguments, **options), fell=True)

    monkeypatch.setattr(led_trial, "run_teleop", fall)
    run_trial(trial(200_000, 0.5, folder=tmp_path))
    kept = tmp_path / "seed-200000.mcap"
    assert read_recording(kept).setup.seed == 200_000
    assert replay_teleop(kept).plant.time == pytest.approx(0.5)


OPERATOR = """
import json
import numpy as np
from poise.robots import load_robot
from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, BadOperator, run_teleop
samples = []

def noted(controller):
    operator = BadOperator(controller, 200_001)

    class Noted:
        def sample(self, time):
            samples.append(operator.sample(time))
            return samples[-1]

    return Noted()

run_teleop(load_robot("biped20"), noted, VELOCITY_TELEOP_PLANT, duration=9.0)
given = [s for s in samples if s is not None]
good = np.array([s.place(1) for s in given if not np.isnan(s.place(0)).any()])
print(json.dumps({
    "froze": len(samples) - len(given),
    "rubbish": int(sum(np.isnan(s.place(0)).any() for s in given)),
    "jump": float(np.abs(np.diff(good, axis=0)).max()),
    "far": float(np.abs(good[:, :2]).max()),
}))
"""


def test_the_operator_does_everything_that_is_said_of_it():
    done = run_unchecked(OPERATOR)
    assert done["froze"] > 0, "it never froze"
    assert done["rubbish"] > 0, "it never sent rubbish"
    assert done["jump"] > 0.15, "it never jumped"
    assert done["far"] > 0.4, "it never reached far"


def test_pushes_are_as_strong_as_said_in_order_and_in_all_directions(get_robot):
    robot = get_robot("biped20")
    pushed = [push for seed in range(20) for push in conditions.pushes(robot, seed, 60.0, 0.005)]
    force = np.array([force for _, force, _ in pushed])
    gained = (
        np.linalg.norm(force, axis=1) * np.array([seconds for _, _, seconds in pushed]) / robot.mass
    )
    assert gained == pytest.approx(0.2)
    assert np.abs(force[:, 2]).max() == 0.0
    for axis in (0, 1):
        assert force[:, axis].min() < 0.0 < force[:, axis].max()
    for seed in range(3):
        ticks = [tick for tick, _, _ in conditions.pushes(robot, seed, 60.0, 0.005)]
        assert ticks == sorted(ticks)
        assert 8 <= len(ticks) <= 20


def test_every_condition_changes_what_it_says_and_nothing_else(get_robot):
    robot = get_robot("biped20")
    plant = VELOCITY_TELEOP_PLANT.with_noise()
    changed = {name: change(plant, robot, 3) for name, change in conditions.CONDITIONS.items()}
    told = {"as described", conditions.PUSHED}
    assert {name for name, other in changed.items() if other == plant} == told
    sensors = changed["sensors off by a constant"].sensors
    assert np.rad2deg(np.linalg.norm(sensors.base_orientation_error)) == pytest.approx(1.0)
    assert np.rad2deg(sensors.joint_position_bias) == pytest.approx(0.3)
    assert sensors.force_bias == pytest.approx(0.01 * robot.weight)
    assert np.rad2deg(np.linalg.norm(changed["slope of 3 degrees"].floor_slope)) == pytest.approx(3)
    mixed = changed[conditions.MIXED]
    assert mixed.self_contact
    assert mixed.friction == 0.5
    assert mixed.blocks
    assert mixed.sensors.delay == 0.01


def test_every_other_plant_changes_something_and_the_last_one_all_of_it(get_robot):
    robot, plant = get_robot("g1"), TORQUE_TELEOP_PLANT.with_noise()

    def changed(change):
        other = asdict(change(plant, robot, 3))
        other |= other.pop("sensors")
        return {key: value for key, value in other.items() if usual[key] != value}

    usual = asdict(plant)
    usual |= usual.pop("sensors")
    *single, every = map(changed, conditions.OTHER_PLANTS.values())
    assert all(single)
    assert every == {key: value for change in single for key, value in change.items()}


def test_legs_of_a_robot_that_stands_are_apart():
    outcome = run_trial(trial(200_000, 3.0, condition=conditions.DESCRIBED))
    assert not outcome.fell
    # Feet 0.27 m apart, 0.24 m wide.
    assert 0.0 < outcome.apart < 0.1


def outcomes(falls, count=11):
    stood = Outcome(trial=trial(0, 60.0), fell=False, seconds=60.0, steps=7, tilt=0.4, apart=0.1)
    return [replace(stood, fell=k < falls) for k in range(count)]


@pytest.mark.parametrize(
    ("allowed", "falls"),
    [
        (allowed(Asked("g1", conditions.DESCRIBED)), 1.1),
        (allowed(Asked("biped20", conditions.DESCRIBED, "velocity")), 0.0),
        (none_but_mixed(Asked("g1", conditions.DESCRIBED)), 0.0),
        (none_but_mixed(Asked("g1", conditions.MIXED)), 1.1),
        (part(FALLS["biped20"]), 0.11),
        (part(FALLS["g1"]), 0.55),
    ],
)
def test_falls_that_are_allowed_in_eleven_minutes(allowed, falls):
    assert allowed(outcomes(0)) == pytest.approx(falls)


def test_nothing_is_asked_of_g1_at_velocity_level():
    assert allowed(Asked("g1", conditions.DESCRIBED, "velocity")) is None


def test_pushes_of_a_run_are_recorded_and_come_again(get_robot, tmp_path):
    robot, path = get_robot("biped20"), tmp_path / "pushed.mcap"
    pushes = [(100, *conditions.pushes(robot, 1, 8.0, 0.005)[0][1:])]

    def hands(teleoperator):
        return ScriptedDevice([], *teleoperator.estimator.anchors)

    run = run_teleop(
        robot, hands, VELOCITY_TELEOP_PLANT, duration=1.0, pushes=pushes, recording=path
    )
    calm = run_teleop(robot, hands, VELOCITY_TELEOP_PLANT, duration=1.0)
    assert np.abs(run.log.com[-1] - calm.log.com[-1]).max() > 1e-3
    assert read_recording(path).pushes == pushes
    again = replay_teleop(path)
    assert np.array_equal(again.log.command, run.log.command)
