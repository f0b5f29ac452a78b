"""The controller against the equation of motion and against nested least squares."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import near_home, random_state
from scipy.linalg import null_space

from poise.control import WholeBodyController
from poise.dynamics import Dynamics, RobotState
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
    TorqueLimit,
    default_stack,
)

SEEDS = range(6)


def standing(robot, *, friction=0.7, tasks=None, torque_scale=1.0):
    return Stack(
        contacts=[SurfaceContact(sole, friction=friction) for sole in robot.soles],
        levels=tasks
        or [
            [ComTask(kp=40.0), FrameTask(robot.pelvis, "orientation")],
            [FrameTask(robot.hands[1]), MomentumTask("angular_xy")],
            [PostureTask()],
        ],
        torque_limit=TorqueLimit(torque_scale),
    )


def violation_of_motion(robot, stack, state, command):
    """Largest error of M dv + h = S^T tau + sum J^T F, relative; dynamics by Pinocchio's RNEA."""
    data = robot.model.createData()
    left = pin.rnea(robot.model, data, state.q, state.v, command.acceleration)
    right = np.concatenate((np.zeros(robot.base_dofs), command.torque))
    dynamics = Dynamics(robot)
    dynamics.update(state)
    for contact in stack.contacts:
        if contact.name not in command.wrenches:
            continue
        frame = dynamics.frame(robot.frame_id(contact.frame))
        F = command.wrenches[contact.name]
        turned = np.concatenate([frame.rotation @ part for part in F.reshape(-1, 3)])
        right = right + frame.jacobian[: len(F)].T @ turned
    return np.abs(left - right).max() / np.abs(left).max()


@pytest.mark.parametrize("name", ["humanoid33", "g1", "biped20"])
@pytest.mark.parametrize("seed", SEEDS)
def test_torques_reproduce_the_accelerations(get_robot, name, seed):
    robot = get_robot(name)
    stack = standing(robot)
    controller = WholeBodyController(robot, stack)
    state = near_home(robot, seed, speed=0.3)
    command = controller.step(state)
    assert command.status.ok
    assert violation_of_motion(robot, stack, state, command) < 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_forward_dynamics_with_the_torques_returns_the_accelerations(get_robot, seed):
    robot = get_robot("humanoid33")
    stack = standing(robot)
    state = near_home(robot, seed, speed=0.3)
    command = WholeBodyController(robot, stack).step(state)
    data = robot.model.createData()
    dynamics = Dynamics(robot)
    dynamics.update(state)
    tau = np.concatenate((np.zeros(6), command.torque))
    for contact in stack.contacts:
        tau += contact.jacobian.T @ command.wrenches[contact.name]
    dv = pin.aba(robot.model, data, state.q, state.v, tau)
    assert np.abs(dv - command.acceleration).max() < 1e-6 * np.abs(command.acceleration).max()


