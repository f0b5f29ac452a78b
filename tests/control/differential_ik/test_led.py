"""Joints that are led go as their tasks say, and the others make up for it."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import near_home

from poise.control import DifferentialIK
from poise.control._differential_ik._controller import STRATEGIES
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, PoiseError
from poise.robots import capsules_of
from poise.stack import (
    ComTask,
    FrameTask,
    JointLimit,
    JointTask,
    MomentumTask,
    PostureTask,
    SelfCollisionLimit,
    Stack,
    SurfaceContact,
)

LEFT, RIGHT = "left_sole", "right_sole"
DT = 5e-3


def arms_of(robot, leg_joints):
    return [name for name in robot.joint_names if name not in leg_joints(robot)]


def on_the_left(levels, **limits):
    stack = Stack([SurfaceContact(LEFT), SurfaceContact(RIGHT)], levels, **limits)
    stack.contact(RIGHT).release(0.0)
    return stack


def swing_levels(*led):
    """CoM and swing foot above all, as in step teleoperation, then tasks of joints."""
    return [[ComTask(), FrameTask(RIGHT, name="swing")], [MomentumTask("angular_xy")], *led]


def check_motion(robot, follow, q, u, swing, com=None):
    """Foot and CoM move as they were asked to, by differences of a stance of its own."""
    h = 1e-6
    forth, back = (follow(robot, LEFT, h, q) for _ in range(2))
    forth.move(u)
    back.move(-u)
    if com is not None:
        np.testing.assert_allclose((forth.com - back.com) / (2.0 * h), com, atol=1e-6)
    a, b = back.placement(RIGHT), forth.placement(RIGHT)
    np.testing.assert_allclose((b.translation - a.translation) / (2.0 * h), swing[:3], atol=1e-6)
    turn = pin.log3(b.rotation @ a.rotation.T) / (2.0 * h)
    np.testing.assert_allclose(turn, swing[3:], atol=1e-6)


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("name", ["biped20", "humanoid33", "g1"])
@pytest.mark.parametrize("seed", range(2))
def test_others_make_up_for_what_led_joints_do(get_robot, follow, leg_joints, name, strategy, seed):
    robot, rng = get_robot(name), np.random.default_rng(seed)
    led = arms_of(robot, leg_joints)
    stack = on_the_left(swing_levels([JointTask(led, kp=0.0, name="arms")]))
    controller = DifferentialIK(
        robot, stack, dt=DT, strategy=strategy, joints=leg_joints(robot), led=["arms"]
    )
    state = near_home(robot, seed, spread=0.03, speed=0.3)
    com, swing = 0.05 * rng.normal(size=3), 0.05 * rng.normal(size=6)
    rates = 0.5 * rng.normal(size=len(led))
    stack.task("com").set_velocity(com)
    stack.task("swing").set_velocity(swing)
    index = [robot.joint_index(joint) for joint in led]
    stack.task("arms").set_target(state.q[7:][index], rates)
    command = controller.step(state)
    assert command.status.ok
    np.testing.assert_array_equal(command.velocity[index], rates)
    check_motion(robot, follow, state.q, command.velocity, swing, com)
    assert command.residuals[-1] == 0.0


def test_a_led_joint_below_the_stance_moves_the_base(get_robot, follow, leg_joints):
    """The knee that stands: the base goes with it, and what else the legs do is solved for."""
    robot, rng = get_robot("g1"), np.random.default_rng(3)
    knee = ["left_knee_joint", "waist_yaw_joint"]
    stack = on_the_left([[FrameTask(RIGHT, name="swing")], [JointTask(knee, kp=0.0, name="knee")]])
    controller = DifferentialIK(robot, stack, dt=DT, led=["knee"])
    state, swing = near_home(robot, 3, spread=0.03, speed=0.3), 0.05 * rng.normal(size=6)
    stack.task("swing").set_velocity(swing)
    stack.task("knee").set_target(np.zeros(2), [0.3, -0.2])
    command = controller.step(state)
    index = [robot.joint_index(joint) for joint in knee]
    np.testing.assert_array_equal(command.velocity[index], [0.3, -0.2])
    check_motion(robot, follow, state.q, command.velocity, swing)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_led_joints_at_rest_change_nothing_to_the_last_bit(get_robot, leg_joints, strategy):
    robot = get_robot("g1")
    led = arms_of(robot, leg_joints)
    commands = []
    for names in ([], ["arms"]):
        levels = swing_levels(*([[JointTask(led, kp=0.0, name="arms")]] if names else []))
        limit = SelfCollisionLimit(legs_only=True)
        stack = on_the_left(levels, self_collision_limit=limit)
        controller = DifferentialIK(
            robot, stack, dt=DT, strategy=strategy, joints=leg_joints(robot), led=names
        )
        rng, ticks = np.random.default_rng(0), []
        for k in range(30):
            stack.task("com").set_velocity(0.2 * rng.normal(size=3))
            stack.task("swing").set_velocity(0.5 * rng.normal(size=6))
            ticks.append(controller.step(near_home(robot, k, spread=0.05, speed=0.3)).velocity)
        commands.append(ticks)
    np.testing.assert_array_equal(*commands)


def test_feedback_and_velocity_lead_a_joint_to_its_target(get_robot, follow, leg_joints):
    robot = get_robot("biped20")
    led = arms_of(robot, leg_joints)
    stack = on_the_left(swing_levels([JointTask(led, kp=16.0, name="arms")]))
    controller = DifferentialIK(robot, stack, dt=DT, joints=leg_joints(robot), led=["arms"])
    follower = follow(robot, LEFT, DT)
    start, com = follower.com, []
    index = [robot.joint_index(joint) for joint in led]
    goal = robot.q_home[7:][index] + 0.2
    stack.task("arms").set_target(goal)
    for _ in range(600):
        follower.move(controller.step(follower.state()).velocity)
        com.append(follower.com)
    # At kp / kd = 2 /s, three seconds: exp(-6) of 0.2 rad is left.
    np.testing.assert_allclose(follower.joints[index], goal, atol=6e-4)
    np.testing.assert_allclose(com, np.broadcast_to(start, (600, 3)), atol=5e-4)


def test_a_led_joint_keeps_its_limits_and_says_so(get_robot, leg_joints):
    robot = get_robot("g1")
    led = ["left_elbow_joint", "right_elbow_joint"]
    levels = swing_levels([JointTask(led, kp=0.0, name="elbows")])
    stack = on_the_left(levels, joint_limit=JointLimit(position_margin=0.0))
    controller = DifferentialIK(robot, stack, dt=DT, joints=leg_joints(robot), led=["elbows"])
    index = np.array([robot.joint_index(joint) for joint in led])
    q = robot.q_home.copy()
    q[7 + index] = robot.q_max[index] - [0.02, 1.0]
    stack.task("elbows").set_target(q[7 + index], [5.0, 1e6])
    command = controller.step(RobotState(q, np.zeros(robot.nv)))
    assert command.status.ok
    # The time to a limit is a tenth of a second.
    np.testing.assert_allclose(command.velocity[index], [0.2, 10.0])
    assert (
        "held at their limits: left_elbow_joint, right_elbow_joint" in controller.strategy.explain()
    )
    assert command.residuals[-1] > 0.5


@pytest.mark.parametrize("enabled", [True, False])
def test_a_leg_in_the_air_gives_way_to_a_hand_that_is_led_into_it(
    get_robot, follow, leg_joints, enabled
):
    robot, arm = get_robot("g1"), JointTask(["right_shoulder_roll_joint"], kp=0.0, name="arm")
    stack = on_the_left(
        [[FrameTask(RIGHT, "position", name="swing")], [arm]],
        self_collision_limit=SelfCollisionLimit(margin=0.02, enabled=enabled),
    )
    controller = DifferentialIK(robot, stack, dt=DT, joints=leg_joints(robot), led=["arm"])
    capsules, follower = capsules_of(robot), follow(robot, LEFT, DT)
    links = [{capsules.names[i], capsules.names[j]} for i, j in capsules.pairs]
    pair = links.index({"right_hip_yaw_link", "right_wrist_yaw_link"})
    stack.task("swing").set_velocity(np.zeros(3))
    for _ in range(60):
        arm.set_target(np.zeros(1), [0.3])
        follower.move(controller.step(follower.state()).velocity)
    assert (capsules.distances(robot, follower.q)[pair] > 0.02) == enabled


BAD = {
    "unknown": (["legs"], "unknown task.*'legs'.*choices: com, arm"),
    "no joint task": (["com"], "cannot lead joints.*ComTask"),
    "above others": (["arm"], "lowest levels"),
    "twice": (["arm", "posture"], "twice"),
}


@pytest.mark.parametrize(("names", "said"), BAD.values(), ids=BAD)
def test_tasks_that_cannot_lead_are_refused(get_robot, names, said):
    arm = JointTask(["left_elbow_joint"], name="arm")
    stack = Stack([SurfaceContact(LEFT)], [[ComTask()], [arm], [PostureTask()]])
    with pytest.raises(PoiseError, match=said):
        DifferentialIK(get_robot("g1"), stack, dt=DT, led=names)


def test_a_joint_is_led_or_solved_for(get_robot):
    levels = [[ComTask()], [JointTask(["left_elbow_joint"], name="arm")]]
    stack, robot = Stack([SurfaceContact(LEFT)], levels), get_robot("g1")
    with pytest.raises(ConfigurationError, match=r"led and solved for.*left_elbow_joint"):
        DifferentialIK(robot, stack, dt=DT, joints=robot.joint_names, led=["arm"])
    controller = DifferentialIK(robot, stack, dt=DT, led=["arm"])
    assert controller.strategy.size[0] == robot.nj - 1
