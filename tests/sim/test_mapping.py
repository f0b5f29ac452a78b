import mujoco
import numpy as np
import pinocchio as pin
import pytest
from small_biped import document, random_state, small_biped

from poise.errors import RobotError
from poise.sim import Plant, StateMap

SEEDS = range(3)


def place(plant, q, v):
    plant.data.qpos[:] = plant.map.qpos(q)
    plant.data.qvel[:] = plant.map.qvel(q, v)
    mujoco.mj_forward(plant.model, plant.data)


@pytest.fixture(scope="module")
def plant(biped):
    return Plant(biped)


@pytest.mark.parametrize("seed", SEEDS)
def test_states_come_back_from_a_round_trip(plant, biped, seed):
    q, v = random_state(biped, np.random.default_rng(seed))
    qpos, qvel = plant.map.qpos(q), plant.map.qvel(q, v)
    np.testing.assert_array_equal(plant.map.q(qpos), q)
    np.testing.assert_allclose(plant.map.v(qpos, qvel), v, rtol=0, atol=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_free_fall_accelerations_agree_with_pinocchio(plant, biped, seed):
    # One test of mass, inertia, armature, gravity and torque order together.
    rng = np.random.default_rng(seed)
    q, v = random_state(biped, rng)
    q[2] += 5.0
    tau = rng.uniform(-20.0, 20.0, biped.nj)
    place(plant, q, v)
    plant.data.ctrl[:] = tau
    mujoco.mj_forward(plant.model, plant.data)
    data = biped.model.createData()
    expected = pin.aba(biped.model, data, q, v, np.r_[np.zeros(6), tau])
    base_R_world = pin.Quaternion(q[3:7]).toRotationMatrix().T
    qacc = plant.data.qacc[plant.map.dof_order]
    # MuJoCo's base acceleration is the world derivative of the world velocity: turn it, and
    # subtract omega x v to have the derivative of the base-frame velocity.
    qacc[:3] = base_R_world @ qacc[:3] - np.cross(v[3:6], v[:3])
    np.testing.assert_allclose(qacc, expected, rtol=1e-9, atol=1e-8)


def test_a_joint_that_turns_without_end_is_refused():
    text = document().replace('name="waist" type="revolute"', 'name="waist" type="continuous"')
    endless = small_biped(text, q_min=np.full(11, -3.0), q_max=np.full(11, 3.0))
    with pytest.raises(RobotError, match="waist"):
        Plant(endless)


def test_a_document_without_the_robots_joint_is_refused(biped):
    import dataclasses

    text = document().replace("waist", "middle")
    other = dataclasses.replace(biped, source=dataclasses.replace(biped.source, text=text))
    with pytest.raises(RobotError, match="waist"):
        Plant(other)


def test_the_map_of_a_model_with_other_joints_is_refused(biped):
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(RobotError, match="not in the MuJoCo model"):
        StateMap(biped, model)
