"""Gains as attributes: read, set anew, and never changed past the checks."""

import numpy as np
import pytest

from poise.errors import ConfigurationError
from poise.stack import ComTask, JointTask, MomentumTask, PostureTask


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


@pytest.fixture
def task(robot):
    task = ComTask(kp=30.0)
    task.bind(robot)
    return task


def test_gains_that_are_set_are_read_back(task):
    task.set_gains(49.0)
    np.testing.assert_array_equal((task.kp, task.kd), np.full((2, 3), [[49.0], [14.0]]))
    task.set_gains([1.0, 4.0, 0.0], [2.0, 2.0, 0.0])
    np.testing.assert_array_equal(task.kp, [1.0, 4.0, 0.0])
    np.testing.assert_array_equal(task.kd, [2.0, 2.0, 0.0])
    np.testing.assert_array_equal(task.velocity_gain, [0.5, 2.0, 0.0])
    # Critical again: a damping that was told once is no habit.
    task.set_gains([1.0, 4.0, 9.0])
    np.testing.assert_array_equal(task.kd, [2.0, 4.0, 6.0])


def test_gains_set_before_binding_are_those_of_the_rows(robot):
    task = JointTask(kp=5.0, kd=1.0)
    task.set_gains(16.0)
    task.set_weight(3.0)
    task.bind(robot)
    assert (set(task.kp), set(task.kd), set(task.weight)) == ({16.0}, {8.0}, {3.0})
    one_a_row = ComTask()
    one_a_row.set_gains([1.0, 2.0])
    with pytest.raises(ConfigurationError, match=r"kp of task 'com' \[1/s\^2\].*3 numbers"):
        one_a_row.bind(robot)


def test_stiffness_stays_where_damping_alone_is_set(task, robot):
    task.set_gains(kd=3.0)
    np.testing.assert_array_equal((task.kp, task.kd), np.full((2, 3), [[30.0], [3.0]]))
    unbound = ComTask(kp=9.0)
    unbound.set_gains(kd=1.0)
    unbound.bind(robot)
    np.testing.assert_array_equal((unbound.kp, unbound.kd), np.full((2, 3), [[9.0], [1.0]]))


@pytest.mark.parametrize(
    ("kp", "kd", "what"),
    [
        (-1.0, None, "kp"),
        (np.nan, None, "kp"),
        ("stiff", None, "kp"),
        ([1.0, 2.0], None, "kp"),
        (1.0, -1.0, "kd"),
        (1.0, np.inf, "kd"),
        (1.0, [1.0, 2.0, 3.0, 4.0], "kd"),
    ],
)
def test_gains_that_cannot_be_are_refused_and_change_nothing(task, kp, kd, what):
    with pytest.raises(ConfigurationError, match=f"{what} of task 'com'"):
        task.set_gains(kp, kd)
    assert set(task.kp) == {30.0}
    assert set(task.kd) == {2.0 * 30.0**0.5}


@pytest.mark.parametrize("name", ["kp", "kd", "weight", "velocity_gain"])
def test_gains_are_not_assigned(task, name):
    """Neither as a whole nor number by number: what would not hold is refused."""
    with pytest.raises(AttributeError, match=name):
        setattr(task, name, 50.0)
    with pytest.raises(ValueError, match="read-only"):
        getattr(task, name)[:] = 50.0
    with pytest.raises(ConfigurationError, match="serves no robot yet"):
        getattr(PostureTask(), name)


def test_a_momentum_task_has_one_gain(robot):
    task = MomentumTask()
    task.bind(robot)
    task.set_gains(kd=[1.0, 2.0, 3.0])
    np.testing.assert_array_equal((task.kp, task.kd), [[0.0] * 3, [1.0, 2.0, 3.0]])
    for gains in ({}, {"kp": 1.0, "kd": 1.0}, {"kp": 1.0}):
        with pytest.raises(ConfigurationError, match="one gain"):
            task.set_gains(**gains)
