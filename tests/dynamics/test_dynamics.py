from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from oracles import (
    difference_drift,
    difference_jacobian,
    dynamics_at,
    frame_placement,
    moved,
    random_state,
)

from poise.dynamics import Dynamics, RobotState, _dynamics
from poise.errors import UnknownNameError

ROBOTS = ("humanoid33", "g1", "upper17", "arm6")
SEEDS = range(10)
GRAVITY = np.array([0.0, 0.0, -9.81])


@pytest.fixture(params=ROBOTS)
def robot(request, get_robot):
    return get_robot(request.param)


@pytest.mark.parametrize("seed", SEEDS)
def test_equation_of_motion_equals_inverse_dynamics(robot, seed):
    state = random_state(robot, seed)
    dv = np.random.default_rng(100 + seed).normal(size=robot.nv)
    dynamics = dynamics_at(robot, state.q, state.v)
    data = robot.model.createData()
    expected = pin.rnea(robot.model, data, state.q, state.v, dv)
    scale = np.abs(expected).max()
    assert np.abs(dynamics.M @ dv + dynamics.h - expected).max() < 1e-12 * scale


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_matrix_is_symmetric_and_equals_the_composite_body_algorithm(robot, seed):
    state = random_state(robot, seed)
    M = dynamics_at(robot, state.q, state.v).M
    expected = np.triu(pin.crba(robot.model, robot.model.createData(), state.q))
    expected = expected + np.triu(expected, 1).T
    assert np.array_equal(M, M.T)
    assert np.abs(M - expected).max() < 1e-12
    assert np.linalg.eigvalsh(M)[0] > 0.0


@pytest.mark.parametrize("seed", SEEDS)
def test_kinetic_energy_equals_the_sum_over_bodies(robot, seed):
    state = random_state(robot, seed)
    dynamics = dynamics_at(robot, state.q, state.v)
    energy = 0.5 * state.v @ dynamics.M @ state.v
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, state.q, state.v)
    bodies = sum(
        0.5 * data.v[i].vector @ robot.model.inertias[i].matrix() @ data.v[i].vector
        for i in range(1, robot.model.njoints)
    )
    rotors = 0.5 * robot.model.armature @ state.v**2
    assert energy == pytest.approx(bodies + rotors, rel=1e-10)


@pytest.mark.parametrize("seed", SEEDS)
def test_gravity_at_rest_is_the_gradient_of_potential_energy(robot, seed):
    state = random_state(robot, seed)

    def fall(minus, plus):
        heights = [
            pin.centerOfMass(robot.model, robot.model.createData(), q)[2] for q in (minus, plus)
        ]
        return np.array([robot.mass * 9.81 * (heights[1] - heights[0])])

    h = dynamics_at(robot, state.q, np.zeros(robot.nv)).h
    gradient = difference_jacobian(robot, state.q, fall)[0]
    assert np.abs(h - gradient).max() < 1e-5


@pytest.mark.parametrize("seed", SEEDS)
def test_momentum_is_the_sum_over_bodies_about_the_com(robot, seed):
    state = random_state(robot, seed)
    dynamics = dynamics_at(robot, state.q, state.v)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, state.q, state.v)
    total = pin.Force.Zero()
    for i in range(1, robot.model.njoints):
        total += data.oMi[i].act(robot.model.inertias[i] * data.v[i])
    com = pin.centerOfMass(robot.model, robot.model.createData(), state.q)
    angular = total.angular - np.cross(com, total.linear)
    assert np.abs(dynamics.momentum[:3] - total.linear).max() < 1e-9
    assert np.abs(dynamics.momentum[3:] - angular).max() < 1e-9
    assert np.abs(dynamics.momentum_matrix @ state.v - dynamics.momentum).max() < 1e-9
    assert np.abs(dynamics.com_velocity * robot.mass - total.linear).max() < 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_momentum_and_com_bias_equal_differences_along_zero_acceleration(robot, seed):
    state = random_state(robot, seed)
    dynamics = dynamics_at(robot, state.q, state.v)

    def momentum(q, v):
        data = robot.model.createData()
        return pin.computeCentroidalMomentum(robot.model, data, q, v).vector.copy()

    def com_velocity(q, v):
        data = robot.model.createData()
        pin.centerOfMass(robot.model, data, q, v)
        return data.vcom[0].copy()

    scale = 1.0 + np.abs(dynamics.momentum_bias).max()
    expected = difference_drift(robot, state, momentum)
    assert np.abs(dynamics.momentum_bias - expected).max() < 1e-7 * scale
    expected = difference_drift(robot, state, com_velocity)
    assert np.abs(dynamics.com_bias - expected).max() < 1e-7 * scale


