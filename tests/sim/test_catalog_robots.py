"""The robots of the catalog, in Pinocchio and in MuJoCo: one document, two independent models."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from poise.errors import MissingExtraError
from poise.robots import load_robot
from poise.sim import Plant, PlantConfig

MODELS = ("humanoid33", "biped20", "g1", "talos")
STANDING = ("humanoid33", "biped20", "g1", "talos", "romeo", "human", "simple_humanoid")


def load(name):
    try:
        return load_robot(name)
    except MissingExtraError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module", params=MODELS)
def plant(request):
    return Plant(load(request.param))


def mujoco_from_pinocchio(plant, q, v):
    """T and its derivative with v_mujoco = T v_pinocchio."""
    nv = plant.robot.nv
    world_R_base = pin.Quaternion(q[3:7]).toRotationMatrix()
    order = plant.map.dof_order
    T, Tdot = np.zeros((nv, nv)), np.zeros((nv, nv))
    T[order, np.arange(nv)] = 1.0
    T[:3, :3] = world_R_base
    Tdot[:3, :3] = world_R_base @ pin.skew(v[3:6])
    return T, Tdot


def assert_close(ours, theirs):
    scale = max(1.0, np.abs(theirs).max())
    np.testing.assert_allclose(ours / scale, theirs / scale, rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_dynamics_and_kinematics_agree_with_pinocchio(plant, seed):
    robot = plant.robot
    rng = np.random.default_rng(seed)
    q = pin.integrate(robot.model, robot.q_home, rng.uniform(-0.8, 0.8, robot.nv))
    v = rng.uniform(-2.0, 2.0, robot.nv)
    plant.data.qpos[:], plant.data.qvel[:] = plant.map.qpos(q), plant.map.qvel(q, v)
    mujoco.mj_forward(plant.model, plant.data)
    data = robot.model.createData()
    pin.computeAllTerms(robot.model, data, q, v)
    pin.updateFramePlacements(robot.model, data)

    T, Tdot = mujoco_from_pinocchio(plant, q, v)
    M = np.zeros((robot.nv, robot.nv))
    mujoco.mj_fullM(plant.model, plant.data, M)
    assert_close(T.T @ M @ T, np.triu(data.M) + np.triu(data.M, 1).T)
    assert_close(T.T @ (plant.data.qfrc_bias + M @ Tdot @ v), data.nle)
    assert_close(plant.data.subtree_com[1], data.com[0])
    for name in robot.roles:
        linear, angular = np.zeros((3, robot.nv)), np.zeros((3, robot.nv))
        site = plant.model.site(name).id
        mujoco.mj_jacSite(plant.model, plant.data, linear, angular, site)
        frame = robot.frame_id(name)
        assert_close(
            np.vstack([linear, angular]) @ T,
            pin.getFrameJacobian(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED),
        )
        assert_close(plant.data.site_xpos[site], data.oMf[frame].translation)


def vertical_force(plant):
    return sum(
        plant.data.site(name).xmat.reshape(3, 3)[2] @ wrench[:3]
        for name, wrench in plant.sole_wrenches().items()
    )


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("name", STANDING)
def test_each_stands_on_its_soles_under_a_stiff_servo(name):
    robot = load(name)
    plant = Plant(robot, PlantConfig(actuation="position"))
    lift = []
    while plant.time < 1.0:
        plant.step(None)
        lift.append(vertical_force(plant))
    assert not plant.fallen
    assert not plant.warnings
    assert plant.contacts() == dict.fromkeys(robot.soles, True)
    soles = {plant.model.geom(f"{n}_contact").id for n in robot.soles}
    touching = {int(g) for c in plant.data.contact for g in c.geom} - {0}
    ground = plant.model.geom("floor").id
    assert touching | {ground} == soles | {ground}
    # A foot on a weak ankle may chatter: what counts is the mean.
    assert np.mean(lift[-400:]) == pytest.approx(robot.mass * 9.81, rel=0.02)
