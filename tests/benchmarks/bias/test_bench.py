"""Times of the bias formulas: the formulas that are timed agree, on a motion as in the paper."""

import numpy as np
import pytest

from benchmarks.bias import time_formulas
from benchmarks.bias.formulas import FORMULAS
from benchmarks.bias.recording import BiasInputs, record_motion
from poise.robots import load_robot

NAMES = ["original", "original_plain", "proposed", "numerical", "fused"]


@pytest.fixture(scope="module")
def recorded():
    robot = load_robot("upper17")
    return robot, record_motion(robot)


def test_the_recorded_robot_moves_and_every_task_keeps_its_rank(recorded):
    robot, states = recorded
    assert len(states) == 550
    assert np.ptp([s.q for s in states], axis=0).max() > 0.05
    inputs = BiasInputs(robot)
    for state in states[::50]:
        inputs.of(state)
        assert inputs._recursion.regular


def test_the_torso_of_the_second_study_turns_by_15_degrees(recorded):
    robot, states = recorded
    turned = states[-1].q - robot.q_home
    assert np.degrees(turned[0]) == pytest.approx(15.0, abs=0.05)
    assert np.abs(np.degrees(turned[1:5])).max() < 0.05


def test_the_timed_formulas_give_the_same_bias_acceleration(recorded):
    robot, states = recorded
    inputs = BiasInputs(robot)
    for state in states[1:300]:
        tick = inputs.of(state)
    found = {name: formula(tick) for name, formula in FORMULAS.items()}
    for i, task in enumerate(tick.tasks[1:]):
        size = np.abs(found["original"][i]).max()
        assert size > 1e-3
        for name, extra in (("original_plain", 0.0), ("proposed", 0.0), ("fused", task.drift_p)):
            np.testing.assert_allclose(
                found[name][i] - extra, found["original"][i], atol=1e-10 * max(size, 1.0)
            )
        # Late by up to a period, but the same quantity.
        np.testing.assert_allclose(found["numerical"][i], found["original"][i], atol=0.1 * size)


def test_every_formula_is_timed_on_every_tick():
    seen = []
    times = time_formulas(60, lambda done, total: seen.append((done, total)))
    assert list(times) == NAMES
    assert seen[-1] == (90.0, 90.0)
    for seconds in times.values():
        assert seconds.shape == (60,)
        assert (seconds > 0.0).all()
