from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from oracles import (
    difference_drift,
    difference_jacobian,
    dynamics_at,
    frame_placement,
    random_state,
)

from poise.dynamics import Dynamics, RobotState
from poise.errors import UnknownNameError

ROBOTS = ("humanoid33", "g1", "upper17", "arm6")
VECTORS = ("com", "com_velocity", "com_bias", "momentum", "momentum_bias")
QUANTITIES = (*VECTORS, "M", "h", "com_jacobian", "momentum_matrix")


@pytest.fixture(params=ROBOTS)
def robot(request, get_robot):
    return get_robot(request.param)


@pytest.fixture(params=range(3))
def case(request, robot):
    """A robot, a state of it, the dynamics there, and Pinocchio's data after its kinematics."""
    state, data = random_state(robot, request.param), robot.model.createData()
    pin.forwardKinematics(robot.model, data, state.q, state.v)
    return robot, state, dynamics_at(robot, state.q, state.v), data


def com_of(robot, q):
    return pin.centerOfMass(robot.model, robot.model.createData(), q)


def frames_of(robot):
    return (*robot.hands, *robot.soles, robot.torso)


def test_equation_of_motion_and_mass_matrix_equal_recursions(case):
    robot, state, dynamics, data = case
    M, dv = dynamics.M, np.random.default_rng(100).normal(size=robot.nv)
    expected = pin.rnea(robot.model, robot.model.createData(), state.q, state.v, dv)
    assert np.abs(M @ dv + dynamics.h - expected).max() < 1e-12 * np.abs(expected).max()
    upper = np.triu(pin.crba(robot.model, robot.model.createData(), state.q))
    assert np.array_equal(M, M.T)
    assert np.abs(M - upper - np.triu(upper, 1).T).max() < 1e-12
    assert np.linalg.eigvalsh(M)[0] > 0.0
    bodies = sum(
        data.v[i].vector @ robot.model.inertias[i].matrix() @ data.v[i].vector
        for i in range(1, robot.model.njoints)
    )
    rotors = robot.model.armature @ state.v**2
    assert state.v @ M @ state.v == pytest.approx(bodies + rotors, rel=1e-10)


def test_gravity_at_rest_is_the_gradient_of_potential_energy(case):
    robot, state, *_ = case

    def fall(minus, plus):
        return np.array([robot.mass * 9.81 * (com_of(robot, plus) - com_of(robot, minus))[2]])

    h = dynamics_at(robot, state.q, np.zeros(robot.nv)).h
    assert np.abs(h - difference_jacobian(robot, state.q, fall)[0]).max() < 1e-5


def test_momentum_is_the_sum_over_bodies_about_the_com(case):
    robot, state, dynamics, data = case
    total = pin.Force.Zero()
    for i in range(1, robot.model.njoints):
        total += data.oMi[i].act(robot.model.inertias[i] * data.v[i])
    angular = total.angular - np.cross(com_of(robot, state.q), total.linear)
    assert np.abs(dynamics.momentum[:3] - total.linear).max() < 1e-9
    assert np.abs(dynamics.momentum[3:] - angular).max() < 1e-9
    assert np.abs(dynamics.momentum_matrix @ state.v - dynamics.momentum).max() < 1e-9
    assert np.abs(dynamics.com_velocity * robot.mass - total.linear).max() < 1e-9


def test_com_and_momentum_rates_equal_differences(case):
    robot, state, dynamics, _ = case

    def momentum(q, v):
        data = robot.model.createData()
        return pin.computeCentroidalMomentum(robot.model, data, q, v).vector.copy()

    def com_velocity(q, v):
        data = robot.model.createData()
        pin.centerOfMass(robot.model, data, q, v)
        return data.vcom[0].copy()

    scale = 1.0 + np.abs(dynamics.momentum_bias).max()
    for actual, of in ((dynamics.momentum_bias, momentum), (dynamics.com_bias, com_velocity)):
        assert np.abs(actual - difference_drift(robot, state, of)).max() < 1e-7 * scale
    expected = difference_jacobian(
        robot, state.q, lambda minus, plus: com_of(robot, plus) - com_of(robot, minus)
    )
    assert np.abs(dynamics.com_jacobian - expected).max() < 1e-8
    assert np.abs(dynamics.com_jacobian @ state.v - dynamics.com_velocity).max() < 1e-10