@pytest.mark.parametrize("seed", SEEDS)
def test_com_jacobian_equals_differences(robot, seed):
    state = random_state(robot, seed)
    dynamics = dynamics_at(robot, state.q, state.v)

    def difference(minus, plus):
        com = [pin.centerOfMass(robot.model, robot.model.createData(), q) for q in (minus, plus)]
        return com[1] - com[0]

    expected = difference_jacobian(robot, state.q, difference)
    assert np.abs(dynamics.com_jacobian - expected).max() < 1e-8
    assert np.abs(dynamics.com_jacobian @ state.v - dynamics.com_velocity).max() < 1e-10


@pytest.mark.parametrize("seed", SEEDS)
def test_frame_jacobian_and_velocity_equal_differences(robot, seed):
    state = random_state(robot, seed)
    dynamics = dynamics_at(robot, state.q, state.v)
    for name in (*robot.hands, *robot.soles, robot.torso):
        frame = dynamics.frame(robot.frame_id(name))

        def difference(minus, plus, name=name):
            a, b = (frame_placement(robot, q, name) for q in (minus, plus))
            turn = pin.log3(b.rotation @ a.rotation.T)
            return np.concatenate((b.translation - a.translation, turn))

        expected = difference_jacobian(robot, state.q, difference)
        assert np.abs(frame.jacobian - expected).max() < 1e-8
        placement = frame_placement(robot, state.q, name)
        assert np.abs(frame.position - placement.translation).max() < 1e-12
        assert np.abs(frame.rotation - placement.rotation).max() < 1e-12
        assert np.abs(frame.jacobian @ state.v - frame.velocity).max() < 1e-10


@pytest.mark.parametrize("seed", SEEDS)
def test_frame_bias_equals_differences_of_the_classical_velocity(robot, seed):
    state = random_state(robot, seed)
    dynamics = dynamics_at(robot, state.q, state.v)
    for name in (*robot.hands, *robot.soles, robot.torso):
        frame_id = robot.frame_id(name)

        def velocity(q, v, frame_id=frame_id):
            data = robot.model.createData()
            pin.computeJointJacobians(robot.model, data, q)
            pin.updateFramePlacements(robot.model, data)
            aligned = pin.LOCAL_WORLD_ALIGNED
            return pin.getFrameJacobian(robot.model, data, frame_id, aligned) @ v

        expected = difference_drift(robot, state, velocity)
        bias = dynamics.frame(frame_id).bias
        assert np.abs(bias - expected).max() < 1e-7 * (1.0 + np.abs(bias).max())


def test_a_falling_robot_accelerates_with_gravity(get_robot):
    robot = get_robot("humanoid33")
    state = random_state(robot, 3)
    dynamics = dynamics_at(robot, state.q, state.v)
    dv = np.linalg.solve(dynamics.M, -dynamics.h)
    assert np.abs(dynamics.com_jacobian @ dv + dynamics.com_bias - GRAVITY).max() < 1e-8
    rate = dynamics.momentum_matrix @ dv + dynamics.momentum_bias
    assert np.abs(rate[3:]).max() < 1e-6  # nothing turns it about its COM


def test_a_frame_is_evaluated_once_a_tick(robot, monkeypatch):
    calls = []
    dynamics = Dynamics(robot)
    evaluate = _dynamics.evaluate_frame
    monkeypatch.setattr(_dynamics, "evaluate_frame", lambda *a: calls.append(a) or evaluate(*a))
    frame_id = robot.frame_id(robot.hands[0])
    first = dynamics.frame(frame_id)
    assert dynamics.frame(frame_id) is first
    assert len(calls) == 1
    dynamics.update(random_state(robot, 1))
    assert dynamics.frame(frame_id) is not first
    assert len(calls) == 2


