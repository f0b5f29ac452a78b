"""Two feet share what they have to hold by their loads, before pressure goes to an edge."""

import numpy as np
import pytest

import poise

CONTROLLERS = (poise.WholeBodyController, poise.ReducedController)


def swaying(robot, controller, aside):
    """The answer to a CoM that is to go aside from rest [m/s^2], and what each sole reaches [m]."""
    stack = poise.default_stack(robot)
    solver = controller(robot, stack)
    state = poise.RobotState(robot.q_home, np.zeros(robot.nv))
    dynamics = poise.Dynamics(robot)
    dynamics.update(state)
    com = next(t for level in stack.levels for t in level if isinstance(t, poise.ComTask))
    com.set_target(dynamics.com, np.zeros(3), np.array([0.0, aside, 0.0]))
    command = solver.step(state)
    assert command.status.ok
    return command, {c.name: c.pressure_reach.copy() for c in stack.contacts}


@pytest.mark.fast_cases(6)
@pytest.mark.parametrize("aside", [0.0, 0.3, -0.5, 0.9])
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_pressure_stays_in_the_middle_of_soles_that_can_share(get_robot, name, controller, aside):
    robot = get_robot(name)
    command, reach = swaying(robot, controller, aside)
    loads = {sole: wrench[2] for sole, wrench in command.wrenches.items()}
    # To the left the ZMP is on the right.
    left, right = (loads[sole] for sole in robot.soles)
    assert right - left == pytest.approx(
        robot.mass * aside * _lever(robot), rel=0.15, abs=0.02 * robot.weight
    )
    for sole, wrench in command.wrenches.items():
        _, _, load, about_x, about_y, _ = wrench
        # One that hardly carries, an eighth of the weight on humanoid33, is held by little anyway.
        if load > 0.2 * robot.weight:
            assert abs(about_x / load) < 0.4 * reach[sole][1]
            assert abs(about_y / load) < 0.4 * reach[sole][0]


def _lever(robot):
    """Height of the CoM over half the distance of the soles."""
    dynamics = poise.Dynamics(robot)
    dynamics.update(poise.RobotState(robot.q_home, np.zeros(robot.nv)))
    left, right = (dynamics.frame(robot.frame_id(sole)).position for sole in robot.soles)
    return (dynamics.com[2] - left[2]) / (0.5 * np.linalg.norm(left - right))


def test_the_metric_of_a_contact_measures_by_the_edges_of_its_cone(get_robot):
    """The mean square of its rows, each over its bound at unit normal force."""
    robot = get_robot("g1")
    contact = poise.SurfaceContact("left_sole")
    contact.bind(robot)
    metric = contact.metric
    np.testing.assert_allclose(metric, metric.T)
    assert (np.linalg.eigvalsh(metric) > 0.0).all()
    rows = contact.cone / -contact.cone[:, 2:3]
    rng = np.random.default_rng(0)
    for _ in range(50):
        wrench = rng.normal(size=6)
        assert wrench @ metric @ wrench == pytest.approx(np.mean((rows @ wrench) ** 2))
    assert metric[2, 2] == pytest.approx(1.0)
