import numpy as np
import pytest

from poise.errors import ConfigurationError
from poise.stack import JointLimit, TorqueLimit


def test_bounds_are_the_robots_own_scaled(get_robot):
    robot = get_robot("g1")
    limit = TorqueLimit(0.25)
    limit.bind(robot)
    assert np.array_equal(limit.upper, 0.25 * robot.tau_max)
    assert np.array_equal(limit.lower, -limit.upper)


@pytest.mark.parametrize("scale", [0.0, -0.5, 1.5, float("nan"), float("inf")])
def test_scales_outside_zero_to_one_are_refused(scale):
    with pytest.raises(ConfigurationError, match="scale of the torque limit"):
        TorqueLimit(scale)


def test_a_limit_serves_one_robot(get_robot):
    limit = TorqueLimit()
    limit.bind(get_robot("g1"))
    with pytest.raises(ConfigurationError, match="already serves another robot"):
        limit.bind(get_robot("arm6"))


@pytest.mark.parametrize("name", ["scale", "lower", "upper"])
def test_a_torque_limit_is_not_assigned(name):
    """Controllers took it when they were made: what would not hold is refused."""
    with pytest.raises(AttributeError, match=name):
        setattr(TorqueLimit(), name, 0.5)


@pytest.mark.parametrize(
    "name",
    [
        "acceleration_max",
        "braking",
        "horizon",
        "position_margin",
        "velocity_scale",
        "q_min",
        "q_max",
        "lower",
        "upper",
    ],
)
def test_a_joint_limit_is_not_assigned(name):
    with pytest.raises(AttributeError, match=name):
        setattr(JointLimit(), name, 0.5)