def test_a_frame_keeps_its_numbers_after_the_next_update(robot):
    dynamics = Dynamics(robot)
    frame = dynamics.frame(robot.frame_id(robot.hands[0]))
    before = [frame.position.copy(), frame.rotation.copy(), frame.jacobian.copy()]
    dynamics.update(random_state(robot, 1))
    dynamics.frame(robot.frame_id(robot.hands[0]))
    for kept, then in zip((frame.position, frame.rotation, frame.jacobian), before, strict=True):
        assert np.array_equal(kept, then)


VECTORS = ("com", "com_velocity", "com_bias", "momentum", "momentum_bias")


def test_a_placement_is_that_of_the_frame_and_keeps_its_numbers(robot):
    dynamics, hand = Dynamics(robot), robot.frame_id(next(iter(robot.hands)))
    dynamics.update(random_state(robot, 1))
    position, rotation = dynamics.placement(hand)
    frame = dynamics.frame(hand)
    np.testing.assert_allclose(position, frame.position, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(rotation, frame.rotation, rtol=0.0, atol=1e-13)
    kept = position.copy(), rotation.copy()
    dynamics.update(random_state(robot, 2))
    assert np.abs(dynamics.placement(hand)[0] - kept[0]).max() > 1e-2
    np.testing.assert_array_equal(position, kept[0])
    np.testing.assert_array_equal(rotation, kept[1])


def test_vectors_keep_their_numbers_after_the_next_update(robot):
    dynamics = Dynamics(robot)
    dynamics.update(random_state(robot, 1))
    kept = {name: getattr(dynamics, name) for name in VECTORS}
    then = {name: value.copy() for name, value in kept.items()}
    dynamics.update(random_state(robot, 2))
    for name in VECTORS:
        assert np.array_equal(kept[name], then[name]), name


@pytest.mark.parametrize("name", [*VECTORS, "M", "h", "com_jacobian", "momentum_matrix"])
def test_numbers_outlive_the_object_they_came_from(get_robot, name):
    """A view into Pinocchio's freed memory showed whatever was written there next."""
    robot = get_robot("humanoid33")
    state = random_state(robot, 1)
    expected = getattr(dynamics_at(robot, state.q, state.v), name).copy()
    for seed in range(20):
        orphan = getattr(dynamics_at(robot, state.q, state.v), name)
        others = [dynamics_at(robot, *_other(robot, seed + k)) for k in range(2)]
        assert np.array_equal(orphan, expected)
        del others


def _other(robot, seed):
    state = random_state(robot, 100 + seed)
    return state.q, state.v


def test_update_replaces_every_quantity(robot):
    dynamics = Dynamics(robot)
    dynamics.update(random_state(robot, 1))
    state = random_state(robot, 2)
    dynamics.update(state)
    fresh = dynamics_at(robot, state.q, state.v)
    assert dynamics.state is state
    for name in ("M", "h", "com", "com_velocity", "com_jacobian", "com_bias"):
        assert np.array_equal(getattr(dynamics, name), getattr(fresh, name)), name
    for name in ("momentum", "momentum_matrix", "momentum_bias"):
        assert np.array_equal(getattr(dynamics, name), getattr(fresh, name)), name


def test_two_dynamics_of_one_robot_do_not_disturb_each_other(robot):
    state = random_state(robot, 1)
    first = dynamics_at(robot, state.q, state.v)
    M = first.M.copy()
    dynamics_at(robot, moved(robot, state.q, np.full(robot.nv, 0.3)), state.v)
    assert np.array_equal(first.M, M)


def test_joint_position_is_the_origin_of_the_joint(robot):
    state = random_state(robot, 1)
    dynamics = dynamics_at(robot, state.q, state.v)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, state.q)
    last = robot.model.njoints - 1
    assert np.abs(dynamics.joint_position(last) - data.oMi[last].translation).max() < 1e-12


def test_a_new_dynamics_stands_at_home(robot):
    dynamics = Dynamics(robot)
    com = pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)
    assert np.abs(dynamics.com - com).max() < 1e-12
    assert np.array_equal(dynamics.com_velocity, np.zeros(3))


def test_an_unknown_frame_is_named_with_the_nearest_choices(robot):
    with pytest.raises(UnknownNameError, match=robot.hands[0]):
        robot.frame_id(robot.hands[0] + "x")


def test_a_state_has_time_zero_and_no_contacts_unless_told(robot):
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    assert state.time == 0.0
    assert state.contacts == {}


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
