"""Floating bases: wrenches that MuJoCo needs, cones, internal forces, unloading, flight, points."""

import math

import numpy as np
import pytest
from oracles import near_home
from osf_world import Mujoco, contact_force, missing, reload_with, stack_for

from poise.control import OperationalSpaceController
from poise.dynamics import RobotState
from poise.errors import TargetError, UnknownNameError
from poise.sim import Plant
from poise.stack import (
    ComTask,
    FrameTask,
    JointLimit,
    PointContact,
    PostureTask,
    Stack,
    SurfaceContact,
    TorqueLimit,
)

SEEDS = range(8)

WEIGHT = 9.81


def home(robot, time=0.0):
    return RobotState(robot.q_home, np.zeros(robot.nv), time=time)


def residual_in_mujoco(robot, stack, state, command):
    """What MuJoCo's inverse dynamics miss in torques and wrenches, over the weight [N, N m]."""
    simulated = Mujoco(robot)
    applied = np.concatenate((np.zeros(6), command.torque))
    applied += contact_force(robot, stack, state, command.wrenches)
    zero = simulated.acceleration(state, np.zeros(robot.nv))
    columns = [simulated.acceleration(state, e) - zero for e in np.eye(robot.nv)]
    M_inverse = np.array(columns).T
    found = np.linalg.solve(M_inverse, command.acceleration - zero) - applied
    return np.abs(found).max() / (robot.mass * WEIGHT)


@pytest.mark.fast_cases(6)
@pytest.mark.parametrize("name", ["humanoid33", "g1"])
@pytest.mark.parametrize("seed", SEEDS)
def test_wrenches_are_what_mujoco_needs_for_the_acceleration(get_any, name, seed):
    robot = get_any(name)
    stack = stack_for(robot)
    state = near_home(robot, seed, spread=0.02, speed=0.05)
    command = OperationalSpaceController(robot, stack, torque_step=math.inf).step(state)
    assert command.status.ok
    assert residual_in_mujoco(robot, stack, state, command) < 1e-8


def test_cones_hold_where_the_nearest_wrenches_would_leave_them(get_any):
    """Little friction: the nearest internal forces slip; others, or fewer tasks, do not."""
    robot = get_any("humanoid33")
    slippery, left = SurfaceContact("left_sole", friction=0.12), 0
    slippery.bind(robot)
    for seed in SEEDS:
        state = near_home(robot, seed, spread=0.03, speed=0.05)
        for friction in (5.0, 0.12):
            stack = stack_for(robot, friction=friction)
            command = OperationalSpaceController(robot, stack, torque_step=math.inf).step(state)
            assert command.status.ok
            tolerance = 1e-5 * robot.mass * WEIGHT
            worst = max((slippery.cone @ F).max() for F in command.wrenches.values())
            if friction == 5.0:
                left += worst > 10.0
                continue
            assert worst < tolerance
            assert all(F[2] > 0.0 for F in command.wrenches.values())
            assert command.residuals[1] < 1e-5
            assert residual_in_mujoco(robot, stack, state, command) < 1e-5
    # The test says something: with friction enough, wrenches lie far outside the small cone.
    assert left >= len(SEEDS) // 2


def test_tasks_give_way_from_the_bottom_up_where_cones_cannot_hold_all(get_any):
    """A CoM thrown sideways leaves the cones; the tasks under it go first, then a share of it."""
    robot = get_any("humanoid33")
    com, hand = ComTask("xy"), FrameTask("left_hand", "position")
    stack = Stack([SurfaceContact(s) for s in robot.soles], [[com], [hand], [PostureTask()]])
    controller = OperationalSpaceController(robot, stack, torque_step=math.inf)
    missed = []
    for push in (0.5, 3.0, 12.0):
        com.set_acceleration([0.0, push])
        hand.set_acceleration(np.zeros(3))
        command = controller.step(home(robot))
        assert command.status.ok
        assert command.residuals[0] < 1e-6
        assert command.residuals[1] < 1e-6
        missed.append(np.linalg.norm(missing(com, command.acceleration)))
        moved = com.jacobian @ command.acceleration + com.drift
        assert -1e-6 < moved[1] <= push + 1e-6
    assert missed[0] < 1e-6
    assert missed[2] > 1.0


