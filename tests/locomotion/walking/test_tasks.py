"""What a walk sets: which tasks, and targets that go along with a body that walks and turns."""

import numpy as np
import pytest

from poise.control import WholeBodyController
from poise.locomotion import Stride, Walker, plan_footsteps, walking_stack
from poise.locomotion._walking._tasks import _in_turning_axes, find_walk_tasks
from poise.sim import Plant, PlantConfig, rollout


@pytest.mark.parametrize("robot", ["humanoid33", "g1"])
def test_a_walk_sets_the_com_and_each_foots_own_task_and_contact(get_robot, robot):
    robot = get_robot(robot)
    plan, stack = plan_footsteps(robot, [Stride(steps=2)]), walking_stack(robot)
    stack.bind(robot)
    found = find_walk_tasks(robot, plan, stack, None)
    assert found.com is stack.task("com")
    assert [task.frame for task in found.feet] == list(plan.soles)
    assert [contact.frame for contact in found.contacts] == list(plan.soles)
    assert not {task.name for task in found.feet} & set(found.carried)


def test_where_not_all_can_be_had_the_com_gives_least_and_the_pelvis_most(get_robot):
    robot = get_robot("g1")
    stack = walking_stack(robot)
    stack.bind(robot)
    com, foot, pelvis = (stack.task(name).weight for name in ("com", "left_foot", "pelvis"))
    assert com.min() > foot[:3].max() > foot[3:].max() > pelvis.max()


@pytest.mark.parametrize("robot", ["humanoid33", "g1", "talos", "icub"])
def test_legs_alone_stop_hard_before_their_limits(get_robot, robot):
    robot = get_robot(robot)
    limit = walking_stack(robot).joint_limit
    legs = {robot.model.names[j] for sole in robot.soles for j in robot.leg_joints(sole)}
    assert set(limit.braking_of) == legs
    assert min(limit.braking_of.values()) > limit.braking


def test_arms_at_their_stops_do_not_throw_a_robot_that_is_pushed_as_it_walks(get_robot):
    """The shoulders of TALOS come to their limits as its hands go along."""
    robot = get_robot("talos")
    plant = Plant(robot, PlantConfig(control_dt=0.002))
    stack = walking_stack(robot)
    walker = Walker(robot, stack)
    walker.set_velocity(0.3, 0.0, 0.0)
    plant.push(robot.torso, (0.0, -0.25 * robot.mass / 0.1, 0.0), 0.1, 2.5)
    for _ in rollout(plant, WholeBodyController(robot, stack), walker, duration=5.0):
        assert not plant.fallen
    assert walker.steps_made >= 6


def test_rates_of_a_point_in_turning_axes_are_derivatives():
    """A point that moves along a parabola, in axes at angle psi = 0.3 + 0.8 t - 0.6 t^2."""
    rng = np.random.default_rng(0)
    start, velocity, acceleration = rng.normal(size=(3, 3))

    def at(t):
        angle, rate, second = 0.3 + 0.8 * t - 0.6 * t * t, 0.8 - 1.2 * t, -1.2
        c, s = np.cos(angle), np.sin(angle)
        motion = np.array(
            [
                start + t * velocity + 0.5 * t * t * acceleration,
                velocity + t * acceleration,
                acceleration,
            ]
        )
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return _in_turning_axes(motion, turn, rate, second)

    h = 1e-5
    here, slope = at(0.4), (at(0.4 + h) - at(0.4 - h)) / (2.0 * h)
    np.testing.assert_allclose(here[1:], slope[:2], atol=1e-8)
