"""The study of the bad operator: same outcome on any number of cores, and falls that are kept."""

import numpy as np
import pytest

pytest.importorskip("mujoco")

from poise.studies.bad_operator.falls_section import run_trials
from poise.studies.bad_operator.trial import Trial, run_trial
from poise.teleop import PAPER_RULES, read_recording
from poise.teleop_sim import replay_teleop
from poise.teleop_sim.bad_operator import BadOperator
from poise.teleop_sim.run import run_teleop


def test_outcomes_do_not_depend_on_the_processes():
    trials = [Trial(seed=200_000 + i, seconds=3.0) for i in range(3)]
    seen = []
    outcomes = run_trials(trials, lambda done, total: seen.append((done, total)), workers=2)
    assert outcomes == [run_trial(trial) for trial in trials]
    assert seen == [(1.0, 3.0), (2.0, 3.0), (3.0, 3.0)]
    assert not any(o.fell for o in outcomes)


def test_an_input_that_made_the_robot_fall_is_kept_and_runs_again(tmp_path):
    for seed in range(200_010, 200_020):
        outcome = run_trial(Trial(seed=seed, seconds=15.0, folder=tmp_path, rules=PAPER_RULES))
        if outcome.fell:
            break
    assert outcome.fell
    assert read_recording(outcome.recording).setup["seed"] == seed
    again = replay_teleop(outcome.recording)
    assert again.fell
    assert again.plant.time == outcome.seconds


def test_a_run_without_a_fall_leaves_no_file(tmp_path):
    outcome = run_trial(Trial(seed=200_000, seconds=1.0, folder=tmp_path))
    assert not outcome.fell
    assert outcome.recording is None
    assert list(tmp_path.iterdir()) == []


def test_the_operator_does_everything_that_is_said_of_it(get_robot):
    robot = get_robot("biped20")
    samples = []

    def noted(controller):
        operator = BadOperator(controller, 200_001)

        class Noted:
            def sample(self, time):
                samples.append(operator.sample(time))
                return samples[-1]

        return Noted()

    run_teleop(robot, noted, duration=20.0)
    given = [s for s in samples if s is not None]
    assert len(given) < len(samples), "it never froze"
    assert any(np.isnan(s.left).any() for s in given), "it never sent rubbish"
    good = np.array([s.right for s in given if not np.isnan(s.left).any()])
    assert np.abs(np.diff(good, axis=0)).max() > 0.15, "it never jumped"
    assert np.abs(good[:, :2]).max() > 0.4, "it never reached far"