@pytest.mark.parametrize("name", ["arm6", "upper17"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_fixed_robot_needs_no_contact(get_robot, name, seed):
    robot = get_robot(name)
    stack = Stack(levels=[[FrameTask(robot.hands[0])], [PostureTask()]], joint_limit=JointLimit())
    state = random_state(robot, seed, speed=0.2)
    command = WholeBodyController(robot, stack).step(state)
    assert command.status.ok
    assert violation_of_motion(robot, stack, state, command) < 1e-9


@pytest.mark.parametrize("name", ["humanoid33", "g1"])
@pytest.mark.parametrize("seed", SEEDS)
def test_contacts_accelerate_as_their_reference_says(get_robot, name, seed):
    robot = get_robot(name)
    stack = standing(robot)
    state = near_home(robot, seed, spread=0.02, speed=0.1)
    command = WholeBodyController(robot, stack).step(state)
    assert command.status.ok
    assert command.residuals[1] < 1e-8
    for contact in stack.contacts:
        rate = contact.jacobian @ command.acceleration + contact.drift
        assert np.abs(rate - contact.reference).max() < 1e-7
        assert (contact.cone @ command.wrenches[contact.name]).max() < 1e-6
        assert command.wrenches[contact.name][2] >= -1e-6


@pytest.mark.parametrize("seed", SEEDS)
def test_tight_torque_limits_hold_and_dynamics_stay_exact(get_robot, seed):
    robot = get_robot("humanoid33")
    state = near_home(robot, seed, speed=0.3)
    free = WholeBodyController(robot, standing(robot)).step(state)
    share = 0.5 * float(np.max(np.abs(free.torque) / robot.tau_max))
    stack = standing(robot, torque_scale=share)
    command = WholeBodyController(robot, stack).step(state)
    assert command.status.ok
    assert (np.abs(command.torque) <= share * robot.tau_max).all()
    assert command.residuals[0] < 1e-9
    assert violation_of_motion(robot, stack, state, command) < 1e-8


@pytest.mark.parametrize("seed", SEEDS)
def test_an_unreachable_hand_never_worsens_the_com(get_robot, seed):
    robot = get_robot("humanoid33")
    state = near_home(robot, seed, speed=0.2)
    residuals = {}
    for reach in (False, True):
        hand, com = FrameTask("left_hand", "position"), ComTask(kp=200.0)
        stack = standing(robot, tasks=[[com], [hand], [PostureTask()]])
        controller = WholeBodyController(robot, stack)
        com.set_target(Dynamics(robot).com + [0.05, 0.0, -0.02])
        if reach:
            hand.set_target([5.0, 3.0, 4.0])
        command = controller.step(state)
        assert command.status.ok
        task = com.jacobian @ command.acceleration + com.drift - com.reference
        residuals[reach] = np.linalg.norm(task)
    assert residuals[True] <= residuals[False] * (1.0 + 1e-6) + 1e-6


@pytest.mark.parametrize("seed", SEEDS)
def test_an_unreachable_hand_never_worsens_a_com_that_is_out_of_reach_itself(get_robot, seed):
    """Both conflict with the friction cones; the first one's residual is what it is alone."""
    robot = get_robot("humanoid33")
    state = near_home(robot, seed, spread=0.02, speed=0.05)
    residuals = []
    for levels in (1, 2):
        com, hand = ComTask("xy", kp=500.0), FrameTask("left_hand", "position", kp=400.0)
        stack = standing(robot, tasks=[[com], [hand]][:levels])
        controller = WholeBodyController(robot, stack)
        com.set_target(Dynamics(robot).com + [1.0, 0.5, 0.0])
        hand.set_target([5.0, -3.0, 4.0])
        command = controller.step(state)
        assert command.status.ok
        residuals.append(
            np.linalg.norm(com.jacobian @ command.acceleration + com.drift - com.reference)
        )
    assert residuals[0] > 1.0
    assert residuals[1] == pytest.approx(residuals[0], rel=1e-5)


def nested_least_squares(H, levels):
    """x by null spaces: each level's least squares over what the levels above leave free."""
    x, Z = np.zeros(len(H)), np.eye(len(H))
    for A, b, weight in levels:
        W = weight[:, None]
        y = np.linalg.lstsq(W * (A @ Z), weight * (b - A @ x), rcond=1e-10)[0]
        x = x + Z @ y
        Z = Z @ null_space(W * (A @ Z), rcond=1e-9)
    return x - Z @ np.linalg.solve(Z.T @ H @ Z, Z.T @ (H @ x))


def levels_of(robot, stack, state):
    """Equality levels put together here, from Pinocchio and the tasks' own rows."""
    dynamics = Dynamics(robot)
    dynamics.update(state)
    for contact in stack.contacts:
        contact.evaluate(dynamics)
    nv, contacts = robot.nv, stack.contacts
    Jc = np.vstack([c.jacobian for c in contacts])
    n = nv + len(Jc)
    base = np.hstack((dynamics.M, -Jc.T))[:6]
    levels = [(base, -dynamics.h[:6], np.ones(6))]
    motion = np.zeros((len(Jc), n))
    motion[:, :nv] = Jc
    levels.append(
        (motion, np.concatenate([c.reference - c.drift for c in contacts]), np.ones(len(Jc)))
    )
    for tasks in stack.levels:
        for task in tasks:
            task.evaluate(dynamics)
        J = np.vstack([t.jacobian for t in tasks])
        rows = np.hstack((J, np.zeros((len(J), n - nv))))
        b = np.concatenate([t.reference - t.drift for t in tasks])
        levels.append((rows, b, np.concatenate([t.weight for t in tasks])))
    H, start = np.zeros((n, n)), nv
    H[:nv, :nv] = dynamics.M
    for contact in contacts:
        # How far a wrench of 1 N, and no other, takes each edge of the cone; normal forces by 0.1.
        edges = contact.cone / np.abs(contact.cone[:, [2]])
        cost = 1e-4 * np.einsum("ki,kj->ij", edges, edges) / len(edges)
        cost[2, 2] *= 0.1
        H[start : start + len(cost), start : start + len(cost)] = cost
        start += len(cost)
    return H, levels


def is_slack(robot, stack, command):
    """Whether no inequality holds the point, so that the oracle speaks about the same problem."""
    inside = (np.abs(command.torque) < 0.99 * robot.tau_max).all()
    for c in stack.contacts:
        inside &= (c.cone @ command.wrenches[c.name] < -1e-3).all()
        inside &= command.wrenches[c.name][2] > c.wrench_lower[2] + 1e-3
    limit, dv = stack.joint_limit, command.acceleration[6:]
    return bool(inside and (dv > limit.lower + 1e-3).all() and (dv < limit.upper - 1e-3).all())


@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_without_active_inequalities_it_is_nested_least_squares(get_robot, name):
    """Weights, a last level that must give, and the final cost included."""
    robot, compared = get_robot(name), 0
    for seed in range(12):
        stack = standing(
            robot,
            friction=2.0,
            tasks=[
                [ComTask(kp=5.0), FrameTask(robot.pelvis, "orientation", kp=5.0)],
                [
                    FrameTask(robot.hands[0], kp=5.0, weight=2.0),
                    FrameTask(robot.torso, "orientation", kp=5.0, weight=[1.0, 2.0, 3.0]),
                ],
                [PostureTask(kp=4.0, weight=np.linspace(0.5, 2.0, robot.nj))],
            ],
        )
        controller = WholeBodyController(robot, stack)
        state = near_home(robot, seed, spread=0.01, speed=0.01)
        command = controller.step(state)
        assert command.status.ok
        if not is_slack(robot, stack, command):
            continue
        x = nested_least_squares(*levels_of(robot, stack, state))
        scale = np.abs(x[: robot.nv]).max()
        assert np.abs(command.acceleration - x[: robot.nv]).max() < 1e-6 * scale
        wrench = np.concatenate([command.wrenches[c.name] for c in stack.contacts])
        assert np.abs(wrench - x[robot.nv :]).max() < 1e-5 * np.abs(wrench).max()
        compared += 1
    assert compared >= 6


def test_the_final_cost_decides_what_no_task_asks_for(get_robot):
    """Without tasks the accelerations minimise dv^T M dv / 2 under the contacts."""
    robot = get_robot("humanoid33")
    stack = Stack(
        contacts=[SurfaceContact(s, friction=2.0) for s in robot.soles],
        levels=[[JointTask([robot.joint_names[-1]], kp=1.0)]],
    )
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    command = WholeBodyController(robot, stack).step(state)
    assert command.status.ok
    if is_slack(robot, stack, command):
        x = nested_least_squares(*levels_of(robot, stack, state))
        assert np.abs(command.acceleration - x[: robot.nv]).max() < 1e-6


def test_a_point_contact_holds_its_point(get_robot):
    robot = get_robot("humanoid33")
    stack = Stack(
        contacts=[SurfaceContact("left_sole"), PointContact("right_sole")],
        levels=[[ComTask(kp=10.0)], [PostureTask()]],
    )
    state = near_home(robot, 0, spread=0.02, speed=0.05)
    command = WholeBodyController(robot, stack).step(state)
    assert command.status.ok
    point = stack.contacts[1]
    assert command.wrenches["right_sole"].shape == (3,)
    rate = point.jacobian @ command.acceleration + point.drift
    assert np.abs(rate - point.reference).max() < 1e-7
    assert violation_of_motion(robot, stack, state, command) < 1e-9


def test_a_falling_robot_is_still_exact(get_robot):
    """No contact at all: momentum cannot be controlled, joints can."""
    robot = get_robot("humanoid33")
    stack = Stack(levels=[[PostureTask()]])
    state = near_home(robot, 0)
    command = WholeBodyController(robot, stack).step(state)
    assert command.status.ok
    assert violation_of_motion(robot, stack, state, command) < 1e-9
    dynamics = Dynamics(robot)
    dynamics.update(state)
    com = dynamics.com_jacobian @ command.acceleration + dynamics.com_bias
    assert np.abs(com - [0.0, 0.0, -9.81]).max() < 1e-8


@pytest.mark.parametrize("name", ["humanoid33", "biped20", "g1", "talos", "icub", "romeo"])
def test_the_default_stack_stands(get_robot, name):
    robot = get_robot(name)
    stack = default_stack(robot)
    command = WholeBodyController(robot, stack).step(RobotState(robot.q_home, np.zeros(robot.nv)))
    assert command.status.ok
    assert max(command.residuals[:4]) < 1e-6
    lift = sum(F[2] for F in command.wrenches.values())
    assert lift == pytest.approx(robot.mass * 9.81, rel=1e-3)
