"""Torque as feed-forward, and targets that leak towards the measured state."""

import links
import numpy as np
import pytest

import poise
from poise.errors import ConfigurationError
from poise.hardware import TorqueSplit

T = 0.002
OK = poise.CommandStatus.OK


def answer(acceleration, torque=(1.0, 2.0, 3.0)):
    """A command of a robot with a floating base."""
    base = np.full(6, 1e3)
    return poise.Command(OK, np.array(torque), acceleration=np.append(base, acceleration))


def make_split(**settings):
    return TorqueSplit(
        links.make_check(), **{"kp": 30.0, "kd": {"knee": 2.0}, "period": T} | settings
    )


def test_the_torque_is_fed_forward_and_gains_go_by_joint():
    sent = make_split().split(answer(np.zeros(3)), links.state())
    assert sent.tau.tolist() == [1.0, 2.0, 3.0]
    assert sent.kp.tolist() == [30.0, 30.0, 30.0]
    assert sent.kd.tolist() == [0.0, 2.0, 0.0]


def test_targets_of_joints_that_follow_are_where_the_joints_will_be():
    split, a = make_split(), np.array([0.5, -1.0, 0.2])
    q, dq = np.array([0.0, 1.0, 0.0]), np.zeros(3)
    for _ in range(200):
        sent = split.split(answer(a), links.state(q=q, dq=dq))
        q, dq = q + T * (dq + T * a), dq + T * a
        np.testing.assert_allclose(sent.q, q, atol=1e-12)
        np.testing.assert_allclose(sent.dq, dq, atol=1e-12)


def test_a_joint_that_is_stuck_gets_the_acceleration_by_the_squared_leakage():
    """With r the discrete leakage by period: dq = a / r, q = dq / r."""
    split, r = make_split(leakage=20.0), (1.0 - np.exp(-20.0 * T)) / T
    for _ in range(1000):
        sent = split.split(answer(np.array([3.0, 0.0, -2.0])), links.state())
    np.testing.assert_allclose(sent.dq, np.array([3.0, 0.0, -2.0]) / r, atol=1e-9)
    np.testing.assert_allclose(
        sent.q - [0.0, 1.0, 0.0], np.array([3.0, 0.0, -2.0]) / r**2, atol=1e-9
    )


def test_the_last_check_lets_targets_through_at_a_stop():
    check = links.make_check()
    split, state = TorqueSplit(check, kp=100.0, kd=5.0), links.state(q=(1.02, 1.0, 0.0))
    for _ in range(100):
        sent = split.split(answer(np.array([100.0, 0.0, 0.0])), state)
        assert check.check(sent, state) is sent
    assert sent.q[0] == 1.0


def test_a_fallback_starts_the_targets_anew():
    split = make_split()
    for _ in range(50):
        split.split(answer(np.full(3, 5.0)), links.state())
    fallback = poise.Command(poise.CommandStatus.SOLVER_FAILED, np.zeros(3))
    sent = split.split(fallback, links.state(q=(0.1, 1.1, 0.1)))
    assert (sent.q.tolist(), sent.dq.tolist()) == ([0.1, 1.1, 0.1], [0.0, 0.0, 0.0])


def test_numbers_that_are_none_are_refused_and_do_not_stay():
    check, state = links.make_check(), links.state()
    split = TorqueSplit(check, kp=30.0, kd=1.0)
    for bad in (np.nan, np.inf):
        sent = split.split(answer(np.array([0.0, np.nan, 0.0]) + bad), state)
        assert check.check(sent, state) is check.damping
        sent = split.split(answer(np.zeros(3)), state)
        assert check.check(sent, state) is sent


def test_settings_that_cannot_be_are_refused():
    for settings in ({"kp": 201.0}, {"kd": 10.1}, {"period": 0.0}, {"leakage": -1.0}):
        with pytest.raises(ConfigurationError, match="got"):
            make_split(**settings)
