"""What a walk sets: which tasks, and targets that go along with a body that walks and turns."""

import numpy as np
import pinocchio as pin
import pytest

from poise.control import WholeBodyController
from poise.dynamics import Dynamics, RobotState
from poise.errors import TargetError
from poise.locomotion import CarriedTarget, Walker, walking_stack
from poise.robots import GRAVITY
from poise.sim import Plant, PlantConfig, rollout
from poise.stack import FrameTask


@pytest.mark.parametrize("robot", ["humanoid33", "g1"])
def test_trunk_and_arms_give_most_of_what_an_edge_lacks_and_nothing_inside(get_robot, robot):
    robot = get_robot(robot)
    stack = walking_stack(robot)
    controller = WholeBodyController(robot, stack)
    dynamics = Dynamics(robot)
    dynamics.update(state := RobotState(robot.q_home, np.zeros(robot.nv)))
    com, height = stack.task("com"), float(dynamics.com[2])
    # The limit leaves the CoM alone that a foothold on each side catches.
    stack.balance_limit.expect_step([[x, y] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])

    def missed(shift):
        com.set_acceleration([-GRAVITY * shift / height, 0.0, 0.0])
        controller.reset()
        controller.step(state)
        rows = {row.name: row.residual for row in controller.status().tasks}
        return rows["com"], max(rows["pelvis"], rows["torso"])

    inside, beyond = missed(0.02), missed(0.2)
    assert max(inside) < 1e-6
    assert beyond[1] > 1.0
    assert beyond[0] < 0.1 * beyond[1]


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


HOME = pin.SE3(pin.exp3(np.array([0.3, -0.5, 0.2])), np.array([0.3, 0.2, 1.0]))
ORIGIN = np.array([0.02, -0.01, 0.0])


class CarriedHand:
    """A hand's task with a carried target, and what it follows, at a robot that stands still."""

    def __init__(self, robot, axes="pose"):
        self.task = FrameTask("left_hand", axes)
        self.task.bind(robot)
        self.target = CarriedTarget(self.task, HOME.translation, HOME.rotation, ORIGIN)
        self._still = Dynamics(robot)

    def follow(self, body):
        """Position, rotation, velocity and acceleration of the task's target."""
        self.target.write(body)
        return followed(self.task, self._still)


def followed(task, still):
    """The same of any frame task."""
    task.set_speed(np.inf)
    task.evaluate(still)
    acceleration = task.reference - task.kp * task.error - task.kd * task.error_rate
    return task.target_position, task.target_rotation, task.error_rate.copy(), acceleration


def test_a_carried_pose_moves_and_turns_with_the_body_and_so_do_its_rates(get_robot):
    rng = np.random.default_rng(0)
    hand, d, p = CarriedHand(get_robot("humanoid33")), *rng.normal(size=(2, 3, 3))
    axis = np.array([0.6, 0.0, 0.8])

    def at(t):
        powers = np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
        angle = np.array([0.3 + 0.8 * t - 0.6 * t * t, 0.8 - 1.2 * t, -1.2])
        turned = np.array([0.4 * t + 0.7 * t * t, 0.4 + 1.4 * t, 1.4])
        place, velocity, acceleration = powers @ p
        rotation = pin.exp3(turned[0] * axis) @ HOME.rotation
        hand.target.set_target(
            place,
            rotation,
            np.append(velocity, turned[1] * axis),
            np.append(acceleration, turned[2] * axis),
        )
        displacement = np.column_stack((powers @ d, angle))
        found = hand.follow(displacement)
        turn = pin.utils.rotate("z", angle[0])
        wanted = ORIGIN + displacement[0, :3] + turn @ (place - ORIGIN)
        np.testing.assert_allclose(found[0], wanted, atol=1e-12)
        np.testing.assert_allclose(found[1], turn @ rotation, atol=1e-12)
        return found

    h = 1e-5
    before, here, after = at(0.4 - h), at(0.4), at(0.4 + h)
    slope = np.append(after[0] - before[0], pin.log3(after[1] @ before[1].T)) / (2.0 * h)
    np.testing.assert_allclose(here[2], slope, atol=1e-7)
    np.testing.assert_allclose(here[3], (after[2] - before[2]) / (2.0 * h), atol=1e-7)


POSE = pin.SE3(pin.exp3(np.array([-0.2, 0.4, 1.1])), np.array([0.5, 0.1, 0.9]))
QUATERNION = pin.Quaternion(POSE.rotation).coeffs()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (([0.1, 0.2],), "target of carried task 'left_hand pose' has the wrong shape"),
        ((POSE, QUATERNION), "one alone"),
        ((None, 2.0 * QUATERNION), "length"),
        ((POSE, None, [1.0, 0.0, 0.0]), "velocity of carried task 'left_hand pose'"),
        ((POSE, None, None, np.full(6, np.nan)), "acceleration of carried task"),
    ],
)
def test_a_carried_target_refuses_what_a_task_refuses_and_stays(get_robot, values, said):
    hand = CarriedHand(get_robot("humanoid33"))
    before = hand.follow(np.zeros((3, 4)))
    with pytest.raises(TargetError, match=said):
        hand.target.set_target(*values)
    for ours, own in zip(hand.follow(np.zeros((3, 4))), before, strict=True):
        np.testing.assert_array_equal(ours, own)
