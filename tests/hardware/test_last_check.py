"""Commands that the last check lets through, and those in whose place damping goes out."""

import links
import numpy as np
import pytest

from poise.errors import ConfigurationError, UnknownNameError
from poise.hardware import MotorCommand


def replaced(name, joint, value):
    numbers = getattr(links.command(), name).copy()
    numbers[joint] = value
    return links.command(**{name: numbers})


def test_a_command_within_limits_passes():
    check, command = links.make_check(), links.command()
    assert check.check(command, links.state()) is command
    assert (check.refused, check.reason) == (0, "")


@pytest.mark.parametrize("name", ["q", "dq", "kp", "kd", "tau"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300])
def test_numbers_that_are_none_are_refused(name, value):
    check = links.make_check()
    sent = check.check(replaced(name, 1, value), links.state())
    assert sent is check.damping
    assert check.refused == 1
    assert check.reason.startswith(f"{name} of knee is ")


@pytest.mark.parametrize(
    ("name", "value"),
    [("q", 2.01), ("q", -0.01), ("dq", -10.1), ("kp", 201.0), ("kp", -1.0), ("kd", 11.0)]
    + [("kd", -0.1), ("tau", 121.0), ("tau", -121.0)],
)
def test_numbers_beyond_a_limit_are_refused_and_named(name, value):
    check = links.make_check()
    assert check.check(replaced(name, 1, value), links.state()) is check.damping
    assert f"{name} of knee is {value:g}, wanted" in check.reason


def test_targets_without_gains_are_not_looked_at():
    check = links.make_check()
    far = np.full(3, 50.0)
    command = links.command(q=far, dq=far, kp=np.zeros(3), kd=np.zeros(3))
    assert check.check(command, links.state()) is command


def test_margin_and_scale_narrow_the_limits():
    check = links.make_check(margin=0.1, scale=0.5)
    assert check.check(replaced("q", 0, 0.95), links.state()) is check.damping
    assert check.check(replaced("tau", 0, 51.0), links.state()) is check.damping
    assert check.check(replaced("tau", 0, 50.0), links.state()) is not check.damping


def test_a_jump_of_any_field_counts_by_its_torque():
    """A target that moves by 0.9 rad at 20 N m/rad is 18 N m, of 40 N m times the step."""
    state, check = links.state(), links.make_check(step=0.4)
    first = links.command(tau=np.zeros(3))
    assert check.check(first, state) is first
    moved = links.command(tau=np.zeros(3), q=np.array([0.0, 1.0, 0.45]))
    assert check.check(moved, state) is moved
    back = links.command(tau=np.zeros(3), q=np.array([0.0, 1.0, -0.45]))
    assert check.check(back, state) is check.damping
    assert check.reason == "change of torque of ankle is -18, wanted -16 to 16"


def test_the_last_command_after_a_refused_one_is_damping():
    check, state = links.make_check(step=0.6), links.state()
    high, low = (links.command(tau=np.array([s * 50.0, 0.0, 0.0])) for s in (1.0, -1.0))
    assert check.check(high, state) is high
    assert check.check(low, state) is check.damping
    assert check.check(low, state) is low
    assert check.refused == 1


def test_a_state_that_is_none_refuses_all():
    check = links.make_check()
    bad = links.state(dq=(0.0, np.nan, 0.0))
    assert check.check(links.command(), bad) is check.damping
    assert check.check(MotorCommand.damping(np.ones(2)), links.state()) is check.damping
    assert check.refused == 2


def test_damping_is_below_the_torque_limit_at_three_times_the_velocity_limit():
    damping = links.make_check().damping
    fast = 3.0 * links.LIMITS.v_max
    torque = damping.torque(np.array([0.3, 0.3, 0.3]), fast)
    assert np.all(np.abs(torque) <= links.LIMITS.tau_max)
    assert np.all(torque * fast < 0.0)


@pytest.mark.parametrize(
    "settings",
    [{"margin": 0.5}, {"margin": -1.0}, {"scale": 1.5}, {"scale": 0.0}, {"step": 0.0}]
    + [{"kp_max": [1.0, 2.0]}, {"kd_max": np.nan}, {"kd_max": 1.0}, {"damping": -1.0}],
)
def test_settings_that_cannot_be_are_refused(settings):
    with pytest.raises(ConfigurationError, match="got"):
        links.make_check(**settings)


def test_gains_go_by_name():
    assert links.make_check(kp_max={"ankle": 30.0}).kp_max.tolist() == [0.0, 0.0, 30.0]
    with pytest.raises(UnknownNameError, match="hip"):
        links.make_check(kp_max={"hips": 30.0})
