"""Settings that cannot be right are refused; states that cannot be right give a safe torque."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from oracles import near_home, random_state
from osf_world import stack_for

from poise.control import CommandStatus, OperationalSpaceController, RankTreatment
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.stack import (
    ComTask,
    FrameTask,
    JointTask,
    MomentumTask,
    PointContact,
    PostureTask,
    RelativeFrameTask,
    Stack,
    SurfaceContact,
)


def test_a_stack_without_levels_is_refused(get_any):
    with pytest.raises(ConfigurationError, match="nothing to do"):
        OperationalSpaceController(get_any("arm6"), Stack())


def test_a_repeated_task_is_refused():
    task = PostureTask()
    with pytest.raises(ConfigurationError, match="posture"):
        Stack(levels=[[task], [task]])


@pytest.mark.parametrize(
    ("levels", "error"),
    [
        ([], ConfigurationError),
        ([[]], ConfigurationError),
        ([[PostureTask()], [PostureTask()]], ConfigurationError),
        ([[FrameTask("third_hand")]], UnknownNameError),
    ],
)
def test_levels_that_are_none_leave_the_controller_as_it_was(get_any, levels, error):
    robot = get_any("arm6")
    controller = OperationalSpaceController(robot)
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    before, stack = controller.step(state), controller.stack
    with pytest.raises(error):
        controller.set_levels(levels)
    assert controller.stack is stack
    after = controller.step(state)
    assert (after.torque == before.torque).all()


@pytest.mark.parametrize(
    ("low", "high"),
    [(0.2, 0.1), (0.1, 0.1), (0.0, 0.1), (0.1, 2.0), (-0.1, 0.1)],
)
def test_thresholds_out_of_order_are_refused(low, high):
    with pytest.raises(ConfigurationError, match="threshold"):
        RankTreatment(low=low, high=high)


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.nan, [1.0, 2.0], [1.0] * 5 + [-1.0]])
def test_a_torque_step_that_is_no_bound_is_refused(get_any, wrong):
    with pytest.raises(ConfigurationError, match="torque_step"):
        OperationalSpaceController(get_any("arm6"), torque_step=wrong)


def test_steps_may_be_bounded_joint_by_joint(get_any):
    robot = get_any("arm6")
    bound = np.linspace(0.1, 0.6, 6)
    controller = OperationalSpaceController(robot, torque_step=bound)
    first = controller.step(near_home(robot, 0, spread=0.5, speed=1.0)).torque
    second = controller.step(near_home(robot, 1, spread=0.5, speed=1.0, time=1e-3)).torque
    ratio = np.abs(second - first) / bound
    assert ratio.max() == pytest.approx(1.0)
    # All joints go the same share of their way.
    free = OperationalSpaceController(robot, torque_step=math.inf)
    assert free.step(near_home(robot, 0, spread=0.5, speed=1.0)).torque == pytest.approx(first)
    wanted = free.step(near_home(robot, 1, spread=0.5, speed=1.0, time=1e-3)).torque - first
    assert np.linalg.matrix_rank(np.array([second - first, wanted]), tol=1e-6) == 1


@pytest.mark.parametrize("name", ["arm6", "humanoid33"])
@pytest.mark.parametrize(
    "spoil",
    [
        lambda s: RobotState(np.full_like(s.q, np.nan), s.v),
        lambda s: RobotState(s.q, np.full_like(s.v, np.inf)),
        lambda s: RobotState(s.q[:-1], s.v),
        lambda s: RobotState(s.q, np.zeros(len(s.v) + 1)),
        lambda s: RobotState(s.q, s.v, time=math.nan),
    ],
    ids=["nan q", "inf v", "short q", "long v", "nan time"],
)
def test_a_bad_state_gives_a_safe_torque_and_says_so(get_any, name, spoil):
    robot = get_any(name)
    controller = OperationalSpaceController(robot)
    good = near_home(robot, 0, spread=0.02)
    before = controller.step(good).torque
    command = controller.step(spoil(good))
    assert command.status is CommandStatus.BAD_STATE
    assert np.isfinite(command.torque).all()
    assert (np.abs(command.torque) <= robot.tau_max).all()
    assert controller.status().command is CommandStatus.BAD_STATE
    # And back, within the bound of a step.
    after = controller.step(good)
    assert after.status.ok
    assert (np.abs(after.torque - command.torque) <= 0.1 * robot.tau_max * (1 + 1e-9)).all()
    assert (np.abs(command.torque - before) <= 0.1 * robot.tau_max * (1 + 1e-9)).all()


def test_a_bad_state_at_first_is_survived(get_any):
    robot = get_any("humanoid33")
    controller = OperationalSpaceController(robot)
    bad = RobotState(np.full(robot.nq, np.nan), np.zeros(robot.nv))
    assert (controller.step(bad).torque == 0.0).all()
    assert controller.step(RobotState(robot.q_home, np.zeros(robot.nv))).status.ok


def test_reset_frees_the_torque_and_forgets_held_targets(get_any):
    robot = get_any("arm6")
    hand = FrameTask(robot.hands[0])
    controller = OperationalSpaceController(robot, Stack(levels=[[hand], [PostureTask()]]))
    controller.step(near_home(robot, 0, spread=0.3))
    held = hand.target_position.copy()
    controller.reset()
    state = near_home(robot, 1, spread=0.3, time=1e-3)
    after = controller.step(state)
    assert np.linalg.norm(hand.target_position - held) > 1e-3
    fresh = OperationalSpaceController(robot, Stack(levels=[[FrameTask("hand")], [PostureTask()]]))
    assert np.abs(after.torque - fresh.step(state).torque).max() < 1e-9


def tasks_of(robot):
    """One of every kind, anew."""
    return [
        lambda: ComTask(),
        lambda: ComTask("xy", kp=500.0, name="com xy"),
        lambda: FrameTask(robot.hands[0]),
        lambda: FrameTask(robot.hands[-1], "position", name="reach"),
        lambda: FrameTask(robot.pelvis, "orientation", name="upright"),
        lambda: FrameTask(robot.torso, "orientation_xy", kp=2000.0, name="torso"),
        lambda: MomentumTask("angular_xy"),
        lambda: JointTask(robot.joint_names[:3], kp=1000.0),
        lambda: PostureTask(),
        lambda: RelativeFrameTask(robot.hands[0], robot.torso, name="relative"),
    ]


CONTACTS = {
    "none": lambda robot: [],
    "both": lambda robot: [SurfaceContact(s) for s in robot.soles],
    "left": lambda robot: [SurfaceContact(next(iter(robot.soles)))],
    "points": lambda robot: [PointContact(s) for s in robot.soles],
    "mixed": lambda robot: [
        SurfaceContact("left_sole", friction=0.05),
        PointContact("right_sole"),
    ],
}


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_no_stack_and_no_state_makes_it_raise_or_leave_its_limits(get_any, data):
    """Any tasks in any order on any contacts, in any posture and at any speed."""
    name = data.draw(st.sampled_from(["arm6", "humanoid33"]))
    robot = get_any(name)
    makers = tasks_of(robot)
    chosen = data.draw(
        st.lists(st.sampled_from(range(len(makers))), min_size=1, max_size=6, unique=True)
    )
    cuts = data.draw(st.lists(st.booleans(), min_size=len(chosen) - 1, max_size=len(chosen) - 1))
    levels = [[makers[chosen[0]]()]]
    for index, cut in zip(chosen[1:], cuts, strict=True):
        if cut:
            levels.append([])
        levels[-1].append(makers[index]())
    kinds = ["none"] if name == "arm6" else sorted(CONTACTS)
    contacts = CONTACTS[data.draw(st.sampled_from(kinds))](robot)
    controller = OperationalSpaceController(robot, Stack(contacts, levels))
    seed = data.draw(st.integers(0, 10_000))
    speed = data.draw(st.sampled_from([0.0, 0.1, 1.0, 30.0]))
    last = None
    for k in range(3):
        make = random_state if data.draw(st.booleans()) else near_home
        command = controller.step(make(robot, seed + k, speed=speed, time=2e-3 * k))
        assert np.isfinite(command.torque).all()
        assert (np.abs(command.torque) <= robot.tau_max).all()
        if last is not None:
            assert (np.abs(command.torque - last) <= 0.1 * robot.tau_max * (1 + 1e-9)).all()
        last = command.torque
        assert str(controller.status())
        if k == 1:
            controller.set_levels(list(reversed(controller.stack.levels)))


def test_stack_for_fits_every_robot(get_any):
    for name in ("arm6", "panda", "upper17", "humanoid33", "humanoid33 fixed"):
        robot = get_any(name)
        command = OperationalSpaceController(robot, stack_for(robot)).step(
            RobotState(robot.q_home, np.zeros(robot.nv))
        )
        assert command.status.ok
