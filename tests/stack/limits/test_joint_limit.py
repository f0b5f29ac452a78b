"""Joint limits: what a joint can be driven to when it always takes the extreme acceleration."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from oracles import dynamics_at, random_state

from poise.errors import ConfigurationError, UnknownNameError
from poise.stack import JointLimit
from poise.stack._joint_limit import Viability, bound

A_MAX, BRAKING, HORIZON = 200.0, 8.0, 0.02
STOPPING = 0.5
OVERSHOOT = A_MAX * (STOPPING * HORIZON) ** 2 / 2.0
"""What the limit documents: 10 mrad with the defaults."""


def bounds(q, v, q_min, q_max, v_max, a_max=A_MAX, dt=HORIZON, braking=BRAKING):
    """Both bounds, of any joints."""
    brakes, settings = np.full(len(q), braking), np.array([a_max, dt, 0.0])
    limits = {"q_min": q_min, "q_max": q_max, "v_max": v_max}
    viability = Viability(**limits, braking=brakes, gentle=brakes, settings=settings)
    lower, upper = np.zeros(len(q)), np.zeros(len(q))
    bound(viability.address, q, v, lower, upper)
    return lower, upper


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


@pytest.mark.parametrize(
    ("choose", "settings"),
    [
        *((hold(True), {"b": b}) for b in (8.0, 50.0, 200.0)),
        *((choose, {"b": b}) for choose in (hold(False), bang, Swing()) for b in (8.0, 200.0)),
        *((hold(True), {"control": control}) for control in (2e-3, 5e-3, 1e-2)),
        *((hold(True), {"a_max": a, "dt": dt}) for a, dt in ((50.0, 0.02), (200.0, 0.05))),
    ],
)
def test_extreme_accelerations_from_viable_states_keep_every_limit(choose, settings):
    beyond, fast, hard = drive(choose, seed=1, **settings)
    a_max, dt = settings.get("a_max", A_MAX), settings.get("dt", HORIZON)
    # The overshoot that is documented.
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


def test_a_margin_that_leaves_no_range_names_the_joints(get_robot):
    robot = get_robot("humanoid33")
    with pytest.raises(ConfigurationError, match="left_knee"):
        JointLimit(position_margin=10.0).bind(robot)
