"""What joints do only because a contact still moves is no matter of their limits."""

import numpy as np
import pytest

import poise
from poise.dynamics import Dynamics
from tests.stances import contact_rows

ROBOTS = ("humanoid33", "g1")
DAMPING, BRAKING, MARGIN, HORIZON = 20.0, 8.0, 0.01, 0.02
"""Of a contact [1/s], and of a joint limit [rad/s^2, rad, s], by default."""


def standing(robot):
    """A controller of a robot on both soles, whose limit has met no state yet."""
    return poise.WholeBodyController(robot, poise.default_stack(robot))


def bounds_at(controller, state):
    """Bounds of the joints in a state."""
    assert controller.step(state).status.ok
    limit = controller.stack.joint_limit
    return limit.lower.copy(), limit.upper.copy()


def plain_bounds(robot, q, v):
    """Those of the limit by itself."""
    limit = poise.JointLimit()
    limit.bind(robot)
    dynamics = Dynamics(robot)
    dynamics.update(poise.RobotState(q, v))
    limit.evaluate(dynamics)
    return limit.lower.copy(), limit.upper.copy()


def gentle_bounds(robot, q, v):
    """Those, but for joints of legs, which stand: they stop within the margin beyond a limit."""
    lower, upper = plain_bounds(robot, q, v)
    limit = poise.JointLimit()
    limit.bind(robot)
    stands = np.concatenate(legs(robot)) - robot.base_dofs
    angles, speeds = q[7:][stands], v[6:][stands]
    below, above = angles - limit.q_min[stands], limit.q_max[stands] - angles
    lower[stands] = np.minimum(lower[stands], most_asked(below, -speeds))
    upper[stands] = np.maximum(upper[stands], -most_asked(above, speeds))
    return lower, upper


def most_asked(left, speed):
    """The most that joints are braked by with so much left to a limit, at a speed towards it."""
    speed = np.maximum(speed, 0.0)
    # Within what is left, but in no less than the margin, or half the horizon.
    within = np.maximum(np.maximum(left, MARGIN), 0.5 * (0.5 * HORIZON) * speed)
    back = 2.0 * np.maximum(-left, 0.0) / (10.0 * HORIZON) ** 2
    return np.minimum(BRAKING, speed**2 / (2.0 * within) + back)


def legs(robot):
    """Coordinates of each leg's joints in `v`."""
    model = robot.model
    return [[model.joints[j].idx_v for j in robot.leg_joints(sole)] for sole in robot.soles]


def moving(robot, seed):
    """A state in which everything moves."""
    rng = np.random.default_rng(seed)
    q = robot.q_home.copy()
    q[7:] += rng.uniform(-0.15, 0.15, robot.nj)
    return poise.RobotState(q, rng.normal(0.0, 0.5, robot.nv))


def slips(robot, state):
    """Velocity of both soles, one after the other, and how each leg's joints move its own."""
    dynamics = Dynamics(robot)
    dynamics.update(state)
    J, _ = contact_rows(robot, dynamics, robot.soles)
    return np.split(J @ state.v, 2), [
        J[6 * i : 6 * i + 6][:, leg] for i, leg in enumerate(legs(robot))
    ]


@pytest.mark.parametrize("name", ROBOTS)
def test_soles_that_lie_still_leave_the_limits_as_they_are(name):
    robot = poise.load_robot(name)
    state = moving(robot, 3)
    dynamics = Dynamics(robot)
    dynamics.update(state)
    J, _ = contact_rows(robot, dynamics, robot.soles)
    v = state.v - np.linalg.pinv(J) @ (J @ state.v)
    lower, upper = bounds_at(standing(robot), poise.RobotState(state.q, v))
    gentle_lower, gentle_upper = gentle_bounds(robot, state.q, v)
    np.testing.assert_allclose(lower, gentle_lower, atol=1e-6)
    np.testing.assert_allclose(upper, gentle_upper, atol=1e-6)