def test_a_reference_moves_load_and_no_acceleration(get_any):
    robot = get_any("humanoid33")
    controller = OperationalSpaceController(robot, stack_for(robot), torque_step=math.inf)
    state = near_home(robot, 3, spread=0.01, speed=0.02)
    before = controller.step(state)
    load = before.wrenches["left_sole"][2]
    controller.set_wrench("left_sole", [0.0, 0.0, load + 400.0, 0.0, 0.0, 0.0])
    after = controller.step(state)
    assert np.abs(after.acceleration - before.acceleration).max() < 1e-9
    assert after.wrenches["left_sole"][2] > load + 20.0
    total = [sum(F[2] for F in c.wrenches.values()) for c in (before, after)]
    assert total[1] == pytest.approx(total[0], rel=0.02)
    assert residual_in_mujoco(robot, controller.stack, state, after) < 1e-8
    assert after.residuals[1] < 1e-6
    controller.set_wrench("left_sole", None)
    again = controller.step(state)
    assert again.wrenches["left_sole"] == pytest.approx(before.wrenches["left_sole"])


def test_soles_press_against_each_other_when_asked(get_any):
    """An internal force in the strict sense: sideways against each other, with no sum."""
    robot = get_any("humanoid33")
    controller = OperationalSpaceController(robot, stack_for(robot), torque_step=math.inf)
    before = controller.step(home(robot))
    half = 0.5 * robot.mass * WEIGHT
    for side, sign in (("left_sole", 1.0), ("right_sole", -1.0)):
        controller.set_wrench(side, [0.0, sign * 60.0, half, 0.0, 0.0, 0.0])
    after = controller.step(home(robot))
    squeeze = [c.wrenches["left_sole"][1] - c.wrenches["right_sole"][1] for c in (before, after)]
    assert squeeze[1] - squeeze[0] > 20.0
    assert np.abs(after.acceleration - before.acceleration).max() < 1e-9


@pytest.mark.parametrize("wrong", [[1.0, 2.0], [math.nan] * 6, [[0.0] * 6]])
def test_a_wrench_that_is_none_is_refused(get_any, wrong):
    robot = get_any("humanoid33")
    controller = OperationalSpaceController(robot, stack_for(robot))
    with pytest.raises(TargetError, match="left_sole"):
        controller.set_wrench("left_sole", wrong)


def test_a_wrench_on_a_contact_that_is_none_is_refused(get_any):
    robot = get_any("humanoid33")
    controller = OperationalSpaceController(robot, stack_for(robot))
    with pytest.raises(UnknownNameError, match="left_sole"):
        controller.set_wrench("left_hand", np.zeros(6))


