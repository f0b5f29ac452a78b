"""A plant starts with loaded feet at rest: nothing has to land first."""

import mujoco
import numpy as np
import pytest

import poise
from poise.sim import Block, Plant, PlantConfig

SLOPE = 0.08


def stand(plant, seconds=0.05):
    """Largest motion of CoM and soles [m], and load over weight, under a controller."""
    robot = plant.robot
    controller = poise.WholeBodyController(robot)
    com, soles = plant.com, soles_of(plant)
    moved, loads = 0.0, [load(plant)]
    for tick in poise.rollout(plant, controller, duration=seconds):
        assert tick.command.status.ok
        off = [plant.com - com, *(soles_of(plant) - soles)]
        moved = max(moved, *(float(np.linalg.norm(d)) for d in off))
        loads.append(load(plant))
    return moved, np.array(loads)


def soles_of(plant):
    return np.array([plant.data.site(name).xpos for name in plant.robot.soles])


def load(plant):
    up = (
        plant.data.site(n).xmat.reshape(3, 3)[2] @ w[:3] for n, w in plant.sole_wrenches().items()
    )
    return sum(up) / (plant.mass * 9.81)


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("name", ["humanoid33", "biped20", "g1", "talos", "icub"])
def test_a_robot_stands_loaded_from_the_first_moment(get_robot, name):
    moved, loads = stand(Plant(get_robot(name)))
    # Landing, these moved by 20 to 140 micrometres, and were loaded by 0 to 1.37 times the weight.
    assert moved < 1e-6
    np.testing.assert_allclose(loads, 1.0, rtol=0, atol=2e-3)


def test_it_hardly_moves_the_robot_and_takes_no_time_to_speak_of(get_robot):
    from time import process_time

    robot = get_robot("humanoid33")
    plant, times = Plant(robot), []
    for _ in range(5):
        begin = process_time()
        state = plant.reset()
        times.append(process_time() - begin)
    assert min(times) < 0.05
    off = state.q - robot.q_home
    assert 0.0 < np.abs(off).max() < 1e-4
    np.testing.assert_array_equal(off[7:], 0.0)
    assert not state.v.any()


def test_the_first_state_knows_the_load_and_no_acceleration(biped):
    plant = Plant(biped)
    assert load(plant) == pytest.approx(1.0, abs=1e-4)
    assert np.abs(plant.data.qacc).max() < 1e-3
    np.testing.assert_allclose(plant.imu[1][2], 9.81, rtol=1e-4)


@pytest.mark.parametrize("actuation", ["position", "velocity"])
def test_servos_carry_the_robot_without_sagging(biped, actuation):
    plant = Plant(biped, PlantConfig(actuation=actuation))
    start = plant.state().q
    while plant.time < 0.3:
        plant.step(None)
    np.testing.assert_allclose(plant.state().q, start, rtol=0, atol=1e-5)


def test_a_robot_in_the_air_is_left_there(biped):
    for height in (2e-3, 1.0):
        q = biped.q_home.copy()
        q[2] += height
        plant = Plant(biped)
        np.testing.assert_array_equal(plant.reset(q).q, q)
        assert load(plant) == 0.0
        np.testing.assert_array_equal(plant.data.ctrl, 0.0)


def test_a_robot_that_would_tip_over_is_left_where_it_is(biped):
    q = biped.q_home.copy()
    for side in ("left", "right"):
        q[7 + biped.joint_names.index(f"{side}_ankle_pitch")] -= 0.4
    q = turned_about_y(biped, 0.4, q)
    plant = Plant(biped)
    np.testing.assert_array_equal(plant.reset(q).q, q)


def turned_about_y(robot, angle, q=None):
    """Everything turned about the world's y axis, so that soles stay on a floor turned alike."""
    q, turn = (robot.q_home if q is None else q).copy(), np.empty(4)
    mujoco.mju_axisAngle2Quat(turn, np.array([0.0, 1.0, 0.0]), angle)
    place, quaternion = np.empty(3), np.empty(4)
    mujoco.mju_rotVecQuat(place, q[:3], turn)
    mujoco.mju_mulQuat(quaternion, turn, q[[6, 3, 4, 5]])
    q[:3], q[3:7] = place, quaternion[[1, 2, 3, 0]]
    return q


def test_on_a_slope_friction_creeps_as_it_does_under_load(get_robot):
    robot = get_robot("humanoid33")
    plant = Plant(robot, PlantConfig(floor_slope=(0.0, SLOPE)))
    state = plant.reset(turned_about_y(robot, SLOPE))
    assert load(plant) == pytest.approx(1.0, abs=1e-4)
    assert 0.0 < np.abs(state.v).max() < 1e-4
    moved, loads = stand(plant)
    assert moved < 2e-6
    np.testing.assert_allclose(loads, 1.0, rtol=0, atol=2e-3)


def test_feet_rest_on_blocks_of_other_heights(biped):
    """One foot on a block, its leg bent so that the sole lies flat on it to a tenth of a mm."""
    height, q = 0.03, biped.q_home.copy()
    dynamics = poise.Dynamics(biped)

    def gap(bend):
        for joint, share in (("hip_pitch", -0.5), ("knee", 1.0), ("ankle_pitch", -0.5)):
            k = 7 + biped.joint_names.index(f"left_{joint}")
            q[k] = biped.q_home[k] + share * bend
        dynamics.update(poise.RobotState(q, np.zeros(biped.nv)))
        return dynamics.frame(biped.frame_id("left_sole")).position[2] - height

    low, high = 0.0, 0.6
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gap(middle) < 0.0 else (low, middle)
    q[2] += 5e-5
    block = Block(center=(0.03, 0.1), size=(0.4, 0.15, height))
    plant = Plant(biped, PlantConfig(blocks=(block,)))
    plant.reset(q)
    assert plant.contacts() == {"left_sole": True, "right_sole": True}
    assert load(plant) == pytest.approx(1.0, abs=1e-4)
    assert np.abs(plant.data.qacc).max() < 1e-2
