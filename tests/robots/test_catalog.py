import importlib.metadata

import numpy as np
import pinocchio as pin
import pytest

from poise.errors import MissingExtraError, RobotError, UnknownNameError
from poise.robots import catalog, load_robot

NAMES = [entry.name for entry in catalog()]
STANDING = [e.name for e in catalog() if e.description.base == "floating"]


def forward(robot):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_home)
    return data


@pytest.mark.parametrize("robot", NAMES, indirect=True)
def test_joints_and_mass_are_what_the_catalog_says(robot):
    entry = next(e for e in catalog() if e.name == robot.name)
    assert robot.nj == entry.joints
    assert robot.mass == pytest.approx(entry.mass, abs=0.05)
    assert robot.licence == entry.licence
    assert robot.nv == robot.nj + robot.base_dofs == len(robot.joint_names) + robot.base_dofs


@pytest.mark.parametrize("robot", STANDING, indirect=True)
def test_home_stands_upright_on_level_soles_that_look_forward(robot):
    data = forward(robot)
    left, right = (data.oMf[robot.frame_id(name)] for name in robot.soles)
    for sole in (left, right):
        assert abs(sole.translation[2]) < 1e-6
        assert np.linalg.norm(sole.rotation[:2, 2]) < 1e-6
        assert sole.rotation[2, 2] > 0.0
        assert sole.rotation[0, 0] > 1.0 - 1e-9
    assert left.translation[1] == pytest.approx(-right.translation[1], abs=1e-9)
    assert left.translation[1] > 0.05
    for name in (robot.pelvis, robot.torso):
        rotation = data.oMf[robot.frame_id(name)].rotation
        np.testing.assert_allclose(rotation, np.eye(3), rtol=0, atol=1e-4)
    com = pin.centerOfMass(robot.model, data, robot.q_home)
    assert abs(com[0]) < 0.001
    assert abs(com[1]) < 0.005


@pytest.mark.parametrize("robot", NAMES, indirect=True)
def test_limits_are_those_of_a_machine_with_home_inside(robot):
    q = robot.q_home[robot.nq - robot.nj :]
    assert np.all(q > robot.q_min + 0.02)
    assert np.all(q < robot.q_max - 0.02)
    assert np.all((robot.tau_max >= 0.4) & (robot.tau_max <= 1000.0))
    assert np.all((robot.v_max >= 0.3) & (robot.v_max <= 50.0))
    assert np.all((robot.q_max - robot.q_min >= 0.3) & (robot.q_max - robot.q_min <= 13.0))


@pytest.mark.parametrize("robot", STANDING, indirect=True)
def test_joints_can_hold_the_robot_at_home(robot):
    data = robot.model.createData()
    gravity = pin.computeGeneralizedGravity(robot.model, data, robot.q_home)
    pin.computeJointJacobians(robot.model, data, robot.q_home)
    pin.updateFramePlacements(robot.model, data)
    J = np.vstack(
        [
            pin.getFrameJacobian(robot.model, data, robot.frame_id(name), pin.LOCAL_WORLD_ALIGNED)
            for name in robot.soles
        ]
    )
    wrench = np.linalg.lstsq(J[:, :6].T, gravity[:6])[0]
    torque = (gravity - J.T @ wrench)[6:]
    assert np.all(np.abs(torque) < 0.85 * robot.tau_max)


@pytest.mark.parametrize("robot", NAMES, indirect=True)
def test_inertias_are_physically_possible(robot):
    data = robot.model.createData()
    M = np.triu(pin.crba(robot.model, data, robot.q_home))
    assert np.linalg.eigvalsh(M + np.triu(M, 1).T)[0] > 0.0
    for inertia in robot.model.inertias:
        moments = np.linalg.eigvalsh(inertia.inertia)
        assert inertia.mass >= 0.0
        assert moments[0] >= -1e-12
        assert moments[0] + moments[1] >= moments[2] * (1.0 - 1e-4) - 1e-12


@pytest.mark.parametrize("robot", NAMES, indirect=True)
def test_every_role_is_one_frame_on_its_link(robot):
    data = forward(robot)
    names = [frame.name for frame in robot.model.frames]
    bodies = {f.name for f in robot.model.frames if f.type == pin.FrameType.BODY}
    for role in robot.roles.values():
        assert names.count(role.name) == 1
        frame = robot.model.frames[robot.frame_id(role.name)]
        assert frame.type == pin.FrameType.OP_FRAME
        carrier = robot.model.frames[frame.parentFrame].name
        assert carrier in bodies
        world_T_link = data.oMf[frame.parentFrame]
        expected = world_T_link * pin.SE3(role.rotation, role.position)
        assert data.oMf[robot.frame_id(role.name)].isApprox(expected, 1e-9)
    assert set(robot.soles) | set(robot.hands) | {robot.pelvis, robot.torso} == set(robot.roles)


@pytest.mark.parametrize("robot", NAMES, indirect=True)
def test_joints_above_a_frame_are_those_that_move_it(robot):
    model, data = robot.model, robot.model.createData()
    rng = np.random.default_rng(4)
    q = pin.integrate(model, robot.q_home, 0.1 * rng.normal(size=robot.nv))
    for role in robot.roles:
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        jacobian = pin.getFrameJacobian(model, data, robot.frame_id(role), pin.LOCAL)
        moving = np.flatnonzero(np.abs(jacobian).max(axis=0) > 1e-9)
        joints = sorted({j for j in range(1, model.njoints) for i in moving
                         if 0 <= i - model.idx_vs[j] < model.nvs[j]})  # fmt: skip
        assert robot.joints_above(role) == joints
    for sole in robot.soles:
        assert set(robot.leg_joints(sole)) <= set(robot.joints_above(sole))
    with pytest.raises(UnknownNameError, match="tail"):
        robot.joints_above("tail")


@pytest.mark.parametrize("robot", ["g1"], indirect=True)
def test_a_robot_cannot_be_changed_by_mistake(robot):
    for array in (robot.q_home, robot.q_min, robot.q_max, robot.v_max, robot.tau_max):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(TypeError):
        robot.soles["left_sole"] = None


@pytest.mark.parametrize("name", ["humanoid19", "humanoid61", "humanoid999"])
def test_a_humanoid_that_cannot_be_made_is_refused(name):
    with pytest.raises(RobotError, match="humanoid20 to humanoid60"):
        load_robot(name)


def test_robots_whose_data_is_not_installed_are_listed_and_name_the_extra(monkeypatch):
    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", missing)
    from poise.robots import catalog as module_function

    installed = {e.name: e.installed for e in fresh_catalog(module_function)}
    assert installed["humanoid33"]
    assert not installed["g1"]
    with pytest.raises(MissingExtraError, match=r'pip install "poise\[robots\]"'):
        load_robot("g1")


def fresh_catalog(catalog_function):
    from poise.robots._catalog import _read_entry

    _read_entry.cache_clear()
    entries = catalog_function()
    _read_entry.cache_clear()
    return entries
