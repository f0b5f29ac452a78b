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


@pytest.mark.parametrize(
    ("room", "speed", "alone", "bound"), [(0.08, 5.0, -150.0, None), (-0.035, 0.0, -100.0, -2.25)]
)
def test_an_ankle_that_only_its_ground_moves_does_not_throw_the_robot_aside(
    room, speed, alone, bound
):
    """Its sole turns onto the ground, or lies on a bump and tilts it 2 degrees beyond its limit.

    The body would have to be thrown aside for the ankle to slow down sooner than its sole.
    """
    robot = poise.load_robot("g1")
    q, v = robot.q_home.copy(), np.zeros(robot.nv)
    roll = robot.joint_index("left_ankle_roll_joint")
    q[7 + roll], v[6 + roll] = robot.q_max[roll] - room, speed
    # By the limit alone it would have to slow down so:
    assert plain_bounds(robot, q, v)[1][roll] < alone
    state = poise.RobotState(q, v)
    if bound is not None:
        # 45 mrad beyond the margin, back in ten horizons of 20 ms.
        assert bounds_at(standing(robot), state)[1][roll] == pytest.approx(bound)
    command = standing(robot).step(state)
    dynamics = Dynamics(robot)
    dynamics.update(state)
    com = dynamics.com_jacobian @ command.acceleration + dynamics.com_bias
    assert np.linalg.norm(com[:2]) < (2.0 if speed else 1.5)


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
