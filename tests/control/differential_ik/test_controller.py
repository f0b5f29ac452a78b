"""Commands against integration: stance and contacts stay, tasks move as they were asked to."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import near_home

from poise.control import CommandStatus, Controller, DifferentialIK
from poise.control._differential_ik._controller import STRATEGIES
from poise.control._differential_ik._rows import ROW_WEIGHT
from poise.control._fallback import STOP_TIME
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError, PoiseError, TargetError, UnknownNameError
from poise.stack import (
    ComTask,
    FrameTask,
    JointLimit,
    JointTask,
    MomentumTask,
    PointContact,
    PostureTask,
    Stack,
    SurfaceContact,
)

BIPEDS = ("biped20", "humanoid33", "g1")
LEFT, RIGHT = "left_sole", "right_sole"
DT = 5e-3


def step_stack(*, posture=False):
    """The levels of Zhang and Kikuuwe, eq. (19), for a robot that can stand on either foot."""
    levels = [
        [ComTask(kp=400.0), FrameTask(RIGHT, "orientation", kp=400.0, name="turn")],
        [
            MomentumTask("angular_xy"),
            FrameTask("torso", "orientation", kp=400.0, name="torso"),
            FrameTask(RIGHT, "position", kp=400.0, name="swing"),
        ],
    ]
    if posture:
        levels.append([PostureTask()])
    return Stack([SurfaceContact(LEFT), SurfaceContact(RIGHT)], levels)


def stand_stack():
    return Stack(
        [SurfaceContact(LEFT), SurfaceContact(RIGHT)],
        [
            [ComTask(kp=100.0)],
            [FrameTask("torso", "orientation", kp=100.0, name="torso")],
            [FrameTask("right_hand", "position", kp=100.0, name="hand")],
            [PostureTask()],
        ],
    )


def on_one_foot(stack):
    stack.contact(RIGHT).release(0.0)
    return stack


def run(controller, follower, ticks):
    command = None
    for _ in range(ticks):
        command = controller.step(follower.state())
        assert command.status.ok
        follower.move(command.velocity)
    return command


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("name", BIPEDS)
@pytest.mark.parametrize("seed", range(3))
def test_one_tick_moves_everything_as_it_was_asked_to(get_robot, follow, name, strategy, seed):
    """Single support: the exact level in full, momentum included."""
    robot = get_robot(name)
    stack = on_one_foot(
        Stack(
            [SurfaceContact(LEFT), SurfaceContact(RIGHT)],
            [[ComTask(), MomentumTask(), FrameTask(RIGHT, name="swing")]],
            softening=0.0,
        )
    )
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
    state = near_home(robot, seed, spread=0.03, speed=0.3)
    rng = np.random.default_rng(seed)
    com, swing = 0.1 * rng.normal(size=3), 0.1 * rng.normal(size=6)
    momentum = 0.01 * robot.mass * rng.normal(size=3)
    for task, velocity in (("com", com), ("swing", swing), ("angular momentum", momentum)):
        stack.task(task).set_velocity(velocity)
    command = controller.step(state)
    assert command.status.ok
    h = 1e-6
    forth, back = (follow(robot, LEFT, h, state.q) for _ in range(2))
    forth.move(command.velocity)
    back.move(-command.velocity)
    assert np.abs((forth.com - back.com) / (2.0 * h) - com).max() < 1e-6
    a, b = back.placement(RIGHT), forth.placement(RIGHT)
    assert np.abs((b.translation - a.translation) / (2.0 * h) - swing[:3]).max() < 1e-6
    assert np.abs(pin.log3(b.rotation @ a.rotation.T) / (2.0 * h) - swing[3:]).max() < 1e-6
    v = pin.difference(robot.model, back.q, forth.q) / (2.0 * h)
    assert np.abs(forth.momentum(state.q, v)[3:] - momentum).max() < 1e-5


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("name", BIPEDS)
def test_double_support_holds_both_feet_and_the_tasks_arrive(get_robot, follow, name, strategy):
    robot = get_robot(name)
    stack = stand_stack()
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
    follower = follow(robot, LEFT, DT)
    foot, hand = follower.placement(RIGHT), follower.placement("right_hand").translation
    com = follower.com + [0.01, 0.03, -0.05]
    stack.task("com").set_target(com)
    stack.task("hand").set_target(hand + [0.05, 0.02, 0.08])
    run(controller, follower, 320)
    # Velocities hold the foot, so what is left is the error of the integration.
    moved = foot.actInv(follower.placement(RIGHT))
    assert np.linalg.norm(moved.translation) < 5e-4
    assert np.linalg.norm(pin.log3(moved.rotation)) < 1e-3
    assert np.linalg.norm(follower.com - com) < 1e-4
    assert (
        np.linalg.norm(follower.placement("right_hand").translation - hand - [0.05, 0.02, 0.08])
        < 3e-3
    )
    assert controller.status().command is CommandStatus.OK


@pytest.mark.parametrize("name", BIPEDS)
def test_a_target_that_moves_is_followed_without_lag(get_robot, follow, name):
    """The target's velocity is fed forward: the state's own velocity cancels."""
    robot = get_robot(name)
    stack = stand_stack()
    controller = DifferentialIK(robot, stack, dt=1e-3)
    follower = follow(robot, LEFT, 1e-3)
    start, speed = follower.com, np.array([0.0, 0.02, -0.05])
    for _ in range(300):
        stack.task("com").set_target(start + follower.time * speed, speed)
        follower.move(controller.step(follower.state()).velocity)
    assert np.linalg.norm(follower.com - start - follower.time * speed) < 2e-5


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_only_the_joints_that_were_named_move(get_robot, follow, leg_joints, strategy):
    robot = get_robot("biped20")
    stack = on_one_foot(step_stack())
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy, joints=leg_joints(robot))
    stack.task("com").set_target(Dynamics(robot).com + [0.0, 0.05, -0.05])
    follower = follow(robot, LEFT, DT)
    command = run(controller, follower, 100)
    assert controller.size == (12, 12 + 14)
    assert not command.velocity[12:].any()
    assert (follower.joints[12:] == robot.q_home[7 + 12 :]).all()
    assert np.linalg.norm(follower.com - stack.task("com").target_position) < 2e-3


def test_the_step_teleoperators_levels_solve_the_papers_problem(get_robot, leg_joints):
    """(20) by another solver."""
    qpsolvers = pytest.importorskip("qpsolvers")
    robot = get_robot("biped20")
    stack = on_one_foot(step_stack())
    controller = DifferentialIK(robot, stack, dt=DT, joints=leg_joints(robot))
    weights = {"angular momentum": [0.5, 2.0], "torso": [1e-3, 1e-3, 1e-3], "swing": 30.0}
    for name, weight in weights.items():
        controller.weights[name] = weight
    rng = np.random.default_rng(0)
    for _, task in stack.tasks():
        task.set_velocity(0.1 * rng.normal(size=task.dim))
    # Twice: joint weights go by the last command.
    controller.step(near_home(robot, 1))
    u = controller.step(near_home(robot, 1)).velocity[:12]
    formulation = controller.strategy.current
    _, first, second = formulation.levels
    assert second.weight.tolist() == [0.5, 2.0, 1e-3, 1e-3, 1e-3, 30.0, 30.0, 30.0]
    WA = np.diag(second.weight)
    H = second.jacobian.T @ WA @ second.jacobian + np.diag(controller.joint_weights)
    g = -second.jacobian.T @ WA @ second.velocity
    x = qpsolvers.solve_qp(H, g, A=first.jacobian, b=first.velocity, solver="daqp")
    assert controller.joint_weights.max() > 1.0
    assert np.abs(u - x).max() < 1e-6


@pytest.mark.parametrize("name", BIPEDS)
def test_both_methods_agree_where_every_level_is_met(get_robot, name):
    robot = get_robot(name)
    found = []
    for strategy in STRATEGIES:
        stack = Stack(
            [SurfaceContact(LEFT), SurfaceContact(RIGHT)],
            [[ComTask()], [FrameTask("torso", "orientation", name="torso")]],
        )
        controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
        controller.weights["torso"] = 1e12
        stack.task("com").set_velocity([0.02, 0.03, -0.1])
        stack.task("torso").set_velocity([0.1, 0.0, 0.05])
        found.append(controller.step(RobotState(robot.q_home, np.zeros(robot.nv))).velocity)
    assert np.abs(found[0] - found[1]).max() < 1e-6


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("name", BIPEDS)
def test_priorities_are_strict(get_robot, name, strategy):
    """An impossible hand and an impossible posture take nothing from what stands above them."""
    robot = get_robot(name)
    found = []
    for wild in (False, True):
        stack = stand_stack()
        controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
        stack.task("com").set_velocity([0.01, 0.0, -0.05])
        stack.task("torso").set_velocity([0.0, 0.1, 0.0])
        if wild:
            stack.task("hand").set_velocity([0.5, -0.4, 0.3])
            stack.task("posture").set_velocity(np.full(robot.nj, 0.3))
        command = controller.step(RobotState(robot.q_home, np.zeros(robot.nv)))
        assert command.status.ok
        levels = controller.strategy.current.levels
        found.append([level.jacobian @ command.velocity for level in levels[:3]])
        assert max(command.residuals[:3]) < 1e-9
    for a, b in zip(*found, strict=True):
        assert np.abs(a - b).max() < 1e-6


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("name", ["arm6", "upper17", "panda"])
def test_fixed_arms_reach_their_targets(get_robot, follow, name, strategy):
    robot = get_robot(name)
    hand = robot.hands[0]
    stack = Stack((), [[FrameTask(hand, "position", kp=100.0, name="hand")], [PostureTask()]])
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
    follower = follow(robot, None, DT)
    goal = follower.placement(hand).translation + [-0.08, 0.05, -0.06]
    stack.task("hand").set_target(goal)
    run(controller, follower, 300)
    assert np.linalg.norm(follower.placement(hand).translation - goal) < 1e-4
    assert controller.stance is None
    assert controller.suspended == ()


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize("limit_time", [0.0, 0.1])
@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("name", ["arm6", "biped20", "g1"])
def test_no_joint_ever_passes_its_limits(get_robot, follow, name, strategy, limit_time):
    """Joints are sent far beyond their limits, first all to the upper ones, then at random."""
    robot = get_robot(name)
    contacts = [SurfaceContact(LEFT)] if robot.floating_base else []
    stack = Stack(contacts, [[JointTask(kp=400.0, name="joints")]])
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy, limit_time=limit_time)
    low, high = robot.q_min + 0.01, robot.q_max - 0.01
    q = robot.q_home.copy()
    q[robot.nq - robot.nj :] = high - 0.3
    follower = follow(robot, LEFT if contacts else None, DT, q)
    rng = np.random.default_rng(5)
    for goal in (np.ones(robot.nj), *(rng.choice([-1.0, 1.0], size=robot.nj) for _ in range(2))):
        stack.task("joints").set_target(np.where(goal > 0.0, robot.q_max + 3.0, robot.q_min - 3.0))
        for _ in range(80 if limit_time == 0.0 else 160):
            command = controller.step(follower.state())
            assert command.status.ok
            assert (np.abs(command.velocity) <= robot.v_max).all()
            follower.move(command.velocity)
            assert (follower.joints >= low - 1e-9).all()
            assert (follower.joints <= high + 1e-9).all()
        if goal.min() > 0.0:
            assert (follower.joints > high - 1e-3).all()


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("beyond", [1e-6, 0.02, 0.5])
def test_a_joint_beyond_its_limit_comes_back_and_never_goes_on(get_robot, follow, strategy, beyond):
    robot = get_robot("arm6")
    stack = Stack((), [[JointTask(kp=100.0, name="joints")]])
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
    q = robot.q_home.copy()
    q[1], q[3] = robot.q_max[1] + beyond, robot.q_min[3] - beyond
    follower = follow(robot, None, DT, q)
    target = q.copy()
    target[1], target[3] = robot.q_max[1] + 3.0, robot.q_min[3] - 3.0
    stack.task("joints").set_target(target)
    last = q
    for _ in range(200):
        command = controller.step(follower.state())
        assert command.status.ok
        follower.move(command.velocity)
        assert follower.joints[1] <= max(last[1], robot.q_max[1])
        assert follower.joints[3] >= min(last[3], robot.q_min[3])
        last = follower.q
    assert follower.joints[1] <= robot.q_max[1]
    assert follower.joints[3] >= robot.q_min[3]


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_stretched_arm_asks_for_no_wild_velocities(get_robot, follow, strategy):
    """A hand sent beyond its reach: rank is lost, and the joints come to rest."""
    robot = get_robot("arm6")
    stack = Stack((), [[FrameTask("hand", "position", kp=100.0, name="hand")]])
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
    follower = follow(robot, None, DT)
    stack.task("hand").set_target([2.0, 0.1, 0.6])
    fastest = []
    for _ in range(500):
        command = controller.step(follower.state())
        assert command.status.ok
        assert (np.abs(command.velocity) <= robot.v_max).all()
        fastest.append(np.abs(command.velocity).max())
        follower.move(command.velocity)
    if strategy == "closed_form":
        assert max(fastest[-100:]) < 0.05


def test_the_speed_of_a_task_bounds_the_velocity_that_it_asks_for(get_robot):
    robot = get_robot("biped20")
    swing = FrameTask(RIGHT, kp=400.0, speed=(0.3, 0.2), name="swing")
    stack = on_one_foot(
        Stack(
            [SurfaceContact(LEFT), SurfaceContact(RIGHT)],
            [[ComTask(kp=400.0, speed=0.1)], [swing]],
        )
    )
    controller = DifferentialIK(robot, stack, dt=DT)
    home = RobotState(robot.q_home, np.zeros(robot.nv))
    controller.step(home)
    com = stack.task("com")
    com.set_target(com.target_position + [0.0, 0.3, -0.4])
    swing.set_target(swing.target_position + [0.4, 0.0, 0.3], pin.exp3(np.array([0.0, 0.5, 0.0])))
    controller.step(home)
    _, first, second = controller.strategy.current.levels
    assert first.velocity == pytest.approx(0.1 * np.array([0.0, 0.6, -0.8]), abs=1e-12)
    assert second.velocity[:3] == pytest.approx(0.3 * np.array([0.8, 0.0, 0.6]), abs=1e-12)
    assert second.velocity[3:] == pytest.approx([0.0, 0.2, 0.0], abs=1e-9)
    # Small velocities are left as they are; given ones always.
    com.set_target(Dynamics(robot).com + [0.001, 0.0, 0.0])
    swing.set_velocity([1.0, 0.0, 0.0, 0.0, 2.0, 0.0])
    controller.step(home)
    assert first.velocity == pytest.approx([0.01, 0.0, 0.0], abs=1e-12)
    assert second.velocity.tolist() == [1.0, 0.0, 0.0, 0.0, 2.0, 0.0]
    swing.set_velocity(None)
    controller.step(home)
    assert np.linalg.norm(second.velocity[:3]) == pytest.approx(0.3)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_row_weights_decide_within_a_level_from_the_next_tick(get_robot, strategy):
    robot = get_robot("biped20")
    stack = on_one_foot(
        Stack(
            [SurfaceContact(LEFT), SurfaceContact(RIGHT)],
            [[ComTask()], [PostureTask(kp=0.0), MomentumTask(), FrameTask(RIGHT, name="swing")]],
        )
    )
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
    stack.task("swing").set_velocity([0.3, 0.0, 0.2, 0.0, 0.0, 0.0])
    home = RobotState(robot.q_home, np.zeros(robot.nv))
    assert controller.weights["swing"].tolist() == [ROW_WEIGHT] * 6

    def missed():
        controller.step(home)
        return next(t for t in controller.status().tasks if t.name == "swing").residual

    usual = missed()
    controller.weights[stack.task("swing")] = 1e8
    assert missed() < 0.1 * usual
    controller.weights["swing"] = 1e-4
    assert missed() == pytest.approx(np.hypot(0.3, 0.2), rel=1e-3)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_the_stance_can_change_in_double_support_without_a_jump(get_robot, follow, strategy):
    robot = get_robot("humanoid33")
    stack = stand_stack()
    controller = DifferentialIK(robot, stack, dt=1e-3, strategy=strategy)
    follower = follow(robot, LEFT, 1e-3)
    stack.task("com").set_target(follower.com + [0.0, 0.03, -0.1])
    before = run(controller, follower, 100).velocity
    assert controller.stance is stack.contact(LEFT)
    controller.set_stance(RIGHT)
    after = controller.step(follower.state()).velocity
    assert controller.stance is stack.contact(RIGHT)
    assert np.abs(after - before).max() < 0.02 * np.abs(before).max()


def test_the_stance_is_the_first_active_contact_or_the_one_that_was_named(get_robot):
    robot = get_robot("biped20")
    stack = step_stack()
    controller = DifferentialIK(robot, stack, dt=DT, stance=RIGHT)
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    left, right = stack.contacts

    def stance():
        assert controller.step(state).status.ok
        return controller.stance

    assert stance() is right
    controller.set_stance(None)
    assert stance() is left
    assert [t.name for t in controller.suspended] == ["turn", "swing"]
    left.release(0.0)
    assert stance() is right
    controller.set_stance(LEFT)
    # A foot in the air carries nobody.
    assert stance() is right
    left.engage(0.0)
    right.release(0.0)
    assert stance() is left
    assert controller.suspended == ()
    left.release(0.0)
    assert stance() is left
    assert "no contact is active" in controller.status().explanation


def test_a_point_contact_beside_the_stance_is_held_in_place(get_robot, follow):
    robot = get_robot("humanoid33")
    stack = Stack(
        [PointContact("right_hand"), SurfaceContact(LEFT), SurfaceContact(RIGHT)],
        [[ComTask(kp=100.0)], [PostureTask()]],
    )
    controller = DifferentialIK(robot, stack, dt=DT)
    follower = follow(robot, LEFT, DT)
    hand = follower.placement("right_hand").translation
    stack.task("com").set_target(follower.com + [0.0, 0.02, -0.04])
    run(controller, follower, 200)
    assert controller.stance is stack.contact(LEFT)
    assert np.linalg.norm(follower.placement("right_hand").translation - hand) < 1e-3
    assert np.linalg.norm(follower.com - stack.task("com").target_position) < 1e-3


def test_it_is_a_controller_and_says_how_its_tasks_stand(get_robot):
    robot = get_robot("biped20")
    controller = DifferentialIK(robot, stand_stack(), dt=DT)
    assert isinstance(controller, Controller)
    controller.step(RobotState(robot.q_home, np.zeros(robot.nv)))
    assert set(controller.timings) == {"dynamics", "assembly", "solve", "command"}
    text = str(controller.status())
    for task in ("com", "torso", "hand", "posture"):
        assert task in text
    assert [t.level for t in controller.status().tasks] == [3, 4, 5, 6]


def bad_states(robot):
    q, v = robot.q_home, np.zeros(robot.nv)
    nan = q.copy()
    nan[8] = np.nan
    return [
        RobotState(nan, v, time=1.0),
        RobotState(q, np.full(robot.nv, np.inf), time=1.0),
        RobotState(q[:-1], v, time=1.0),
        RobotState(q, v, time=float("nan")),
        RobotState(np.zeros(robot.nq), v, time=1.0),
    ]


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_without_an_answer_velocities_fade_to_a_stop(get_robot, strategy):
    robot = get_robot("biped20")
    stack = stand_stack()
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
    first = controller.step(bad_states(robot)[0])
    assert first.status is CommandStatus.BAD_STATE
    assert not first.velocity.any()
    stack.task("com").set_velocity([0.0, 0.0, -0.1])
    for state in bad_states(robot):
        good = controller.step(RobotState(robot.q_home, np.zeros(robot.nv), time=1.0)).velocity
        for tick in range(1, 400):
            command = controller.step(state)
            assert command.status is CommandStatus.BAD_STATE
            assert not command.status.ok
            share = np.abs(command.velocity).max() / np.abs(good).max()
            assert share <= np.exp(-1e-3 * tick / STOP_TIME) + 1e-12
        assert share < 1e-3


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_velocity_beyond_all_numbers_fails_safely(get_robot, strategy):
    robot = get_robot("biped20")
    stack = stand_stack()
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
    home = RobotState(robot.q_home, np.zeros(robot.nv))
    stack.task("com").set_velocity([0.0, 0.0, -0.1])
    assert controller.step(home).status.ok
    stack.task("com").set_velocity(np.full(3, 1e308))
    command = controller.step(home)
    assert np.isfinite(command.velocity).all()
    assert (np.abs(command.velocity) <= robot.v_max).all()
    stack.task("com").set_velocity([0.0, 0.0, -0.1])
    assert controller.step(home).status.ok


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("name", BIPEDS)
def test_nothing_raises_whatever_comes(get_robot, name, strategy):
    """Random states, targets, weights and contacts: always a finite answer within the limits."""
    robot = get_robot(name)
    stack = stand_stack()
    controller = DifferentialIK(robot, stack, dt=DT, strategy=strategy)
    rng = np.random.default_rng(11)
    failed = 0
    for tick in range(50):
        spread = 10.0 ** rng.uniform(-3, 0.5)
        q = pin.integrate(robot.model, robot.q_home, spread * rng.normal(size=robot.nv))
        v = 10.0 ** rng.uniform(-3, 3) * rng.normal(size=robot.nv)
        size = 10.0 ** rng.uniform(-3, 6)
        stack.task("com").set_target(size * rng.normal(size=3))
        stack.task("hand").set_velocity(size * rng.normal(size=3) if tick % 3 else None)
        controller.weights["posture"] = 10.0 ** rng.uniform(-6, 8, size=robot.nj)
        if tick % 7 == 0:
            contact = stack.contacts[rng.integers(2)]
            (contact.release if contact.active else contact.engage)(0.0)
        if tick % 11 == 0:
            controller.set_stance([LEFT, RIGHT, None][rng.integers(3)])
        command = controller.step(RobotState(q, v, time=DT * tick))
        failed += not command.status.ok
        assert np.isfinite(command.velocity).all()
        assert (np.abs(command.velocity) <= robot.v_max).all()
        str(controller.status())
    assert failed <= (0 if strategy == "closed_form" else 5)


def test_wrong_settings_are_refused(get_robot):
    robot = get_robot("biped20")
    wrong = [
        {"dt": 0.0},
        {"strategy": "cascade"},
        {"joints": ["tail"]},
        {"joints": []},
        {"joints": ["left_knee", "left_knee"]},
        {"joints": "left_knee"},
        {"stance": "pelvis"},
        {"limit_time": -1.0},
    ]
    for settings in wrong:
        with pytest.raises(PoiseError, match="got"):
            DifferentialIK(robot, stand_stack(), **{"dt": DT, **settings})
    with pytest.raises(UnknownNameError, match="closed_form"):
        DifferentialIK(robot, stand_stack(), dt=DT, strategy="closedform")
    with pytest.raises(ConfigurationError, match="stand on"):
        DifferentialIK(robot, Stack([PointContact(LEFT)], [[ComTask()]]), dt=DT)
    with pytest.raises(ConfigurationError, match="kd > 0"):
        DifferentialIK(robot, Stack([SurfaceContact(LEFT)], [[ComTask(kp=10.0, kd=0.0)]]), dt=DT)
    points = Stack([SurfaceContact(LEFT), PointContact("left_hand")], [[ComTask()]])
    with pytest.raises(ConfigurationError, match="left_sole"):
        DifferentialIK(robot, points, dt=DT, stance="left_hand")


def test_wrong_weights_and_velocities_are_refused_and_change_nothing(get_robot):
    robot = get_robot("biped20")
    stack = stand_stack()
    controller = DifferentialIK(robot, stack, dt=DT)
    for bad in (0.0, -1.0, np.nan, [1.0, 2.0], "high"):
        with pytest.raises(ConfigurationError, match="com"):
            controller.weights["com"] = bad
    with pytest.raises(UnknownNameError, match="choices: com"):
        controller.weights["con"] = 1.0
    assert controller.weights["com"].tolist() == [ROW_WEIGHT] * 3
    assert list(controller.weights) == ["com", "torso", "hand", "posture"]
    with pytest.raises(TargetError, match="velocity of task 'com'"):
        stack.task("com").set_velocity([1.0, np.inf, 0.0])
    with pytest.raises(TargetError, match="wrong shape"):
        stack.task("com").set_velocity([1.0])
    assert stack.task("com").given_velocity is None
    early = ComTask("xy")
    early.set_velocity([1.0, 2.0, 3.0])
    with pytest.raises(TargetError, match="velocity of task 'com'"):
        early.bind(robot)


def test_the_margin_and_the_scale_of_the_stacks_joint_limit_count(get_robot):
    robot = get_robot("arm6")
    limit = JointLimit(position_margin=0.2, velocity_scale=0.5)
    stack = Stack((), [[JointTask(kp=400.0, name="joints")]], joint_limit=limit)
    controller = DifferentialIK(robot, stack, dt=DT)
    stack.task("joints").set_velocity(np.full(robot.nj, 100.0))
    q = robot.q_home.copy()
    assert controller.step(RobotState(q, q * 0.0)).velocity == pytest.approx(0.5 * robot.v_max)
    q[2] = robot.q_max[2] - 0.2
    assert controller.step(RobotState(q, q * 0.0)).velocity[2] == pytest.approx(0.0, abs=1e-9)
