"""The controller around a strategy of the test's own: checks, fallback, rate limit."""

import numpy as np
import pytest

from poise.control import (
    CommandStatus,
    Controller,
    DifferentialIK,
    OperationalSpaceController,
    ReducedController,
    WholeBodyController,
)
from poise.control._fallback import DECAY_TIME, STOP_TIME, Fallback, RateLimit
from poise.control._full_problem import FullProblem
from poise.control._strategy import Answer, Strategy
from poise.dynamics import Dynamics, RobotState
from poise.hqp import SolveStatus
from poise.stack import (
    BalanceLimit,
    FrameTask,
    PostureTask,
    Stack,
    SurfaceContact,
    TorqueLimit,
)


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


class Scripted:
    """Answers what it is told to."""

    def __init__(self, robot, stack, commands="torque"):
        stack.bind(robot)
        self.robot, self.stack, self.commands = robot, stack, commands
        self.answer = Answer(SolveStatus.OPTIMAL, np.ones(robot.nj), (0.0, 0.0))
        self.suspended, self.size, self.contacts, self.calls = (), (1, 1), (), []
        self.softened = {}

    def prepare(self, contacts):
        changed, self.contacts = contacts != self.contacts, contacts
        self.calls.append("prepare")
        return changed

    def rehearse(self, dynamics):
        self.calls.append("rehearse")

    def assemble(self, dynamics):
        self.calls.append("assemble")

    def solve(self):
        self.calls.append("solve")
        return self.answer._replace(joints=self.answer.joints.copy())

    def reset(self):
        self.calls.append("reset")

    def task_residuals(self):
        return {"posture": 0.5}

    def explain(self):
        return "as scripted"


@pytest.fixture
def strategy(robot):
    return Scripted(robot, Stack(levels=[[PostureTask()]]))


def at(robot, time=0.0, speed=0.0):
    return RobotState(robot.q_home, np.full(robot.nv, speed), time=time)


def test_what_users_call_are_controllers_of_one_strategy_each(robot):
    for controller in (WholeBodyController(robot), DifferentialIK(robot, dt=1e-3)):
        assert isinstance(controller, Controller)
        assert isinstance(controller.strategy, Strategy)


def test_a_strategy_of_ones_own_makes_a_controller(robot, strategy):
    controller = Controller(strategy)
    command = controller.step(at(robot))
    assert strategy.calls == ["rehearse", "prepare", "assemble", "solve"]
    assert command.status is CommandStatus.OK
    assert command.torque.tolist() == [1.0] * robot.nj
    assert command.velocity is None
    status = controller.status()
    assert (status.tasks[0].residual, status.explanation) == (0.5, "as scripted")


@pytest.mark.parametrize(
    "make",
    [
        WholeBodyController,
        ReducedController,
        OperationalSpaceController,
        lambda robot: DifferentialIK(robot, dt=1e-3, strategy="hqp"),
    ],
)
def test_the_rehearsed_ticks_leave_nothing_behind(robot, make):
    controller = make(robot)
    assert all(task.residual == 0.0 for task in controller.status().tasks)
    q = robot.q_home.copy()
    q[7:] += 0.05
    controller.step(RobotState(q, np.zeros(robot.nv)))
    # Targets that nobody set are where the robot is, not where it was rehearsed.
    errors = [t.error for t in controller.status().tasks if "posture" not in t.name]
    assert np.abs(errors).max() < 1e-9


@pytest.mark.parametrize(
    ("status", "expected"),
    [
        (SolveStatus.FAILED, CommandStatus.SOLVER_FAILED),
        (SolveStatus.TIME_LIMIT, CommandStatus.TIME_LIMIT),
        (SolveStatus.OPTIMAL, CommandStatus.SOLVER_FAILED),
    ],
)
@pytest.mark.parametrize("commands", ["torque", "velocity"])
def test_an_answer_of_no_use_is_replaced_by_the_last_command_which_decays(
    robot, status, expected, commands
):
    strategy = Scripted(robot, Stack(levels=[[PostureTask()]]), commands)
    controller = Controller(strategy)
    controller.step(at(robot, time=0.0))
    joints = np.ones(robot.nj)
    if status is SolveStatus.OPTIMAL:
        joints[3] = np.nan
    strategy.answer = Answer(status, joints, (0.0, 0.0))
    time_constant = DECAY_TIME if commands == "torque" else STOP_TIME
    for time in (0.01, 0.1, 1.0):
        command = controller.step(at(robot, time=time))
        assert command.status is expected
        found = command.torque if commands == "torque" else command.velocity
        assert found == pytest.approx(np.exp(-time / time_constant), rel=1e-12)
        assert command.residuals == ()