def test_frames_equal_differences(case):
    robot, state, dynamics, _ = case
    for name in frames_of(robot):
        frame_id = robot.frame_id(name)
        frame, placement = dynamics.frame(frame_id), frame_placement(robot, state.q, name)

        def difference(minus, plus, name=name):
            a, b = (frame_placement(robot, q, name) for q in (minus, plus))
            turn = pin.log3(b.rotation @ a.rotation.T)
            return np.concatenate((b.translation - a.translation, turn))

        def velocity(q, v, frame_id=frame_id):
            data = robot.model.createData()
            pin.computeJointJacobians(robot.model, data, q)
            pin.updateFramePlacements(robot.model, data)
            aligned = pin.LOCAL_WORLD_ALIGNED
            return pin.getFrameJacobian(robot.model, data, frame_id, aligned) @ v

        expected = difference_jacobian(robot, state.q, difference)
        assert np.abs(frame.jacobian - expected).max() < 1e-8
        expected = difference_drift(robot, state, velocity)
        assert np.abs(frame.bias - expected).max() < 1e-7 * (1.0 + np.abs(frame.bias).max())
        assert np.abs(frame.jacobian @ state.v - frame.velocity).max() < 1e-10
        for position, rotation in (frame[:2], dynamics.placement(frame_id)):
            assert np.abs(position - placement.translation).max() < 1e-12
            assert np.abs(rotation - placement.rotation).max() < 1e-12


def test_joints_stand_where_pinocchio_has_them(case):
    robot, _, dynamics, data = case
    last = robot.model.njoints - 1
    assert np.abs(dynamics.joint_position(last) - data.oMi[last].translation).max() < 1e-12
    assert np.abs(dynamics.joint_rotation(last) - data.oMi[last].rotation).max() < 1e-12


def test_a_falling_robot_accelerates_with_gravity(get_robot):
    robot = get_robot("humanoid33")
    state = random_state(robot, 3)
    dynamics = dynamics_at(robot, state.q, state.v)
    dv = np.linalg.solve(dynamics.M, -dynamics.h)
    fall = dynamics.com_jacobian @ dv + dynamics.com_bias
    assert np.abs(fall - np.array([0.0, 0.0, -9.81])).max() < 1e-8
    rate = dynamics.momentum_matrix @ dv + dynamics.momentum_bias
    assert np.abs(rate[3:]).max() < 1e-6  # nothing turns it about its CoM


def test_results_keep_their_numbers_after_the_next_update(robot):
    dynamics, hand = Dynamics(robot), robot.frame_id(robot.hands[0])
    dynamics.update(random_state(robot, 1))
    assert dynamics.frame(hand) is dynamics.frame(hand)
    kept = [*dynamics.frame(hand), *dynamics.placement(hand)]
    kept += [getattr(dynamics, name) for name in VECTORS]
    before = [value.copy() for value in kept]
    dynamics.update(random_state(robot, 2))
    assert np.abs(dynamics.placement(hand)[0] - kept[0]).max() > 1e-2
    dynamics.frame(hand)
    for value, then in zip(kept, before, strict=True):
        assert np.array_equal(value, then)


@pytest.mark.parametrize("name", QUANTITIES)
def test_numbers_outlive_the_object_they_came_from(get_robot, name):
    """A view into Pinocchio's freed memory showed whatever was written there next."""
    robot = get_robot("humanoid33")
    state, others = random_state(robot, 1), [random_state(robot, 100 + k) for k in range(21)]
    expected = getattr(dynamics_at(robot, state.q, state.v), name).copy()
    for k in range(20):
        orphan = getattr(dynamics_at(robot, state.q, state.v), name)
        alive = [dynamics_at(robot, other.q, other.v) for other in others[k : k + 2]]
        assert np.array_equal(orphan, expected)
        del alive


def test_update_replaces_every_quantity_of_one_dynamics_alone(robot):
    dynamics, other = Dynamics(robot), Dynamics(robot)
    com = pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)
    assert np.abs(dynamics.com - com).max() < 1e-12
    assert np.array_equal(dynamics.com_velocity, np.zeros(3))
    dynamics.update(random_state(robot, 1))
    M, state = dynamics.M.copy(), random_state(robot, 2)
    other.update(state)
    assert np.array_equal(dynamics.M, M)
    dynamics.update(state)
    assert dynamics.state is state
    for name in QUANTITIES:
        assert np.array_equal(getattr(dynamics, name), getattr(other, name)), name


def test_an_unknown_frame_is_named_with_the_nearest_choices(robot):
    with pytest.raises(UnknownNameError, match=robot.hands[0]):
        robot.frame_id(robot.hands[0] + "x")


def test_a_state_has_time_zero_and_no_contacts_unless_given(get_robot):
    robot = get_robot("arm6")
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    assert (state.time, state.contacts) == (0.0, {})


def test_gravity_may_change_with_the_model(get_robot):
    robot = get_robot("humanoid33")
    robot = replace(robot, model=robot.model.copy())
    dynamics, state = Dynamics(robot), random_state(robot, 0)
    dynamics.update(state)
    bias, frame = dynamics.com_bias, dynamics.frame(robot.frame_id(robot.hands[0]))
    robot.model.gravity.linear = np.array([0.0, 0.0, -3.71])
    dynamics.update(state)
    # A bias acceleration knows no gravity, whatever the forces.
    assert dynamics.com_bias == pytest.approx(bias, abs=1e-11)
    again = dynamics.frame(robot.frame_id(robot.hands[0]))
    assert again.bias == pytest.approx(frame.bias, abs=1e-11)
