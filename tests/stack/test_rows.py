"""The rows of a stack: what is in them, in which order, and where they are written."""

import numpy as np
import pytest
from oracles import difference_drift, near_home

from poise.dynamics import Dynamics
from poise.stack import (
    ComTask,
    ContactSets,
    FrameTask,
    PointContact,
    PostureTask,
    Stack,
    StackRows,
    SurfaceContact,
)


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


@pytest.fixture
def stack(robot):
    """Both feet in contact, a task of one of them, and weights that tell rows apart."""
    stack = Stack(
        [SurfaceContact(sole) for sole in robot.soles],
        [
            [ComTask(weight=[2.0, 3.0, 5.0]), FrameTask("right_sole", name="foot")],
            [FrameTask("left_hand", "position", name="hand", weight=7.0)],
            [PostureTask()],
        ],
    )
    stack.bind(robot)
    return stack


@pytest.fixture
def dynamics(robot):
    dynamics = Dynamics(robot)
    dynamics.update(near_home(robot, 0, spread=0.1, speed=1.0))
    return dynamics


def counted(stack):
    """Counts how often each contact and task is evaluated."""
    calls = {}

    def count(owner):
        evaluate = owner.evaluate

        def counting(dynamics):
            calls[owner.name] = calls.get(owner.name, 0) + 1
            evaluate(dynamics)

        owner.evaluate = counting

    for owner in (*stack.contacts, *(task for _, task in stack.tasks()), stack.joint_limit):
        count(owner)
    return calls


def test_rows_stand_contacts_first_then_level_by_level(robot, stack, dynamics):
    rows = StackRows(robot, stack, stack.contacts)
    rows.update(dynamics)
    owners = [*stack.contacts, *(stack.task(n) for n in ("com", "hand", "posture"))]
    assert np.array_equal(rows.J, np.vstack([owner.jacobian for owner in owners]))
    assert rows.ends.tolist() == [12, 15, 18, 18 + robot.nj]
    assert [t.name for t, _ in rows.task_rows] == ["com", "hand", "posture"]


def test_right_hand_sides_are_references_less_what_the_motion_brings_by_itself(
    robot, stack, dynamics
):
    """The drift by differences of J v: it is not small here, and its sign shows."""
    rows = StackRows(robot, stack, stack.contacts)
    rows.update(dynamics)
    state, hand = dynamics.state, robot.frame_id("left_hand")

    def velocity(q, v):
        other = Dynamics(robot)
        other.update(type(state)(q, v))
        return other.frame(hand).jacobian[:3] @ v

    drift = difference_drift(robot, state, velocity)
    assert np.abs(drift).max() > 1.0
    expected = stack.task("hand").reference - drift
    assert np.abs(rows.target[15:18] - expected).max() < 1e-5
    left = stack.contacts[0]
    assert np.abs(left.drift).max() > 1e-2
    assert np.array_equal(rows.target[:6], left.reference - left.drift)


def test_rows_have_the_weights_of_their_tasks(robot, stack):
    rows = StackRows(robot, stack, stack.contacts)
    expected = [1.0] * 12 + [2.0, 3.0, 5.0] + [7.0] * 3 + [1.0] * robot.nj
    assert rows.weight.tolist() == expected


def test_everything_is_evaluated_once_and_a_suspended_task_never(robot, stack, dynamics):
    calls = counted(stack)
    rows = StackRows(robot, stack, stack.contacts)
    for update in (rows.update, rows.update_velocities):
        calls.clear()
        update(dynamics)
        assert {name for name in calls if name != "joint limit"} == {
            *robot.soles,
            "com",
            "hand",
            "posture",
        }
        assert set(calls.values()) == {1}
    assert rows.suspended == (stack.task("foot"),)
    assert rows.levels[0] == (stack.task("com"),)


def test_a_contact_without_rows_suspends_and_is_evaluated_all_the_same(robot, stack, dynamics):
    left, right = stack.contacts
    calls = counted(stack)
    rows = StackRows(robot, stack, [left], stance=right)
    rows.update_velocities(dynamics)
    assert rows.suspended == (stack.task("foot"),)
    assert calls[right.name] == 1
    assert rows.contact_rows == slice(0, 6)
    # Where it is no contact at all, its foot may move.
    assert StackRows(robot, stack, [left]).suspended == ()


