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
