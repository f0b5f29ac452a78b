"""The study of the bad operator: same outcome on any number of cores, and falls that are kept."""

import pytest
from unchecked import run_unchecked

pytest.importorskip("mujoco")

from studies.bad_operator.falls_section import Trial, run_trial, run_trials


@pytest.mark.slow
def test_outcomes_do_not_depend_on_the_processes():
    trials = [Trial(seed=200_000 + i, seconds=3.0) for i in range(3)]
    seen = []
    outcomes = run_trials(trials, lambda done, total: seen.append((done, total)), workers=2)
    assert outcomes == run_trials(trials, lambda done, total: None, workers=1)
    assert outcomes[0] == run_trial(trials[0])
    assert seen == [(1.0, 3.0), (2.0, 3.0), (3.0, 3.0)]
    assert not any(o.fell for o in outcomes)


FALL = """
import json, sys
from pathlib import Path
from dataclasses import replace
from studies.bad_operator.falls_section import Trial, run_trial
from poise.locomotion import StepTeleoperator, read_recording
from poise.apps.teleoperation import replay_teleop
from poise.robots import load_robot
# Soft feet that may leave the ground whenever the ZMP is near: it falls soon.
careless = replace(StepTeleoperator(load_robot("biped20")).parameters, w_S2=1.0, capture_max=1e3,
                   ct_zmp_max=1e3, momentum_leak=1e-9, velocity_leak=1e-9, lower_speed=1.0,
                   touch_speed=1.0, stoop_max=1e-9)
for seed in range(200_010, 200_020):
    trial = Trial(seed=seed, seconds=15.0, folder=Path(sys.argv[1]), parameters=careless)
    outcome = run_trial(trial)
    if outcome.fell:
        break
again = replay_teleop(outcome.recording)
print(json.dumps({
    "fell": [outcome.fell, again.fell],
    "seconds": [outcome.seconds, again.plant.time],
    "seed": [seed, read_recording(outcome.recording).setup["seed"]],
}))
"""


def test_an_input_that_made_the_robot_fall_is_kept_and_runs_again(tmp_path):
    found = run_unchecked(FALL, tmp_path)
    assert found["fell"] == [True, True]
    for before, after in (found["seconds"], found["seed"]):
        assert before == after


def test_a_run_without_a_fall_leaves_no_file(tmp_path):
    outcome = run_trial(Trial(seed=200_000, seconds=1.0, folder=tmp_path))
    assert not outcome.fell
    assert outcome.recording is None
    assert list(tmp_path.iterdir()) == []


OPERATOR = """
import json
import numpy as np
from poise.robots import load_robot
from poise.apps.teleoperation import BadOperator, run_teleop
samples = []

def noted(controller):
    operator = BadOperator(controller, 200_001)

    class Noted:
        def sample(self, time):
            samples.append(operator.sample(time))
            return samples[-1]

    return Noted()

run_teleop(load_robot("biped20"), noted, duration=20.0)
given = [s for s in samples if s is not None]
good = np.array([s.right for s in given if not np.isnan(s.left).any()])
print(json.dumps({
    "froze": len(samples) - len(given),
    "rubbish": int(sum(np.isnan(s.left).any() for s in given)),
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