def test_rows_are_written_into_memory_of_any_layout_and_leave_own_rows_alone(
    robot, stack, dynamics
):
    usual = StackRows(robot, stack, stack.contacts)
    usual.update(dynamics)
    rows = StackRows(robot, stack, stack.contacts, own_rows=4)
    count = len(rows.target)
    A, bounds = np.full((count, robot.nv + 3), np.nan), np.full((3, count), np.nan)
    rows.write_into(A[:, : robot.nv], bounds[0], bounds[1, :12], bounds[2, :12])
    rows.update(dynamics)
    assert np.isnan(A[:, robot.nv :]).all()
    assert np.isnan(A[rows.own_rows]).all()
    assert np.isnan(bounds[0, rows.own_rows]).all()
    kept = np.r_[0:12, 16:count]
    assert np.array_equal(A[kept, : robot.nv], usual.J)
    assert np.array_equal(bounds[0, kept], usual.target)
    assert np.array_equal(bounds[1, :12], usual.wrench_lower)
    assert np.array_equal(bounds[2, :12], usual.wrench_upper)


def test_velocities_are_those_of_the_targets_with_errors_fed_back(robot, stack, dynamics):
    com, hand = stack.task("com"), stack.task("hand")
    com.set_target(dynamics.com + [0.1, 0.0, -0.2], [0.3, 0.4, 0.5])
    hand.set_velocity([1.0, 2.0, 3.0])
    rows = StackRows(robot, stack, stack.contacts)
    rows.update_velocities(dynamics)
    expected = np.array([0.3, 0.4, 0.5]) + com.kp / com.kd * np.array([0.1, 0.0, -0.2])
    assert rows.target[12:15] == pytest.approx(expected, abs=1e-12)
    assert rows.target[15:18].tolist() == [1.0, 2.0, 3.0]
    assert not rows.target[:12].any()


def test_residuals_are_weighed_and_relative_to_what_a_level_asks_for(robot, stack, dynamics):
    stack.task("com").set_acceleration([10.0, 0.0, 0.0])
    rows = StackRows(robot, stack, stack.contacts)
    rows.update(dynamics)
    dv = np.random.default_rng(0).normal(size=robot.nv)
    found = rows.measure(dv).copy()
    missing = rows.J @ dv - rows.target
    for i, part in enumerate((slice(0, 12), slice(12, 15), slice(15, 18), slice(18, None))):
        W = np.diag(rows.weight[part])
        scale = max(1.0, np.linalg.norm(W @ rows.target[part]))
        assert found[i] == pytest.approx(np.linalg.norm(W @ missing[part]) / scale, rel=1e-12)
    residuals = rows.task_residuals()
    assert list(residuals) == ["com", "hand", "posture"]
    assert residuals["hand"] == pytest.approx(np.linalg.norm(missing[15:18]), rel=1e-12)


def test_cones_stand_in_their_contacts_columns(robot):
    contacts = [SurfaceContact("left_sole"), PointContact("right_hand")]
    stack = Stack(contacts, [[PostureTask()]])
    stack.bind(robot)
    cone = StackRows(robot, stack, contacts).cone
    assert cone.shape == (14, 9)
    assert np.array_equal(cone[:10, :6], contacts[0].cone)
    assert np.array_equal(cone[10:, 6:], contacts[1].cone)
    assert not cone[:10, 6:].any()
    assert not cone[10:, :6].any()
    assert StackRows(robot, stack, ()).cone.shape == (0, 0)


@pytest.mark.parametrize(("count", "prepared"), [(0, 1), (2, 4), (3, 8), (4, 1)])
def test_all_sets_of_few_contacts_are_prepared_and_the_active_one_of_many(robot, count, prepared):
    frames = (*robot.soles, *robot.hands)[:count]
    stack = Stack([PointContact(frame) for frame in frames], [[PostureTask()]])
    stack.bind(robot)
    made = []

    def make(contacts):
        made.append(contacts)
        return object()

    sets = ContactSets(stack, make)
    assert len(sets) == len(made) == prepared
    assert stack.contacts in made
    assert sets.of(stack.contacts) is sets.of(stack.contacts)
    sets.of(stack.contacts[:1])
    assert len(made) <= prepared + 1