def test_a_fallback_counts_its_ticks_where_the_clock_stands_still(robot, strategy):
    controller = Controller(strategy)
    controller.step(at(robot))
    bad = RobotState(np.full(robot.nq, np.nan), np.zeros(robot.nv))
    found = [controller.step(bad).torque[0] for _ in range(200)]
    assert np.all(np.diff(found) < 0.0)
    assert found[-1] == pytest.approx(np.exp(-0.2 / DECAY_TIME), rel=1e-9)


def test_torques_decay_towards_damping_and_velocities_to_a_stop(robot):
    limit = TorqueLimit()
    limit.bind(robot)
    state = at(robot, time=100.0, speed=0.5)
    torque = Fallback.of_torque(robot, limit).command(state)
    assert torque == pytest.approx(-0.3 * robot.tau_max / robot.v_max * 0.5, rel=1e-12)
    assert not Fallback.of_velocity(robot).command(state).any()


def test_torques_are_clipped_to_their_limits(robot, strategy):
    strategy.answer = strategy.answer._replace(joints=np.full(robot.nj, 1e6))
    assert np.array_equal(Controller(strategy).step(at(robot)).torque, robot.tau_max)


def test_a_rate_limit_goes_straight_towards_the_new_command(robot, strategy):
    controller = Controller(strategy, rate_limit=RateLimit(robot, 0.5))
    assert controller.step(at(robot)).torque[0] == 1.0
    goal = np.linspace(0.0, 3.0, robot.nj)
    strategy.answer = strategy.answer._replace(joints=goal)
    first = controller.step(at(robot, time=1e-3)).torque
    assert np.abs(first - 1.0).max() == pytest.approx(0.5)
    assert first - 1.0 == pytest.approx((goal - 1.0) / 4.0)
    # A fallback in between is where the next step starts from.
    fallback = controller.step(RobotState(np.zeros(0), np.zeros(0))).torque
    again = controller.step(at(robot, time=3e-3)).torque
    assert np.abs(again - fallback).max() == pytest.approx(0.5)
    controller.reset()
    assert np.array_equal(controller.step(at(robot)).torque, goal)


def test_tasks_that_another_set_of_contacts_suspends_forget_where_they_were(robot):
    foot = FrameTask("right_sole", name="foot")
    stack = Stack([SurfaceContact("left_sole")], [[foot], [PostureTask()]])
    strategy = Scripted(robot, stack)
    controller = Controller(strategy)
    controller.step(at(robot))
    foot.evaluate(controller.dynamics)
    assert foot.target_position is not None
    strategy.suspended = (foot,)
    controller.step(at(robot))
    assert foot.target_position is not None
    stack.contacts[0].release(0.0)
    controller.step(at(robot))
    assert foot.target_position is None


def test_row_weights_and_suspended_tasks_reach_the_problem(robot):
    foot, hand = FrameTask("right_sole"), FrameTask("left_hand", "position", weight=[2.0, 3.0, 5.0])
    stack = Stack(
        [SurfaceContact(s) for s in robot.soles],
        [[foot], [hand]],
        balance_limit=BalanceLimit(enabled=False),
    )
    stack.bind(robot)
    full = FullProblem(robot, stack, stack.contacts)
    full.fill(Dynamics(robot))
    assert len(full.problem.level(2).A) == 0
    assert full.problem.level(3).weights.tolist() == [2.0, 3.0, 5.0]
    assert np.array_equal(full.problem.level(3).A[:, : robot.nv], hand.jacobian)
