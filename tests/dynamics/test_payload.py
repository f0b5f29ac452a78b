"""A payload in the dynamics, against Pinocchio on a model that was made with it."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import near_home

from poise import WholeBodyController, default_stack
from poise.control import CommandStatus
from poise.dynamics import Dynamics, PayloadEstimate, RobotState
from poise.errors import ConfigurationError

NAMES = ["g1", "humanoid33"]


def carrying(state, payload):
    return RobotState(state.q, state.v, state.contacts, state.time, payload=payload)


# A link of iCub has an inertia of -5e-20, which Pinocchio refuses to make anew.
@pytest.mark.parametrize("name", [*NAMES, "icub"])
@pytest.mark.parametrize(("part", "offset"), [(0.2, [0.02, -0.01, 0.03]), (-0.3, [-0.03, 0.02, 0])])
def test_mass_and_centre_are_off_by_what_it_says(get_robot, name, part, offset):
    robot, state = get_robot(name), near_home(get_robot(name), 1, speed=0.5)
    dynamics = Dynamics(robot)
    dynamics.update(state)
    com, torso = dynamics.com, dynamics.placement(robot.frame_id(robot.torso))[1]
    dynamics.update(carrying(state, PayloadEstimate(part * robot.mass, np.array(offset))))
    np.testing.assert_allclose(dynamics.com - com, torso @ offset, atol=1e-12)
    assert np.linalg.eigvalsh(dynamics.M)[0] > 0.0
    # At rest the base bears all of the weight.
    dynamics.update(carrying(RobotState(state.q, 0.0 * state.v), dynamics.state.payload))
    assert np.linalg.norm(dynamics.h[:3]) == pytest.approx((1.0 + part) * robot.weight)


@pytest.mark.parametrize("name", NAMES)
def test_everything_agrees_with_a_model_made_so(get_robot, name):
    robot, state = get_robot(name), near_home(get_robot(name), 2, speed=0.5)
    ratio, offset = 1.15, np.array([0.01, 0.02, -0.01])
    torso = robot.model.frames[robot.frame_id(robot.torso)]
    model = robot.model.copy()
    for joint, inertia in enumerate(robot.model.inertias):
        lever = inertia.lever.copy()
        if joint == torso.parentJoint:
            lever += torso.placement.rotation @ offset * robot.mass / inertia.mass
        model.inertias[joint] = pin.Inertia(ratio * inertia.mass, lever, ratio * inertia.inertia)
    data = model.createData()
    dynamics = Dynamics(robot)
    dynamics.update(carrying(state, PayloadEstimate((ratio - 1.0) * robot.mass, offset)))
    M = pin.crba(model, data, state.q)
    np.testing.assert_allclose(dynamics.M, np.triu(M) + np.triu(M, 1).T, atol=1e-10)
    h = pin.nonLinearEffects(model, data, state.q, state.v)
    np.testing.assert_allclose(dynamics.h, h, atol=1e-9)
    pin.computeCentroidalMomentum(model, data, state.q, state.v)
    np.testing.assert_allclose(dynamics.momentum, data.hg.vector, atol=1e-10)
    np.testing.assert_allclose(dynamics.com_velocity, data.hg.linear / (ratio * robot.mass))


@pytest.mark.parametrize("name", NAMES)
def test_what_hands_hold_is_where_the_hands_are(get_robot, name):
    robot, state = get_robot(name), near_home(get_robot(name), 4, speed=0.5)
    left, right = robot.hands
    dynamics, known = Dynamics(robot), Dynamics(robot.carrying(left, 0.5).carrying(right, 2.0))
    dynamics.update(carrying(state, PayloadEstimate(0.0, np.zeros(3), np.array([0.5, 2.0]))))
    known.update(state)
    np.testing.assert_allclose(dynamics.M, known.M, atol=1e-10)
    np.testing.assert_allclose(dynamics.h, known.h, atol=1e-9)
    np.testing.assert_allclose(dynamics.com, known.com, atol=1e-12)
    np.testing.assert_allclose(dynamics.com_velocity, known.com_velocity, atol=1e-12)
    # Hands that the robot has not hold nothing.
    dynamics.update(carrying(state, PayloadEstimate(0.0, np.zeros(3), np.array([0.5, 2.0, 7.0]))))
    np.testing.assert_allclose(dynamics.com, known.com, atol=1e-12)


def test_nobody_else_feels_it_and_without_it_all_is_as_before(get_robot):
    robot, state = get_robot("g1"), near_home(get_robot("g1"), 3, speed=0.5)
    before = [inertia.mass for inertia in robot.model.inertias]
    one, other = Dynamics(robot), Dynamics(robot)
    other.update(state)
    M, com = other.M.copy(), other.com
    one.update(carrying(state, PayloadEstimate(5.0, np.array([0.05, 0.0, 0.0]))))
    other.update(state)
    np.testing.assert_array_equal(other.M, M)
    assert [inertia.mass for inertia in robot.model.inertias] == before
    one.update(state)
    np.testing.assert_allclose(one.M, M, atol=1e-13)
    np.testing.assert_allclose(one.com, com, atol=1e-15)


def test_a_controller_gives_the_weight_that_it_is_told(get_robot):
    robot = get_robot("g1")
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    heavy = carrying(state, PayloadEstimate(5.0, np.zeros(3)))
    controller = WholeBodyController(robot, default_stack(robot))
    for told, weight in ((heavy, robot.weight + 5.0 * 9.81), (state, robot.weight)):
        command = controller.step(told)
        assert sum(w[2] for w in command.wrenches.values()) == pytest.approx(weight, rel=1e-6)
    batch = WholeBodyController(robot, default_stack(robot)).solve_batch([state, heavy, state])
    carried = sum(w[:, 2] for w in batch.wrenches.values())
    np.testing.assert_allclose(carried - robot.weight, [0.0, 5.0 * 9.81, 0.0], atol=1e-3)


def test_what_is_none_is_a_bad_state(get_robot):
    robot = get_robot("g1")
    controller = WholeBodyController(robot, default_stack(robot))
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    object.__setattr__(state, "payload", "heavy")
    assert controller.step(state).status is CommandStatus.BAD_STATE
    assert "payload" in controller.status().reason


@pytest.mark.parametrize(
    ("mass", "offset", "held"),
    [
        (np.nan, 0.0, [0.0]),
        (1.0, np.inf, [0.0]),
        (0.0, 0.0, [-0.1]),
        (0.0, 0.0, [np.nan, 0.0]),
        (0.0, 0.0, [np.inf]),
    ],
)
def test_numbers_that_cannot_be_are_refused(mass, offset, held):
    with pytest.raises(ConfigurationError, match="payload"):
        PayloadEstimate(mass, np.full(3, offset), np.array(held))


def test_no_robot_loses_all_of_its_mass(get_robot):
    robot = get_robot("g1")
    dynamics = Dynamics(robot)
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    dynamics.update(carrying(state, PayloadEstimate(-2.0 * robot.mass, np.zeros(3))))
    assert np.linalg.eigvalsh(dynamics.M)[0] > 0.0


def test_whoever_says_what_is_carried_may_write_over_it(get_robot):
    robot, offset = get_robot("humanoid33"), np.array([0.01, 0.0, 0.0])
    payload, dynamics = PayloadEstimate(5.0, offset), Dynamics(robot)
    state = near_home(robot, 3)
    dynamics.update(carrying(state, payload))
    com = dynamics.com.copy()
    offset[:] = np.nan
    dynamics.update(state)
    dynamics.update(carrying(state, payload))
    np.testing.assert_array_equal(dynamics.com, com)
