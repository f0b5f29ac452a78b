"""Stacks, contact switching, suspended tasks, status and names."""

import numpy as np
import pytest
from oracles import near_home

from poise.control import (
    CommandStatus,
    ControllerPlan,
    ReducedController,
    WholeBodyController,
    make_controller,
)
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, PoiseError, UnknownNameError
from poise.robots._catalog import catalog_names
from poise.stack import (
    ComTask,
    FrameTask,
    JointTask,
    PointContact,
    PostureTask,
    Stack,
    SurfaceContact,
    TorqueLimit,
    default_stack,
)


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


@pytest.fixture(params=[WholeBodyController, ReducedController])
def kind(request):
    return request.param


def home(robot, time=0.0):
    return RobotState(robot.q_home, np.zeros(robot.nv), time=time)


@pytest.mark.fast_cases(8)
@pytest.mark.parametrize("name", catalog_names())
def test_the_default_stack_of_every_robot_builds_and_solves(get_robot, kind, name):
    robot = get_robot(name)
    controller = kind(robot)
    command = controller.step(home(robot))
    assert command.status.ok
    assert np.isfinite(command.torque).all()
    assert command.torque.shape == (robot.nj,)


def test_a_ramp_goes_on_after_an_outage_where_it_was(robot, kind):
    stack = default_stack(robot)
    right = stack.contacts[1]
    controller = kind(robot, stack)
    controller.step(home(robot, 1.0))
    right.release(0.3)
    for tick in range(51):
        before = controller.step(home(robot, 1.0 + 0.002 * tick))
    for tick in range(100):
        # Now and then the clock is of no use, too.
        time = (1.1 + 0.002 * tick, np.nan, 0.0)[tick % 3]
        bad = RobotState(np.full(robot.nq, np.nan), np.zeros(robot.nv), time=time)
        assert controller.step(bad).status is CommandStatus.BAD_STATE
    after = controller.step(home(robot, 1.302))
    assert right.active
    most = 2.0 / 3.0 * robot.mass * 9.81
    for command in (before, after):
        assert command.wrenches["right_sole"][2] <= most + 1e-6
    assert after.wrenches["right_sole"][2] > 0.5 * before.wrenches["right_sole"][2]


def test_a_contact_that_is_released_leaves_the_problem_and_comes_back(robot, kind):
    stack = default_stack(robot)
    left, right = stack.contacts
    controller = kind(robot, stack)
    weight = robot.mass * 9.81
    assert set(controller.step(home(robot, 0.0)).wrenches) == {"left_sole", "right_sole"}
    right.release(0.1)
    for time in (0.01, 0.06):
        command = controller.step(home(robot, time))
        assert command.status.ok
    assert command.wrenches["right_sole"][2] <= 0.5 * weight + 1e-6
    command = controller.step(home(robot, 0.12))
    assert not right.active
    assert set(command.wrenches) == {"left_sole"}
    assert left.active
    right.engage(0.1)
    command = controller.step(home(robot, 0.13))
    assert command.wrenches["right_sole"][2] == pytest.approx(0.0, abs=1e-6)
    command = controller.step(home(robot, 0.3))
    assert command.wrenches["right_sole"][2] > 0.1 * weight


def test_switching_contacts_back_and_forth_reuses_the_workspaces(robot):
    stack = default_stack(robot)
    controller = WholeBodyController(robot, stack)
    prepared = len(controller.strategy.prepared)
    formulations = []
    for tick in range(6):
        (stack.contacts[1].release if tick % 2 else stack.contacts[1].engage)(0.0)
        assert controller.step(home(robot, 0.01 * tick)).status.ok
        formulations.append(controller.strategy.current)
    assert formulations == formulations[:2] * 3
    assert len(controller.strategy.prepared) == prepared == 4


