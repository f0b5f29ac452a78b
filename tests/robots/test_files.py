import logging
import os

import numpy as np
import pinocchio as pin
import pytest

from poise.errors import RobotError
from poise.robots import files_digest, load_robot
from poise.robots._noise import captured


def test_a_floating_joint_in_the_document_is_not_doubled(load, urdf, facts):
    base = (
        '<link name="world"/><joint name="base" type="floating"><parent link="world"/>'
        '<child link="trunk"/></joint><link name="trunk">'
    )
    robot = load(urdf.replace('<link name="trunk">', base), facts)
    assert robot.nv == 10
    with pytest.raises(RobotError, match="base: floating"):
        load(urdf.replace('<link name="trunk">', base), {"base": "fixed"})


def test_a_robot_that_floats_is_taken_off_the_link_called_world(load, urdf, facts):
    weld = (
        '<link name="world"/><joint name="weld" type="fixed"><parent link="world"/>'
        '<child link="trunk"/></joint><link name="trunk">'
    )
    text = urdf.replace('<link name="trunk">', weld)
    robot = load(text, facts)
    assert robot.nv == 10
    assert 'name="world"' not in robot.source.text
    assert load(text, {"base": "fixed"}).nv == 4
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    heavy = text.replace('<link name="world"/>', f'<link name="world">{inertial}</link>')
    with pytest.raises(RobotError, match="root link 'world'.*weld"):
        load(heavy, facts)


def test_what_libraries_print_goes_to_the_log(capfd, caplog):
    with caplog.at_level(logging.DEBUG, "poise.robots"), captured() as noise:
        os.write(2, b"Error:   link 'toe'\n\n  is no link\n")
        print("and Python's own")
    assert noise.text == "Error: link 'toe' is no link"
    assert caplog.messages == [noise.text]
    os.write(2, b"after")
    assert capfd.readouterr().err == "after"


def test_locked_joints_are_welded_at_zero_with_their_mass(load, urdf, facts):
    whole = load(urdf, facts)
    robot = load(urdf, facts | {"locked": [".*_ankle"], "home": {}})
    assert robot.joint_names == ("left_hip", "right_hip")
    assert robot.source.locked_joints == ("left_ankle", "right_ankle")
    assert robot.mass == pytest.approx(whole.mass)


def test_a_role_wins_over_a_link_of_the_same_name(load, urdf, facts):
    robot = load(urdf.replace('"trunk"', '"pelvis"'), named(facts, "pelvis"))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_home)
    link = data.oMf[robot.frame_id("pelvis_link")].translation
    role = data.oMf[robot.frame_id("pelvis")].translation
    np.testing.assert_allclose(role - link, [0.0, 0.0, 0.1], rtol=0, atol=1e-12)


def named(facts, link):
    mount = {"link": link, "position": [0.0, 0.0, 0.1]}
    return facts | {"pelvis": mount, "torso": link}


def test_limits_of_the_description_replace_those_of_the_file(load, urdf, facts):
    limits = {
        "torque": {".*": 20.0, "left_hip": 70.0},
        "velocity": {"right_.*": 3.0},
        "position": {"left_hip": [-0.5, 0.5]},
    }
    robot = load(urdf, facts | {"limits": limits})
    assert dict(zip(robot.joint_names, robot.tau_max, strict=True)) == {
        "left_hip": 70.0,
        "left_ankle": 20.0,
        "right_hip": 20.0,
        "right_ankle": 20.0,
    }
    np.testing.assert_allclose(robot.v_max, [8.0, 8.0, 3.0, 3.0])
    assert (robot.q_min[0], robot.q_max[0]) == (-0.5, 0.5)
    assert 'lower="-0.5"' in robot.source.text


def test_rotor_inertias_are_given_by_pattern(load, urdf, facts):
    robot = load(urdf, facts | {"armature": {".*": 0.02, ".*_hip": 0.05}})
    np.testing.assert_allclose(robot.model.armature[6:], [0.05, 0.02, 0.05, 0.02])
    np.testing.assert_allclose(robot.model.armature[:6], 0.0)


def test_a_robot_on_tilted_soles_is_turned_until_they_are_flat(load, urdf, facts):
    robot = load(urdf, facts | {"home": {".*_hip": -0.2}})
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_home)
    for name in robot.soles:
        assert data.oMf[robot.frame_id(name)].isApprox(
            pin.SE3(np.eye(3), data.oMf[robot.frame_id(name)].translation), 1e-12
        )
    assert pin.rpy.matrixToRpy(data.oMi[1].rotation)[1] == pytest.approx(0.2)