def test_releasing_a_contact_shifts_its_load_smoothly(get_any):
    """The CoM moves over the left foot, the right one unloads: no jump, and nobody falls."""
    robot = get_any("humanoid33")
    com = ComTask()
    stack = Stack(
        [SurfaceContact(s) for s in robot.soles],
        [[com, FrameTask("pelvis", "orientation")], [FrameTask("right_sole")], [PostureTask()]],
    )
    controller, plant = OperationalSpaceController(robot, stack), Plant(robot)
    bound = 0.1 * robot.tau_max
    state = plant.state()
    start = plant.com
    left = plant.model.site("left_sole").id
    goal = np.array([start[0], plant.data.site_xpos[left, 1] - 0.01, start[2]])
    last, loads, steps = None, [], []
    while plant.time < 2.2:
        share = min(plant.time / 1.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        com.set_target(start + share * (goal - start))
        if round(plant.time * 1e3) == 1300:
            stack.contact("right_sole").release(0.4)
        state = plant.state()
        command = controller.step(state)
        assert command.status.ok
        if last is not None:
            steps.append((np.abs(command.torque - last) / bound).max())
        last = command.torque
        loads.append(command.wrenches.get("right_sole", np.zeros(6))[2])
        plant.step(command)
    assert not plant.fallen
    assert not stack.contact("right_sole").active
    assert max(steps) <= 1.0 + 1e-9
    # Falls all the way to nothing, never by more than a twentieth of the weight in a tick.
    assert loads[1250] > 0.0
    assert loads[-1] == 0.0
    assert np.abs(np.diff(loads)).max() < 0.05 * robot.mass * WEIGHT
    # The foot that was a contact is a task now, and holds still where it left the ground.
    assert np.linalg.norm(stack.task("right_sole pose").error[:3]) < 0.01


def test_a_foot_that_is_being_unloaded_carries_less_than_it_still_may(get_any):
    """Its wrench costs one over its load squared: at a half, four times the other's."""
    robot = get_any("humanoid33")
    stack = stack_for(robot)
    controller = OperationalSpaceController(robot, stack)
    controller.step(home(robot))
    foot, weight, ratios = stack.contact("right_sole"), robot.mass * WEIGHT, []
    foot.release(1.0)
    for time in np.linspace(0.0, 0.95, 20):
        command = controller.step(home(robot, float(time)))
        most = foot.wrench_upper[2] / weight
        if 0.4 < most < 0.6:
            ratios.append(command.wrenches["right_sole"][2] / weight / most)
    assert len(ratios) > 1
    assert max(ratios) < 0.7


@pytest.mark.parametrize("levels", ["posture", "hand and posture", "com"])
def test_in_flight_the_base_obeys_gravity_and_torques_are_finite(get_any, levels):
    robot = get_any("humanoid33")
    tasks = {
        "posture": [[PostureTask()]],
        "hand and posture": [[FrameTask("left_hand")], [PostureTask()]],
        "com": [[ComTask()], [FrameTask("pelvis", "orientation")], [PostureTask()]],
    }[levels]
    stack = Stack(levels=tasks)
    controller = OperationalSpaceController(robot, stack, torque_step=math.inf)
    for seed in SEEDS:
        state = near_home(robot, seed, spread=0.05, speed=0.2)
        command = controller.step(state)
        assert command.status.ok
        assert (np.abs(command.torque) <= robot.tau_max).all()
        dynamics = controller.dynamics
        com = dynamics.com_jacobian @ command.acceleration + dynamics.com_bias
        assert np.abs(com - [0.0, 0.0, -9.81]).max() < 1e-7
        momentum = dynamics.momentum_matrix[3:] @ command.acceleration + dynamics.momentum_bias[3:]
        assert np.abs(momentum).max() < 1e-6
        assert residual_in_mujoco(robot, stack, state, command) < 1e-8


def with_heels_and_toes(robot, folder):
    """The same robot with frames at the middle of its heels and toes."""
    frames = {
        f"{side}_{name}": {"link": f"{side}_foot_link", "position": [0.03 + shift, 0.0, -0.10]}
        for side in ("left", "right")
        for name, shift in (("heel", -0.1), ("toe", 0.1))
    }
    return reload_with(robot, folder, lambda facts: {"hands": facts["hands"] | frames})


@pytest.mark.parametrize("count", [2, 4])
def test_points_alone_carry_what_they_can(get_any, tmp_path, count):
    """Two points leave the rotation about their line to gravity; four on two feet carry all."""
    robot = with_heels_and_toes(get_any("humanoid33"), tmp_path)
    names = (
        ["left_sole", "right_sole"]
        if count == 2
        else ["left_heel", "left_toe", "right_heel", "right_toe"]
    )
    stack = Stack(
        [PointContact(name) for name in names],
        [[ComTask("z")], [FrameTask("pelvis", "orientation")], [PostureTask()]],
        joint_limit=JointLimit(),
    )
    controller = OperationalSpaceController(robot, stack, torque_step=math.inf)
    for seed in range(4):
        # At rest: two points of a foot that turns cannot both have no acceleration.
        state = near_home(robot, seed, spread=0.01, speed=0.0)
        command = controller.step(state)
        assert command.status.ok
        assert np.isfinite(command.torque).all()
        assert residual_in_mujoco(robot, stack, state, command) < 1e-7
        for contact in stack.contacts:
            rate = contact.jacobian @ command.acceleration + contact.drift
            assert np.abs(rate - contact.reference).max() < 1e-6
            F = command.wrenches[contact.name]
            assert (contact.cone @ F).max() < 1e-5 * robot.mass * WEIGHT


def test_wrenches_spread_the_load_evenly_at_home(get_any):
    """Standing still on two feet in the middle: the same on both, inside both cones, no torsion."""
    robot = get_any("humanoid33")
    command = OperationalSpaceController(robot, stack_for(robot)).step(home(robot))
    left, right = command.wrenches["left_sole"], command.wrenches["right_sole"]
    assert left[2] == pytest.approx(right[2], rel=1e-3)
    assert left[2] + right[2] == pytest.approx(robot.mass * WEIGHT, rel=2e-2)
    assert abs(left[5]) < 1.0


def test_scaled_torque_limits_hold_and_base_dynamics_stay_exact(get_any):
    robot = get_any("humanoid33")
    for seed in range(4):
        state = near_home(robot, seed, spread=0.02, speed=0.1)
        free = OperationalSpaceController(robot, stack_for(robot), torque_step=math.inf).step(state)
        share = 0.8 * float(np.max(np.abs(free.torque) / robot.tau_max))
        stack = stack_for(robot)
        tight = Stack(stack.contacts, stack.levels, torque_limit=TorqueLimit(share))
        command = OperationalSpaceController(robot, tight, torque_step=math.inf).step(state)
        assert command.status.ok
        assert (np.abs(command.torque) <= share * robot.tau_max * (1.0 + 1e-9)).all()
        assert residual_in_mujoco(robot, tight, state, command) < 1e-5