@pytest.mark.parametrize("asked", [0.0, 30.0])
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(5))
def test_bounds_are_those_of_the_velocity_without_what_moves_the_soles(name, seed, asked):
    """Nor do they count what soles are asked to change their velocity by, up to so much."""
    robot = poise.load_robot(name)
    state = moving(robot, seed)
    controller, rng = standing(robot), np.random.default_rng(seed)
    changes = asked * rng.uniform(-1.0, 1.0, (2, 6))
    for contact, change in zip(controller.stack.contacts, changes, strict=True):
        contact.set_acceleration(change)
    lower, upper = bounds_at(controller, state)
    still, rate = state.v.copy(), np.zeros(robot.nv)
    for leg, slip, J, change in zip(legs(robot), *slips(robot, state), changes, strict=True):
        # The least velocities of a leg that move its sole so, by a solver of least squares.
        square = np.vstack([J, 1e-2 * np.eye(len(leg))])
        w, r = (
            np.linalg.lstsq(square, np.concatenate([moves, np.zeros(len(leg))]), rcond=None)[0]
            for moves in (slip, change - DAMPING * slip)
        )
        still[leg] -= w
        rate[leg] = r
    gentle_lower, gentle_upper = gentle_bounds(robot, state.q, still)
    joints = slice(robot.base_dofs, robot.nv)
    np.testing.assert_allclose(lower, gentle_lower + rate[joints], rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(upper, gentle_upper + rate[joints], rtol=1e-9, atol=1e-8)


def test_many_states_at_once_have_the_same_bounds():
    robot = poise.load_robot("humanoid33")
    controller = poise.WholeBodyController(robot, poise.default_stack(robot))
    states = [moving(robot, seed) for seed in range(4)]
    together = controller.solve_batch(states)
    for state, command in zip(states, together, strict=True):
        alone = poise.WholeBodyController(robot, poise.default_stack(robot)).step(state)
        np.testing.assert_allclose(command.acceleration, alone.acceleration, atol=1e-6)


def test_a_sole_that_turns_onto_its_ground_does_not_throw_the_robot_aside():
    """The left ankle turns at 5 rad/s, near its limit, because its sole does; all else rests.

    The body would have to be thrown aside for the ankle to slow down sooner than its sole.
    """
    robot = poise.load_robot("g1")
    q, v = robot.q_home.copy(), np.zeros(robot.nv)
    roll = robot.joint_index("left_ankle_roll_joint")
    q[7 + roll], v[6 + roll] = robot.q_max[roll] - 0.08, 5.0
    # By the limit alone, with half of what its range leaves, it would have to slow down so:
    _, upper = plain_bounds(robot, q, v)
    assert upper[roll] < -150.0
    command = standing(robot).step(poise.RobotState(q, v))
    dynamics = Dynamics(robot)
    dynamics.update(poise.RobotState(q, v))
    com = dynamics.com_jacobian @ command.acceleration + dynamics.com_bias
    assert np.linalg.norm(com[:2]) < 2.0


def test_a_sole_that_is_tilted_beyond_its_ankle_does_not_throw_the_robot_aside():
    """The ankle is 2 degrees beyond its limit, as on a bump: its own stop holds it there."""
    robot = poise.load_robot("g1")
    q, v = robot.q_home.copy(), np.zeros(robot.nv)
    roll = robot.joint_index("left_ankle_roll_joint")
    q[7 + roll] = robot.q_max[roll] + 0.035
    _, upper = plain_bounds(robot, q, v)
    assert upper[roll] < -100.0
    state = poise.RobotState(q, v)
    # 45 mrad beyond the margin, back in ten horizons of 20 ms.
    assert bounds_at(standing(robot), state)[1][roll] == pytest.approx(-2.25)
    dynamics = Dynamics(robot)
    dynamics.update(state)
    command = standing(robot).step(state)
    com = dynamics.com_jacobian @ command.acceleration + dynamics.com_bias
    assert np.linalg.norm(com[:2]) < 1.5


def pelvis_accelerations(robot, states, lowest):
    """Of G1 on both soles, whose left ankle may roll no further inwards than that [m/s^2]."""
    limit = poise.JointLimit(position_range={"left_ankle_roll_joint": (lowest, lowest + 0.4)})
    com, soles = poise.ComTask(), [poise.SurfaceContact(sole) for sole in robot.soles]
    stack = poise.Stack(soles, levels=[[com], [poise.PostureTask()]], joint_limit=limit)
    controller, dynamics = poise.WholeBodyController(robot, stack), Dynamics(robot)
    dynamics.update(poise.RobotState(robot.q_home, np.zeros(robot.nv)))
    com.set_target(dynamics.com)
    return np.array([controller.step(state).acceleration[:3] for state in states])


@pytest.mark.parametrize("beyond", [-0.001, 0.0, 0.002])
def test_noise_of_an_ankle_at_its_limit_does_not_shake_a_robot_that_stands(beyond):
    """Read with noise of 0.05 rad/s and asked for all it may, it would throw the pelvis by 2 m/s^2.

    The loads of G1, which stood on a bump, jumped by a third of its weight in a tick for that.
    """
    robot = poise.load_robot("g1")
    roll = 6 + robot.joint_index("left_ankle_roll_joint")
    dynamics = Dynamics(robot)
    dynamics.update(poise.RobotState(robot.q_home, np.zeros(robot.nv)))
    J, _ = contact_rows(robot, dynamics, robot.soles)
    others = [k for k in range(robot.nv) if k != roll]
    states = []
    for speed in np.random.default_rng(5).normal(0.0, 0.05, 20):
        # The body turns over the ankle, and no sole moves.
        v = np.zeros(robot.nv)
        v[roll] = speed
        v[others] = -np.linalg.pinv(J[:, others]) @ (J @ v)
        states.append(poise.RobotState(robot.q_home, v))
    at = robot.q_home[1 + roll] + beyond
    off = pelvis_accelerations(robot, states, at)
    off -= pelvis_accelerations(robot, states, at - 0.2)
    assert np.abs(off).max() < 0.6


def test_a_leg_that_swings_stops_as_hard_as_it_was_told_and_one_that_stands_gently():
    robot = poise.load_robot("g1")
    stack = poise.Stack(
        contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
        levels=[[poise.PostureTask()]],
        joint_limit=poise.JointLimit(
            braking_of={"left_knee_joint": 60.0, "right_knee_joint": 60.0}
        ),
    )
    controller = poise.WholeBodyController(robot, stack)
    q, v = robot.q_home.copy(), np.zeros(robot.nv)
    for side in ("left", "right"):
        knee = robot.joint_index(f"{side}_knee_joint")
        q[7 + knee], v[6 + knee] = robot.q_max[knee] - 0.05, 3.0
    # Both soles at rest: the base and the other joints move so that they are.
    dynamics = Dynamics(robot)
    dynamics.update(poise.RobotState(q, v))
    J, _ = contact_rows(robot, dynamics, robot.soles)
    knees = [6 + robot.joint_index(f"{side}_knee_joint") for side in ("left", "right")]
    others = [k for k in range(robot.nv) if k not in knees]
    v[others] = -np.linalg.pinv(J[:, others]) @ (J @ v)
    stack.contacts[1].release(0.0)
    state = poise.RobotState(q, v)
    assert controller.step(state).acceleration is not None
    left, right = stack.joint_limit.upper[[k - 6 for k in knees]]
    assert left == pytest.approx(-BRAKING)
    assert right < -100.0
