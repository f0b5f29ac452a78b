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
    Task,
    _evaluation,
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


class OwnTask(Task):
    """The height of the base, in Python; counts how often it is evaluated."""

    def __init__(self, name="own"):
        super().__init__(name, kp=4.0, kd=None, weight=11.0)
        self.calls = 0

    def _resolve(self, robot):
        self._base = robot.frame_id(robot.pelvis)
        return 1

    def _evaluate(self, dynamics):
        self.calls += 1
        frame = dynamics.frame(self._base)
        self.jacobian, self.drift = frame.jacobian[2:3], frame.bias[2:3]
        self.error, self.error_rate = np.array([0.5]), -frame.velocity[2:3]
        return np.array([0.25])


@pytest.fixture
def with_own(robot):
    """The same with a task in Python between the others, and one that is suspended."""
    foot = FrameTask("right_sole", name="foot")
    stack = Stack(
        [SurfaceContact(sole) for sole in robot.soles],
        [[ComTask(), foot, OwnTask()], [FrameTask("left_hand", name="hand")], [PostureTask()]],
    )
    stack.bind(robot)
    return stack


def counted(monkeypatch):
    """The compiled calls that evaluate shipped tasks."""
    calls, run = [], _evaluation.evaluate

    def counting(*arguments):
        calls.append(arguments)
        return run(*arguments)

    monkeypatch.setattr(_evaluation, "evaluate", counting)
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


def test_everything_is_evaluated_once_and_a_suspended_task_never(
    robot, with_own, dynamics, monkeypatch
):
    rows = StackRows(robot, with_own, with_own.contacts)
    com, hand, posture = (with_own.task(name) for name in ("com", "hand", "posture"))
    for task in (com, hand):
        task.hold(dynamics)
    calls, own = counted(monkeypatch), with_own.task("own")
    for update in (rows.update, rows.update_velocities):
        calls.clear()
        before = own.calls
        update(dynamics)
        assert len(calls) == 1
        assert set(rows.evaluation.owners) == {*with_own.contacts, com, own, hand, posture}
        assert own.calls == before + 1
    foot = with_own.task("foot")
    assert rows.suspended == (foot,)
    assert foot.evaluation is None
    assert not foot.jacobian.any()


def test_a_task_of_ones_own_stands_among_the_others(robot, with_own, dynamics):
    rows = StackRows(robot, with_own, with_own.contacts)
    rows.update(dynamics)
    own, base = with_own.task("own"), dynamics.frame(robot.frame_id(robot.pelvis))
    place = dict(rows.task_rows)[own]
    assert place == slice(15, 16)
    assert np.array_equal(rows.J[place], base.jacobian[2:3])
    expected = 4.0 * 0.5 - 4.0 * base.velocity[2] + 0.25 - base.bias[2]
    assert rows.target[15] == pytest.approx(expected, rel=1e-12)
    assert rows.weight[15] == 11.0
    own.set_weight(13.0)
    rows.update_velocities(dynamics)
    assert rows.weight[15] == 13.0
    expected = base.jacobian[2] @ dynamics.state.v + 4.0 / 4.0 * 0.5 - base.velocity[2]
    assert rows.target[15] == pytest.approx(expected, rel=1e-12)


def test_a_kind_with_formulas_of_its_own_is_evaluated_by_them(robot, dynamics):
    class Doubled(ComTask):
        def _evaluate(self, dynamics):
            feedforward = super()._evaluate(dynamics)
            self.jacobian = 2.0 * self.jacobian
            return feedforward

    task, usual = Doubled(name="doubled"), ComTask()
    stack = Stack([], [[task, usual]])
    stack.bind(robot)
    rows = StackRows(robot, stack, ())
    rows.update(dynamics)
    assert np.array_equal(rows.J[:3], 2.0 * rows.J[3:])
    assert np.array_equal(rows.target[:3], rows.target[3:])


def test_gains_and_weights_may_change_from_tick_to_tick(robot, stack, dynamics):
    rows = StackRows(robot, stack, stack.contacts)
    com = stack.task("com")
    com.set_speed(np.inf)
    com.set_target(dynamics.com + 0.1)
    com.set_weight(17.0)
    rows.update(dynamics)
    assert rows.weight[12:15].tolist() == [17.0] * 3
    com.set_acceleration([1.0, 2.0, 3.0])
    rows.update(dynamics)
    assert np.array_equal(rows.target[12:15], np.array([1.0, 2.0, 3.0]) - com.drift)
    com.set_acceleration(None)
    rows.update(dynamics)
    expected = com.kp * 0.1 - com.kd * dynamics.com_velocity - dynamics.com_bias
    assert rows.target[12:15] == pytest.approx(expected, rel=1e-9)


def test_two_sets_of_rows_of_one_stack_show_what_was_evaluated_last(robot, stack, dynamics):
    both, left = (StackRows(robot, stack, stack.contacts[:k]) for k in (2, 1))
    com = stack.task("com")
    for rows in (both, left, both):
        rows.update(dynamics)
        assert np.shares_memory(com.jacobian, rows.J)


def test_a_contact_without_rows_suspends_and_is_evaluated_all_the_same(robot, stack, dynamics):
    left, right = stack.contacts
    rows = StackRows(robot, stack, [left], stance=right)
    rows.update_velocities(dynamics)
    assert rows.suspended == (stack.task("foot"),)
    assert right.jacobian.any()
    assert rows.contact_rows == slice(0, 6)
    # Where it is no contact at all, its foot may move.
    assert StackRows(robot, stack, [left]).suspended == ()


def test_rows_are_written_into_memory_of_a_problem_and_leave_own_rows_alone(robot, stack, dynamics):
    usual = StackRows(robot, stack, stack.contacts)
    usual.update(dynamics)
    rows = StackRows(robot, stack, stack.contacts, own_rows=4)
    count = len(rows.target)
    A, bounds = np.full((5 + count, robot.nv + 3), np.nan), np.full((2, count), np.nan)
    weight, wrenches = np.full(count, np.nan), np.full((2, 12), np.nan)
    rows.write_into(A, 5, tuple(bounds), weight, tuple(wrenches))
    rows.update(dynamics)
    assert np.isnan(A[:, robot.nv :]).all()
    assert np.isnan(A[:5]).all()
    A = A[5:]
    assert np.isnan(A[rows.own_rows]).all()
    assert np.isnan(bounds[:, rows.own_rows]).all()
    kept = np.r_[0:12, 16:count]
    assert np.array_equal(A[kept, : robot.nv], usual.J)
    assert np.array_equal(bounds[:, kept], [usual.target, usual.target])
    assert np.array_equal(weight[kept], usual.weight)
    assert np.array_equal(wrenches, [usual.wrench_lower, usual.wrench_upper])


def test_velocities_are_those_of_the_targets_with_errors_fed_back(robot, stack, dynamics):
    com, hand = stack.task("com"), stack.task("hand")
    com.set_speed(np.inf)
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
    assert cone.shape == (20, 9)
    assert np.array_equal(cone[:16, :6], contacts[0].cone)
    assert np.array_equal(cone[16:, 6:], contacts[1].cone)
    assert not cone[:16, 6:].any()
    assert not cone[16:, :6].any()
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