def test_a_foot_task_waits_while_its_foot_is_in_contact(robot, kind):
    foot = FrameTask("right_sole", name="foot")
    stack = Stack(
        contacts=[SurfaceContact(s) for s in robot.soles],
        levels=[[ComTask("xy")], [foot], [PostureTask()]],
    )
    controller = kind(robot, stack)
    command = controller.step(home(robot, 0.0))
    assert controller.suspended == (foot,)
    assert command.residuals[3] == 0.0
    stack.contact("right_sole").release(0.0)
    controller.step(home(robot, 0.01))
    assert controller.suspended == ()
    # Its target is the pose at lift-off, not that of the first tick.
    assert np.abs(foot.error).max() < 1e-12
    assert controller.status().tasks[1].name == "foot"


def test_a_point_contact_suspends_position_tasks_only(robot):
    tasks = [
        FrameTask("right_sole", axes, name=axes) for axes in ("position", "orientation", "pose")
    ]
    stack = Stack(contacts=[PointContact("right_sole")], levels=[tasks, [PostureTask()]])
    controller = WholeBodyController(robot, stack)
    assert controller.step(home(robot)).status.ok
    assert [t.name for t in controller.suspended] == ["position"]


def test_status_prints_level_error_with_unit_and_residual(robot, kind):
    controller = kind(robot)
    assert "nothing solved yet" in str(controller.status())
    controller.stack.task("com").set_target([0.1, 0.0, 0.8])
    controller.step(near_home(robot, 0))
    status = controller.status()
    text = str(status)
    assert text.startswith("status: ok")
    rows = {line.split("  ")[1].strip(): line for line in text.splitlines() if "  " in line}
    for task in controller.stack.tasks():
        assert task[1].name in text
        assert task[1].unit in text
    assert text.splitlines()[2].split()[:2] == ["3", "com"]
    assert rows
    com = status.tasks[0]
    assert (com.name, com.level, com.unit) == ("com", 3, "m")
    assert com.error == pytest.approx(np.linalg.norm(controller.stack.task("com").error))


def test_status_reports_what_a_task_could_not_have(robot, kind):
    hand = FrameTask("left_hand", "position", name="hand", kp=400.0)
    stack = Stack(
        contacts=[SurfaceContact(s) for s in robot.soles],
        levels=[[ComTask()], [hand], [PostureTask()]],
    )
    controller = kind(robot, stack)
    hand.set_target([5.0, 0.0, 3.0])
    command = controller.step(home(robot))
    task = controller.status().tasks[1]
    missing = hand.jacobian @ command.acceleration + hand.drift - hand.reference
    assert task.residual == pytest.approx(np.linalg.norm(missing), rel=1e-6)
    assert task.residual > 10.0
    explanation = controller.status().explanation
    assert "hand" in explanation
    # One numbering, also where the balance limit has a level that has no number.
    assert f"level {task.level} (hand)" in explanation


def test_reset_forgets_held_targets_and_the_last_command(robot, kind):
    controller = kind(robot)
    controller.step(home(robot))
    held = controller.stack.task("com").target_position
    controller.reset()
    assert controller.stack.task("com").target_position is None
    bad = controller.step(RobotState(np.full(robot.nq, np.nan), np.zeros(robot.nv)))
    assert bad.status is CommandStatus.BAD_STATE
    assert np.array_equal(bad.torque, np.zeros(robot.nj))
    controller.step(near_home(robot, 3))
    assert np.abs(controller.stack.task("com").target_position - held).max() > 1e-4


def test_timings_cover_every_phase(robot, kind):
    controller = kind(robot)
    controller.step(home(robot))
    assert set(controller.timings) == {"dynamics", "assembly", "solve", "command"}
    assert all(t >= 0.0 for t in controller.timings.values())


def test_names_are_found_and_unknown_ones_listed(robot):
    stack = default_stack(robot)
    assert stack.task("com").name == "com"
    assert stack.contact("left_sole") is stack.contacts[0]
    with pytest.raises(UnknownNameError, match="posture"):
        stack.task("postur")
    with pytest.raises(UnknownNameError, match="left_sole"):
        stack.contact("left")


