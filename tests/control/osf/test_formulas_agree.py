"""One torque by two ways; and MuJoCo, told that torque, does what the tasks ask."""

import math

import numpy as np
import pinocchio as pin
import pytest
from oracles import near_home, random_state
from osf_world import (
    FIXED,
    FLOATING,
    Mujoco,
    Rows,
    contact_force,
    dense_acceleration,
    missing,
    prioritised_singular_values,
    random_references,
    relative,
    stack_for,
)

from poise.control import OperationalSpaceController, RankTreatment
from poise.control._osf._recursion import OperationalRecursion
from poise.stack import FrameTask, JointLimit, JointTask, Stack

STATES = 170
"""States a robot: 1,020 in all."""

RANK = RankTreatment()


@pytest.mark.parametrize("name", [*FIXED, *FLOATING])
def test_the_recursion_agrees_with_projectors_at_random_states(get_any, name):
    """Everywhere: where tasks are singular, too."""
    robot = get_any(name)
    world, rng = Rows(robot, stack_for(robot)), np.random.default_rng(1)
    recursion, dynamics = OperationalRecursion(robot, RANK), world.dynamics
    worst = 0.0
    for seed in range(STATES):
        random_references(world.stack, rng, 10.0 if seed % 2 else 1.0)
        rows = world.at(random_state(robot, seed, speed=0.5))
        found = dynamics.M @ recursion.resolve(rows, dynamics) + dynamics.h
        wanted = dense_acceleration(rows, dynamics, rank=RANK)
        worst = max(worst, relative(found, dynamics.M @ wanted + dynamics.h))
    assert worst < 1e-9


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("name", [*FIXED, *FLOATING])
def test_mujoco_meets_every_feasible_task(get_any, name):
    """Forward dynamics of the second model under the generalized force: tasks to 1e-8."""
    robot = get_any(name)
    world, rng = Rows(robot, stack_for(robot)), np.random.default_rng(4)
    # Random postures are often near singular; thresholds this low leave most levels feasible.
    rank = RankTreatment(low=0.02, high=0.04)
    simulated, recursion, met = Mujoco(robot), OperationalRecursion(robot, rank), 0
    for seed in range(25):
        random_references(world.stack, rng)
        state = random_state(robot, seed, speed=0.5)
        rows = world.at(state)
        told = world.dynamics.M @ recursion.resolve(rows, world.dynamics) + world.dynamics.h
        dv = simulated.acceleration(state, told)
        singular = prioritised_singular_values(rows, world.dynamics)
        for i, level in enumerate(rows.slices):
            # From the first level that has lost rank on, nothing is certain to be feasible.
            if i and not (singular[i] >= rank.high).all():
                break
            missed = rows.jacobian[level] @ dv - rows.target[level]
            assert np.abs(missed).max(initial=0.0) < 1e-8
            met += 1
        for _, task in world.stack.tasks():
            if isinstance(task, FrameTask) and task.frame in robot.roles:
                # Independent of Poise's Jacobians and drifts.
                a = simulated.site_acceleration(task.frame)
                part = {3: a[3:] if task.turns else a[:3], 6: a}.get(task.dim)
                if part is not None:
                    wanted = task.jacobian @ dv + task.drift
                    assert np.abs(part - wanted).max() < 1e-8 * max(1.0, np.abs(wanted).max())
    # Most levels at most states; the last one, a posture over tasks, is never feasible.
    assert met > 25 * (len(rows.slices) - 1) * 0.8


@pytest.mark.parametrize("name", FLOATING)
def test_a_standing_humanoid_does_in_mujoco_what_its_command_says(get_any, name):
    """Torques and wrenches of `step` applied there: base dynamics, contacts and tasks hold."""
    robot = get_any(name)
    simulated, standing = Mujoco(robot), 0
    for seed in range(10):
        stack = stack_for(robot, friction=2.0)
        controller = OperationalSpaceController(robot, stack, torque_step=math.inf)
        random_references(stack, np.random.default_rng(seed), 0.1)
        state = near_home(robot, seed, spread=0.02, speed=0.02)
        command = controller.step(state)
        applied = np.concatenate((np.zeros(6), command.torque))
        applied += contact_force(robot, stack, state, command.wrenches)
        dv = simulated.acceleration(state, applied)
        assert np.abs(dv - command.acceleration).max() < 1e-8 * max(1.0, np.abs(dv).max())
        if max(command.residuals[:2]) > 1e-6 or controller.status().explanation[:4] == "held":
            continue
        standing += 1
        for contact in stack.contacts:
            rate = contact.jacobian @ dv + contact.drift
            assert np.abs(rate - contact.reference).max() < 1e-8
        for level, task in stack.tasks():
            if level < 3:
                assert np.abs(missing(task, dv)).max() < 1e-8
    assert standing >= 8


def test_joints_alone_follow_inverse_dynamics(get_any):
    """A posture alone: the torque is Pinocchio's recursive Newton-Euler of the wanted motion."""
    robot = get_any("panda")
    task = JointTask()
    controller = OperationalSpaceController(
        robot,
        Stack(levels=[[task]], joint_limit=JointLimit(velocity_scale=10.0)),
        torque_step=math.inf,
    )
    rng = np.random.default_rng(0)
    for seed in range(20):
        state = near_home(robot, seed, spread=0.3, speed=0.3)
        wanted = rng.normal(size=robot.nv)
        task.set_acceleration(wanted)
        torque = controller.step(state).torque
        exact = pin.rnea(robot.model, robot.model.createData(), state.q, state.v, wanted)
        assert np.abs(torque - exact).max() < 1e-10 * np.abs(exact).max()
