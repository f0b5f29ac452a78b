"""Four formulas, one torque; and MuJoCo, told that torque, does what the tasks ask."""

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
    dense_recursion,
    missing,
    prioritised_singular_values,
    random_references,
    stack_for,
)

from poise.control import OperationalSpaceController, RankTreatment
from poise.control._osf._fused import FusedResolver
from poise.control._osf._limits import DemandLimit
from poise.control._osf._recursion import PaperResolver
from poise.dynamics import RobotState
from poise.stack import FrameTask, JointLimit, JointTask, Stack

STATES = 170
"""States a robot: 1,020 in all."""

RANK = RankTreatment()


def force(resolver, rows, dynamics):
    return dynamics.M @ resolver.resolve(rows, dynamics) + dynamics.h


def relative(found, wanted):
    return np.abs(found - wanted).max() / np.abs(wanted).max()


@pytest.mark.parametrize("name", [*FIXED, *FLOATING])
def test_original_proposed_and_fused_agree_at_random_states(get_any, name):
    """Everywhere: where tasks are singular, and where they ask for too much, too."""
    robot = get_any(name)
    world, rng = Rows(robot, stack_for(robot)), np.random.default_rng(1)
    demand = DemandLimit(base=robot.base_dofs)
    fused = FusedResolver(robot.nv, RANK, demand)
    others = [PaperResolver(f, RANK, demand) for f in ("original", "proposed")]
    worst = 0.0
    for seed in range(STATES):
        random_references(world.stack, rng, 10.0 if seed % 2 else 1.0)
        rows = world.at(random_state(robot, seed, speed=0.5))
        wanted = force(fused, rows, world.dynamics)
        worst = max([worst, *(relative(force(r, rows, world.dynamics), wanted) for r in others)])
    assert worst < 1e-9


@pytest.mark.parametrize("name", ["arm6", "upper17", "humanoid33"])
def test_they_agree_with_numerical_derivatives_too(get_any, name):
    """What the derivative adds to the bias acceleration it takes away again in the force."""
    robot = get_any(name)
    world, rng = Rows(robot, stack_for(robot)), np.random.default_rng(2)
    fused = FusedResolver(robot.nv, RANK)
    for seed in range(5):
        others = [PaperResolver(f, RANK) for f in ("original", "proposed")]
        random_references(world.stack, rng)
        state = near_home(robot, seed, spread=0.2, speed=0.5)
        for k in range(3):
            q = pin.integrate(robot.model, state.q, 1e-3 * k * state.v)
            rows = world.at(RobotState(q, state.v, time=1e-3 * k), exact=False)
            wanted = force(fused, rows, world.dynamics)
            for other in others:
                assert relative(force(other, rows, world.dynamics), wanted) < 1e-8


def test_the_numerical_formula_is_wrong_by_what_its_differences_miss(get_any):
    """Eq. (41), the paper's counterexample, is near the others on a smooth motion, not equal."""
    robot = get_any("arm6")
    world = Rows(robot, stack_for(robot))
    errors = {}
    for step in (1e-3, 1e-4):
        resolver, fused = PaperResolver("numerical", RANK), FusedResolver(robot.nv, RANK)
        q, v = robot.q_home.copy(), np.full(robot.nv, 0.3)
        for k in range(3):
            rows = world.at(RobotState(q, v, time=k * step))
            wanted = fused.resolve(rows, world.dynamics)
            found = resolver.resolve(rows, world.dynamics)
            errors[step] = relative(found, wanted)
            q, v = pin.integrate(robot.model, q, step * v), v + step * wanted
    assert 1e-8 < errors[1e-4] < 0.3 * errors[1e-3]
    assert errors[1e-3] < 0.1


@pytest.mark.parametrize("name", ["arm6", "upper17", "humanoid33"])
def test_bias_accelerations_match_differences_of_the_projected_jacobian(get_any, name):
    """b = J S + Jdot v - Jdot_p v with Jdot_p v from central differences of dense J_p v."""
    robot = get_any(name)
    world, rng = Rows(robot, stack_for(robot)), np.random.default_rng(3)
    h = 1e-6

    def projected(q, v):
        rows = world.at(RobotState(q, v))
        M_inverse, N, found = np.linalg.inv(world.dynamics.M), np.eye(robot.nv), []
        for level in rows.slices:
            J_p = rows.jacobian[level] @ N
            found.append(J_p)
            N = N - M_inverse @ J_p.T @ np.linalg.pinv(J_p @ M_inverse @ J_p.T) @ J_p
        return found

    for seed in range(3):
        state = near_home(robot, seed, spread=0.2, speed=0.5)
        random_references(world.stack, rng)
        plus, minus = (
            projected(pin.integrate(robot.model, state.q, sign * h * state.v), state.v)
            for sign in (1.0, -1.0)
        )
        rows = world.at(state)
        resolvers = [PaperResolver(f, RANK) for f in ("original", "proposed")]
        for resolver in resolvers:
            resolver.resolve(rows, world.dynamics)
        # The posture has more rows than freedom: its projected rank is not the textbook's.
        for i in range(1, len(rows.slices) - 1):
            level = rows.slices[i]
            drift_p = (plus[i] - minus[i]) @ state.v / (2.0 * h)
            S, _ = dense_recursion(rows, world.dynamics, i)
            wanted = rows.jacobian[level] @ S + rows.drift[level] - drift_p
            for resolver in resolvers:
                assert np.abs(resolver.bias[i] - wanted).max() < 1e-6 * max(
                    1.0, np.abs(wanted).max()
                )


@pytest.mark.parametrize("name", [*FIXED, *FLOATING])
def test_mujoco_meets_every_feasible_task(get_any, name):
    """Forward dynamics of the second model under the generalized force: tasks to 1e-8."""
    robot = get_any(name)
    world, rng = Rows(robot, stack_for(robot)), np.random.default_rng(4)
    # Random postures are often near singular; thresholds this low leave most levels feasible.
    rank = RankTreatment(low=0.02, high=0.04)
    simulated, resolver, met = Mujoco(robot), FusedResolver(robot.nv, rank), 0
    for seed in range(25):
        random_references(world.stack, rng)
        state = random_state(robot, seed, speed=0.5)
        rows = world.at(state)
        dv = simulated.acceleration(state, force(resolver, rows, world.dynamics))
        singular = prioritised_singular_values(rows, world.dynamics)
        for i, level in enumerate(rows.slices):
            # From the first level that has lost rank on, nothing is certain to be feasible.
            if i and not (singular[i] >= rank.high).all():
                break
            missed = rows.jacobian[level] @ dv + rows.drift[level] - rows.reference[level]
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
@pytest.mark.parametrize("bias", ["fused", "original"])
def test_a_standing_humanoid_does_in_mujoco_what_its_command_says(get_any, name, bias):
    """Torques and wrenches of `step` applied there: base dynamics, contacts and tasks hold."""
    robot = get_any(name)
    simulated, standing = Mujoco(robot), 0
    for seed in range(10):
        stack = stack_for(robot, friction=2.0)
        controller = OperationalSpaceController(robot, stack, bias=bias, torque_step=math.inf)
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