def test_meshes_are_found_beside_the_file_and_by_package(tmp_path, urdf, facts):
    (tmp_path / "feet" / "meshes").mkdir(parents=True)
    (tmp_path / "feet" / "urdf").mkdir()
    (tmp_path / "feet" / "meshes" / "toe.stl").write_text("solid toe\nendsolid")
    # The last one: a package whose folder has another name here.
    packages = ("package://feet/meshes/toe.stl", "package://old_feet/meshes/toe.stl")
    for name in (*packages, "../meshes/toe.stl"):
        mesh = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        text = urdf.replace('<link name="left_foot">', f'<link name="left_foot">{mesh}')
        path = tmp_path / "feet" / "urdf" / "tiny.urdf"
        path.write_text(text)
        assert load_robot(path, facts).nj == 4


def test_a_document_without_pictures_is_drawn_as_sticks(load, urdf, facts):
    mujoco = pytest.importorskip("mujoco")
    from poise.sim import Plant

    tilted = urdf.replace('<origin xyz="0 0 -0.4"/>', '<origin xyz="0.1 -0.2 -0.4"/>')
    plant = Plant(load(tilted, facts))
    end = np.array([0.1, -0.2, -0.4])
    for link in ("left_shin", "right_shin"):
        body = plant.model.body(link)
        geom = int(body.geomadr[0])
        assert plant.model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE
        np.testing.assert_allclose(plant.model.geom_pos[geom], 0.5 * end, atol=1e-9)
        assert plant.model.geom_size[geom][1] == pytest.approx(0.5 * np.linalg.norm(end))
    box = '<link name="left_foot"><visual><geometry><box size="0.2 0.1 0.1"/></geometry></visual>'
    pictured = Plant(load(urdf.replace('<link name="left_foot">', box), facts)).model
    assert int(pictured.body("left_shin").geomnum[0]) == 0


def test_the_description_in_the_documentation_is_a_right_one():
    from pathlib import Path

    from poise._yaml import read_yaml
    from poise.robots._description import parse_description

    page = (Path(__file__).parents[2] / "docs" / "robot_description.md").read_text()
    example = page.split("```yaml\n")[1].split("```")[0]
    facts = parse_description(read_yaml(example, "page", error=RobotError), "page")
    assert facts.limits.torque == {".*_knee": 120.0}
    assert facts.locked == (".*_finger.*",)
    assert set(facts.mounts()) == {
        "left_sole",
        "right_sole",
        "left_hand",
        "right_hand",
        "pelvis",
        "torso",
    }


URDF = """<robot name="r"><link name="a">
  <visual><geometry><mesh filename="a.obj"/></geometry></visual></link></robot>"""
INCLUDING = """<mujoco><compiler meshdir="meshes"/><include file="legs.xml"/>
  <asset><mesh name="a" file="a.obj"/></asset><worldbody><body name="a"/></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("name", "text", "beside"),
    [
        (
            "r.v2.urdf",
            URDF,
            {
                "a.obj": "two",
                "r.v2.poise.yaml": "two",
                "r.v2.urdf": URDF.replace('name="a"', 'name="b"'),
            },
        ),
        (
            "r.xml",
            INCLUDING,
            {"meshes/a.obj": "two", "r.poise.yaml": "two", "legs.xml": "<mujoco><size/></mujoco>"},
        ),
    ],
)
def test_a_digest_is_of_all_files_of_a_robot_and_of_no_other(tmp_path, name, text, beside):
    (tmp_path / "meshes").mkdir()
    for file in ("a.obj", "meshes/a.obj", "r.v2.poise.yaml", "r.poise.yaml", "other.yaml"):
        (tmp_path / file).write_text("one")
    (tmp_path / "legs.xml").write_text("<mujoco><worldbody/></mujoco>")
    (tmp_path / name).write_text(text)
    seen = [files_digest(tmp_path / name)]
    for file, changed in beside.items():
        (tmp_path / file).write_text(changed)
        seen.append(files_digest(tmp_path / name))
    assert len({*seen}) == 1 + len(beside)
    (tmp_path / "other.yaml").write_text("two")
    assert files_digest(tmp_path / name) == seen[-1]
