"""Tasks, contacts and limits alike: one robot each, checked numbers, no assignment."""

import numpy as np
import pytest

from poise.errors import ConfigurationError
from poise.stack import (
    BalanceLimit,
    ComTask,
    FrameTask,
    JointLimit,
    JointTask,
    MomentumTask,
    PointContact,
    PostureTask,
    SelfCollisionLimit,
    SurfaceContact,
    TorqueLimit,
)

NAN, INF = float("nan"), float("inf")
LIMITS = {
    TorqueLimit: ("scale", "rate", "lower", "upper", "tick_lower", "tick_upper"),
    JointLimit: (
        *("acceleration_max", "braking", "braking_of", "horizon", "position_margin"),
        *("velocity_scale", "q_min", "q_max", "lower", "upper"),
    ),
    BalanceLimit: ("enabled", "margin", "decay", "stop_time", "leg_min", "leg_max"),
    SelfCollisionLimit: ("enabled", "margin"),
}
CONTACT = ("friction", "damping", "min_load", "margin", "wrench_lower", "wrench_upper")


@pytest.mark.parametrize(
    "make",
    [
        *(ComTask, MomentumTask, JointTask, PostureTask, *LIMITS),
        *(lambda: FrameTask("left_hand"), lambda: SurfaceContact("left_sole")),
    ],
)
def test_one_robot_is_served(get_robot, make):
    one = make()
    for _ in range(2):
        one.bind(get_robot("g1"))
    with pytest.raises(ConfigurationError, match="already serves another robot; got 'humanoid33'"):
        one.bind(get_robot("humanoid33"))
    assert one.robot is get_robot("g1")


@pytest.mark.parametrize(
    ("make", "names"),
    [*LIMITS.items(), (lambda: SurfaceContact("left_sole"), CONTACT)],
)
def test_what_a_limit_or_contact_is_made_of_is_not_assigned(get_robot, make, names):
    """Controllers took it when they were made: what would not hold is refused."""
    free, bound = make(), make()
    bound.bind(get_robot("g1"))
    for name in names:
        for one in (free, bound):
            with pytest.raises(AttributeError, match=name):
                setattr(one, name, 0.5)


@pytest.mark.parametrize("value", [-0.1, NAN, INF])
@pytest.mark.parametrize(
    ("make", "what", "names"),
    [
        (TorqueLimit, "the torque limit", ("scale", "rate")),
        (
            *(JointLimit, "the joint limit"),
            ("acceleration_max", "braking", "horizon", "position_margin", "velocity_scale"),
        ),
        (
            *(BalanceLimit, "the balance limit"),
            ("margin", "decay", "stop_time", "leg_min", "leg_max", "braking"),
        ),
        (
            *(SelfCollisionLimit, "the self-collision limit"),
            ("margin", "braking", "horizon", "approach_time"),
        ),
        (PointContact, "contact 'left_sole'", ("friction", "damping", "min_load")),
        (
            *(SurfaceContact, "contact 'left_sole'"),
            ("friction", "length", "width", "torsion", "margin", "damping", "min_load"),
        ),
        (ComTask, "task 'com'", ("kp", "kd", "weight")),
    ],
)
def test_numbers_that_cannot_be_are_refused(make, what, names, value):
    first = ("left_sole",) if "contact" in what else ()
    for name in names:
        with pytest.raises(ConfigurationError, match=rf"{name}\b.* of {what}|{name} of {what}"):
            make(*first, **{name: value})


@pytest.mark.parametrize(
    ("make", "arguments"),
    [
        (TorqueLimit, {"scale": 1.5}),
        (TorqueLimit, {"scale": 0.0}),
        (BalanceLimit, {"leg_min": 0.9, "leg_max": 0.8}),
        (BalanceLimit, {"leg_max": 1.2}),
        (ComTask, {"weight": 0.0}),
        (ComTask, {"kp": [1.0, -1.0, 1.0]}),
    ],
)
def test_numbers_out_of_range_are_refused(make, arguments):
    with pytest.raises(ConfigurationError, match=next(reversed(arguments))):
        make(**arguments)


def test_bounds_of_torques_are_the_robots_own_scaled(get_robot):
    robot, limit = get_robot("g1"), TorqueLimit(0.25)
    limit.bind(robot)
    np.testing.assert_array_equal(limit.upper, 0.25 * robot.tau_max)
    np.testing.assert_array_equal(limit.lower, -limit.upper)
