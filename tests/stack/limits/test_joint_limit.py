"""Joint limits: what a joint can be driven to when it always takes the extreme acceleration."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from oracles import dynamics_at, random_state

from poise.errors import ConfigurationError, UnknownNameError
from poise.stack import JointLimit
from poise.stack._viability import ViableAcceleration

A_MAX, BRAKING, HORIZON = 200.0, 8.0, 0.02
STOPPING = 0.5
OVERSHOOT = A_MAX * (STOPPING * HORIZON) ** 2 / 2.0
"""What the limit documents: 10 mrad with the defaults."""


def bounds_of(viable, q, v):
    """Upper and lower bounds."""
    lower, upper = np.zeros(len(q)), np.zeros(len(q))
    viable.bounds(q, v, lower, upper)
    return upper, lower


def bounds(q, v, q_min, q_max, v_max, a_max=A_MAX, dt=HORIZON, braking=BRAKING):
    """Both bounds the way `JointLimit` makes them."""
    hard = np.full(len(q), braking)
    viable = ViableAcceleration(q_min, q_max, v_max, a_max=a_max, dt=dt, braking=hard)
    upper, lower = bounds_of(viable, q, v)
    slower = np.where(v > 0.0, upper, lower)
    crossed = lower > upper
    return np.where(crossed, slower, lower), np.where(crossed, slower, upper)


def viable_states(rng, count, a_max):
    """Joints that can still brake before their limits."""
    v_max = rng.uniform(1.0, 20.0, count)
    q_max, q_min = rng.uniform(0.2, 2.0, count), -rng.uniform(0.2, 2.0, count)
    q = rng.uniform(q_min, q_max)
    fastest = np.minimum(v_max, np.sqrt(2.0 * a_max * (q_max - q)))
    slowest = -np.minimum(v_max, np.sqrt(2.0 * a_max * (q - q_min)))
    return q, rng.uniform(slowest, fastest), q_min, q_max, v_max


def drive(
    choose,
    *,
    seed,
    control=1e-3,
    count=3000,
    seconds=0.5,
    a_max=A_MAX,
    dt=HORIZON,
    b=BRAKING,
):
    """Steps many joints with an acceleration held for each tick; returns the worst excesses."""
    rng = np.random.default_rng(seed)
    q, v, q_min, q_max, v_max = viable_states(rng, count, a_max)
    beyond = fast = hard = -np.inf
    for _ in range(int(seconds / control)):
        lower, upper = bounds(q, v, q_min, q_max, v_max, a_max, dt, b)
        a = choose(rng, lower, upper)
        hard = max(hard, np.abs(a).max() - a_max)
        # Within a tick a joint is farthest where it turns round, if it does.
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.clip(np.nan_to_num(-v / a), 0.0, control)
        for t in (turn, control):
            at = q + v * t + 0.5 * a * t * t
            beyond = max(beyond, (at - q_max).max(), (q_min - at).max())
        q, v = q + v * control + 0.5 * a * control**2, v + a * control
        fast = max(fast, (np.abs(v) - v_max).max())
    return beyond, fast, hard


def hold(top):
    return lambda rng, lower, upper: upper if top else lower


def bang(rng, lower, upper):
    return np.where(rng.random(len(lower)) < 0.5, lower, upper)


class Swing:
    """Full acceleration one way for a while, then the other: reaches the highest speeds."""

    def __init__(self):
        self.up = None

    def __call__(self, rng, lower, upper):
        self.up = np.ones(len(lower), bool) if self.up is None else self.up
        self.up ^= rng.random(len(lower)) < 0.02
        return np.where(self.up, upper, lower)


@pytest.mark.parametrize("choose", [hold(True), hold(False), bang, Swing()])
@pytest.mark.parametrize(("seed", "b"), [(0, 8.0), (1, 50.0), (2, 200.0)])
def test_extreme_accelerations_from_viable_states_keep_every_limit(choose, seed, b):
    beyond, fast, hard = drive(choose, seed=seed, b=b)
    assert beyond < OVERSHOOT
    assert fast < 1e-9
    assert hard <= 0.0


@pytest.mark.parametrize("control", [2e-3, 5e-3, 1e-2])
def test_a_control_period_up_to_half_the_horizon_keeps_every_limit(control):
    beyond, fast, hard = drive(hold(True), seed=2, control=control)
    assert beyond < OVERSHOOT
    assert fast < 1e-9
    assert hard <= 0.0


@pytest.mark.parametrize(("a_max", "dt"), [(50.0, 0.02), (500.0, 0.02), (200.0, 0.05)])
def test_the_overshoot_is_as_documented_for_other_settings(a_max, dt):
    beyond, fast, hard = drive(hold(True), seed=3, a_max=a_max, dt=dt)
    assert beyond < a_max * (STOPPING * dt) ** 2 / 2.0
    assert fast < 1e-9
    assert hard <= 0.0


@pytest.mark.parametrize("b", [8.0, 60.0])
def test_who_always_accelerates_from_rest_passes_the_end_by_little(b):
    """As planned: by a fortieth of the documented overshoot for 8 rad/s^2."""
    q = -np.random.default_rng(0).uniform(0.05, 1.5, 300)
    v, ends = np.zeros(300), (np.full(300, -9.0), np.zeros(300), np.full(300, 10.0))
    beyond = -np.inf
    for _ in range(2000):
        a = bounds(q, v, *ends, braking=b)[1]
        q, v = q + 1e-3 * v + 0.5e-6 * a, v + 1e-3 * a
        beyond = max(beyond, q.max())
    assert beyond < OVERSHOOT / 40.0 * b / 8.0


def test_the_limit_gets_out_of_the_way_of_a_joint_at_rest_in_the_middle():
    lower, upper = bounds(*(np.array([x]) for x in (0.0, 0.0, -2.0, 2.0, 10.0)))
    assert upper == A_MAX
    assert lower == -A_MAX


def test_the_range_can_be_used_up_to_its_end():
    """Not viable by standing still: a joint that always accelerates arrives."""
    q, v = np.array([-0.5]), np.array([0.0])
    limits = (np.array([-1.0]), np.array([1.0]), np.array([5.0]))
    fastest = 0.0
    for _ in range(1500):
        a = bounds(q, v, *limits)[1]
        q, v = q + 1e-3 * v + 0.5e-6 * a, v + 1e-3 * a
        fastest = max(fastest, float(v[0]))
    assert q[0] == pytest.approx(1.0, abs=1e-3)
    assert fastest > 4.2  # sqrt(2 b s) from where the braking starts


def test_measurement_noise_at_the_limit_does_not_ask_for_full_braking():
    rng = np.random.default_rng(0)
    q, v = 1.0 + 1e-5 * rng.normal(size=1000), 1e-3 * rng.normal(size=1000)
    ones = np.ones(1000)
    lower, upper = bounds(q, v, -ones, ones, 10.0 * ones)
    assert np.abs(upper).max() < 5.0
    assert (lower <= upper).all()


@pytest.mark.parametrize("depth", [1e-3, 0.1, 1.0])
def test_a_joint_beyond_its_limit_comes_back_and_stays(depth):
    q, v = np.array([1.0 + depth]), np.array([0.0])
    limits = (np.array([-1.0]), np.array([1.0]), np.array([5.0]))
    for _ in range(1000):
        a = bounds(q, v, *limits)[1]
        q, v = q + 1e-3 * v + 0.5e-6 * a, v + 1e-3 * a
    assert q[0] <= 1.0 + 1e-4
    assert abs(v[0]) <= 5.0


number = st.floats(-1e6, 1e6, allow_nan=False)


@settings(max_examples=400, deadline=None)
@given(
    q=number,
    v=number,
    low=st.floats(-10.0, 9.9),
    span=st.floats(1e-6, 20.0),
    v_max=st.floats(1e-3, 1e3),
    a_max=st.floats(1e-2, 1e4),
    dt=st.floats(1e-3, 0.2),
    share=st.floats(1e-3, 1.0),
)
def test_bounds_are_ordered_finite_and_within_the_acceleration_limit_for_any_state(
    q, v, low, span, v_max, a_max, dt, share
):
    one = [np.array([x]) for x in (q, v, low, low + span, v_max)]
    lower, upper = bounds(*one, a_max, dt, share * a_max)
    assert np.isfinite([lower, upper]).all()
    assert -a_max <= lower <= upper <= a_max


@settings(max_examples=200, deadline=None)
@given(v=st.floats(-30.0, 30.0), at=st.floats(-3.0, 3.0))
def test_upper_and_lower_bounds_are_mirror_images(v, at):
    q, v = np.array([at]), np.array([v])
    low, high, fast = np.array([-1.0]), np.array([1.5]), np.array([8.0])
    lower, upper = bounds(q, v, low, high, fast)
    mirrored_lower, mirrored_upper = bounds(-q, -v, -high, -low, fast)
    # Machine code may add up in another order for one side than for the other.
    np.testing.assert_allclose(mirrored_upper, -lower, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(mirrored_lower, -upper, rtol=0.0, atol=1e-9)


@settings(max_examples=200, deadline=None)
@given(v=st.floats(-10.0, 10.0), s=st.floats(0.0, 1.0))
def test_the_upper_bound_shrinks_as_the_limit_comes_nearer(v, s):
    q_max, fast, at = np.ones(1), np.full(1, 20.0), np.array([v])
    viable = ViableAcceleration(
        -q_max, q_max, fast, a_max=A_MAX, dt=HORIZON, braking=BRAKING * q_max
    )
    near, far = (bounds_of(viable, np.array([1.0 - d]), at)[0] for d in (s, s + 1e-3))
    assert near <= far + 1e-6


@pytest.mark.parametrize("seed", range(5))
def test_a_robots_bounds_are_those_of_its_joints(get_robot, seed):
    robot = get_robot("humanoid33")
    limit = JointLimit(position_margin=0.02, velocity_scale=0.5)
    limit.bind(robot)
    state = random_state(robot, seed, speed=5.0)
    limit.evaluate(dynamics_at(robot, state.q, state.v))
    lower, upper = bounds(
        state.q[7:], state.v[6:], robot.q_min + 0.02, robot.q_max - 0.02, 0.5 * robot.v_max
    )
    assert np.array_equal(limit.lower, lower)
    assert np.array_equal(limit.upper, upper)


def test_a_joint_may_have_a_braking_of_its_own(get_robot):
    robot = get_robot("humanoid33")
    name, i = robot.joint_names[3], 3
    limit, hard = JointLimit(braking_of={name: 60.0}), JointLimit(braking=60.0)
    soft = JointLimit()
    state = random_state(robot, 0, speed=5.0)
    for one in (limit, hard, soft):
        one.bind(robot)
        one.evaluate(dynamics_at(robot, state.q, state.v))
    others = np.arange(robot.nj) != i
    assert limit.upper[i] == hard.upper[i]
    assert limit.upper[i] != soft.upper[i] or limit.lower[i] != soft.lower[i]
    assert np.array_equal(limit.upper[others], soft.upper[others])
    assert np.array_equal(limit.lower[others], soft.lower[others])


def test_a_braking_of_no_joint_or_no_number_is_refused(get_robot):
    with pytest.raises(UnknownNameError, match="knees"):
        JointLimit(braking_of={"knees": 60.0}).bind(get_robot("humanoid33"))
    with pytest.raises(ConfigurationError, match="braking of joint 'knee'"):
        JointLimit(braking_of={"knee": -1.0})


@pytest.mark.parametrize(
    "name", ["acceleration_max", "horizon", "position_margin", "velocity_scale"]
)
@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_settings_that_cannot_be_right_are_refused(name, value):
    with pytest.raises(ConfigurationError, match=f"{name} of the joint limit"):
        JointLimit(**{name: value})


def test_a_margin_that_leaves_no_range_names_the_joints(get_robot):
    robot = get_robot("humanoid33")
    with pytest.raises(ConfigurationError, match="left_knee"):
        JointLimit(position_margin=10.0).bind(robot)


def test_a_limit_serves_one_robot(get_robot):
    limit = JointLimit()
    limit.bind(get_robot("g1"))
    limit.bind(get_robot("g1"))
    with pytest.raises(ConfigurationError, match="already serves another robot"):
        limit.bind(get_robot("arm6"))