def test_two_contacts_on_one_frame_are_refused():
    with pytest.raises(ConfigurationError, match="on one frame.*left_sole"):
        Stack([SurfaceContact("left_sole"), PointContact("left_sole", name="heel")])


def test_two_contacts_of_one_name_are_refused():
    with pytest.raises(ConfigurationError, match="one name"):
        Stack([SurfaceContact("a", name="foot"), PointContact("b", name="foot")])


def test_two_tasks_of_one_name_are_refused_across_levels():
    with pytest.raises(ConfigurationError, match="two tasks.*com"):
        Stack(levels=[[ComTask("xy")], [ComTask("z")]])


def test_one_task_twice_is_refused():
    task = ComTask()
    with pytest.raises(ConfigurationError, match="two tasks"):
        Stack(levels=[[task], [task]])


def test_an_empty_level_is_refused():
    with pytest.raises(ConfigurationError, match="level 1"):
        Stack(levels=[[ComTask()], []])


def test_unknown_names_are_refused_before_the_first_tick(robot, kind):
    for stack in (
        Stack(levels=[[FrameTask("left_hnad")]]),
        Stack(levels=[[JointTask(["nojoint"])]]),
        Stack(contacts=[SurfaceContact("left_foot_sole")]),
    ):
        with pytest.raises(UnknownNameError, match="choices"):
            kind(robot, stack)


def test_unknown_strategies_and_controllers_are_refused(robot):
    with pytest.raises(UnknownNameError, match="cascade"):
        WholeBodyController(robot, strategy="direkt")
    with pytest.raises(UnknownNameError, match="daqp"):
        WholeBodyController(robot, strategy="cascade", backend="nosolver")
    with pytest.raises(UnknownNameError, match="whole_body"):
        make_controller(robot, plan=ControllerPlan(name="wholebody"))


@pytest.mark.parametrize("name", ["osf", "differential_ik"])
@pytest.mark.parametrize("setting", [{"backend": "daqp"}, {"time_limit": 0.1}], ids=str)
def test_who_takes_no_setting_of_a_solver_says_who_does(robot, name, setting):
    (what,) = setting
    with pytest.raises(ConfigurationError, match=f"{name} takes no {what}; ") as refused:
        make_controller(robot, plan=ControllerPlan(name=name, **setting))
    assert refused.value.choices == ("whole_body", "reduced")
    for choice in refused.value.choices:
        make_controller(robot, plan=ControllerPlan(name=choice, strategy="cascade", **setting))


def test_a_stack_serves_one_robot(get_robot):
    stack = default_stack(get_robot("humanoid33"))
    WholeBodyController(get_robot("humanoid33"), stack)
    with pytest.raises(PoiseError):
        WholeBodyController(get_robot("g1"), stack)


@pytest.mark.parametrize("time_limit", [0.0, -1.0, float("nan")])
def test_a_time_cap_that_is_no_time_is_refused(robot, kind, time_limit):
    with pytest.raises(ConfigurationError, match="time_limit"):
        kind(robot, time_limit=time_limit)


def test_controllers_are_made_by_name(robot):
    controller = make_controller(robot, plan=ControllerPlan(strategy="cascade", backend="daqp"))
    assert controller.step(home(robot)).status.ok


class _Crossing(TorqueLimit):
    """Torque limit whose bounds cross for one joint."""

    def begin(self, time):
        super().begin(time)
        self.tick_lower[-1] = self.tick_upper[-1] + 1.0


def test_a_limit_that_cannot_be_is_named_and_nothing_is_said_of_the_tasks(robot, kind):
    stack = default_stack(robot)
    controller = kind(robot, Stack(stack.contacts, stack.levels, torque_limit=_Crossing()))
    assert controller.step(home(robot)).status is CommandStatus.SOLVER_FAILED
    status = controller.status()
    assert status.explanation == (
        f"bad_problem: bounds that cross in torque limit of {robot.joint_names[-1]}"
    )
    assert all(np.isnan(task.residual) for task in status.tasks)
