import xml.etree.ElementTree as ET
import zipfile

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from bundled_robots.__main__ import main
from bundled_robots.documents import differences, make_documents, read_archive, write_archive
from poise.robots import load_robot

HUMANOIDS = ("humanoid33", "humanoid60", "biped20")


@pytest.fixture(scope="module")
def made():
    return make_documents()


def test_what_is_shipped_is_what_the_command_makes(made):
    assert differences(made, read_archive()) == []
    assert len(made) == 41 + 3


def test_the_check_names_the_documents_that_differ(made, monkeypatch, capsys):
    shipped = dict(made)
    shipped["arm6.urdf"] = made["arm6.urdf"].replace('mass value="5.0"', 'mass value="5.1"')
    del shipped["upper17.urdf"]
    monkeypatch.setattr("bundled_robots.__main__.read_archive", lambda: shipped)
    assert main(["--check"]) == 1
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == [
        "arm6.urdf",
        "upper17.urdf",
    ]


def test_two_archives_of_the_same_documents_are_the_same_bytes(made, tmp_path):
    paths = [tmp_path / name / "models" / "a.zip" for name in ("one", "two")]
    for path in paths:
        write_archive(made, path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert read_archive(paths[0]) == made
    with zipfile.ZipFile(paths[0]) as archive:
        assert archive.namelist() == sorted(made)


@pytest.mark.fast_cases(14)
@pytest.mark.parametrize("joints", range(20, 61))
def test_a_humanoid_has_the_joints_it_is_asked_for(joints):
    robot = load_robot(f"humanoid{joints}")
    assert robot.nj == joints
    assert robot.mass == pytest.approx(100.0, abs=1e-9)
    assert sum("hip" in n or "knee" in n or "ankle" in n for n in robot.joint_names) == 12
    left, right, waist, neck = (
        sum(name.startswith(part) for name in robot.joint_names)
        for part in ("left_", "right_", "waist_", "neck_")
    )
    assert left == right >= 6 + 4
    assert left + right + waist + neck == joints


def top_of(robot, q):
    """The highest point of any visual shape [m], from the document alone."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    top = -np.inf
    for link in ET.fromstring(robot.source.text).iter("link"):
        frame = robot.model.getFrameId(link.get("name"), pin.FrameType.BODY)
        for visual in link.findall("visual"):
            origin = visual.find("origin")
            xyz, rpy = (np.fromstring(origin.get(k), sep=" ") for k in ("xyz", "rpy"))
            shape = pin.SE3(Rotation.from_euler("xyz", rpy).as_matrix(), xyz)
            world_T_shape = data.oMf[frame] * shape
            top = max(top, world_T_shape.translation[2] + reach(visual, world_T_shape.rotation))
    return top


def reach(visual, rotation):
    up = rotation.T @ np.array([0.0, 0.0, 1.0])
    solid = visual.find("geometry")[0]
    if solid.tag == "box":
        return np.abs(up) @ np.fromstring(solid.get("size"), sep=" ") / 2.0
    radius = float(solid.get("radius"))
    if solid.tag == "sphere":
        return radius
    return radius * np.hypot(up[0], up[1]) + abs(up[2]) * float(solid.get("length")) / 2.0


@pytest.mark.parametrize(("name", "height"), [("humanoid33", 1.8), ("biped20", 1.62)])
def test_height_from_sole_to_crown_with_straight_knees(name, height):
    robot = load_robot(name)
    q = pin.neutral(robot.model)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    sole = data.oMf[robot.frame_id("left_sole")].translation[2]
    assert top_of(robot, q) - sole == pytest.approx(height, abs=0.002)


def test_the_biped_of_the_teleoperation_paper_is_as_described():
    robot = load_robot("biped20")
    com = pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)
    assert com[2] == pytest.approx(0.765, abs=1e-6)
    assert robot.mass == pytest.approx(65.0, abs=1e-9)
    assert {(s.length, s.width) for s in robot.soles.values()} == {(0.30, 0.24)}
    legs = [n for n in robot.joint_names if "hip" in n or "knee" in n or "ankle" in n]
    assert (len(legs), robot.nj - len(legs)) == (12, 8)
    knee = robot.q_home[7 + robot.joint_index("left_knee")]
    assert knee > 0.3


def test_the_upper_body_of_the_operational_space_paper_is_as_described():
    robot = load_robot("upper17")
    assert not robot.floating_base
    assert sum("torso" in n or "chest" in n for n in robot.joint_names) == 5
    assert sum(n.startswith("left_") for n in robot.joint_names) == 6


@pytest.mark.parametrize("name", HUMANOIDS)
def test_feet_touch_the_ground_with_their_collision_box(name):
    robot = load_robot(name)
    root = ET.fromstring(robot.source.text)
    for role_name, sole in robot.soles.items():
        role = robot.roles[role_name]
        link = next(e for e in root.iter("link") if e.get("name") == role.link)
        (solid,) = link.findall("collision")
        size = np.fromstring(solid.find("geometry/box").get("size"), sep=" ")
        centre = np.fromstring(solid.find("origin").get("xyz"), sep=" ")
        np.testing.assert_allclose(
            centre - [0.0, 0.0, size[2] / 2.0], role.position, rtol=0, atol=1e-9
        )
        np.testing.assert_allclose(size[:2], [sole.length, sole.width], rtol=0, atol=1e-9)


def mirrored(robot, name):
    other = {"left": "right", "right": "left"}
    side, _, rest = name.partition("_")
    return robot.joint_index(f"{other[side]}_{rest}" if side in other else name)


def sign_in_mirror(robot, name):
    """Rotations about x and z change sign in the mirror plane y = 0, those about y do not."""
    joint = robot.model.joints[robot.model.getJointId(name)]
    return 1.0 if joint.shortname() == "JointModelRY" else -1.0


@pytest.mark.parametrize("name", HUMANOIDS)
def test_left_and_right_are_mirror_images(name):
    robot = load_robot(name)
    mirror = np.diag([1.0, -1.0, 1.0])
    swap = [mirrored(robot, n) for n in robot.joint_names]
    signs = np.array([sign_in_mirror(robot, n) for n in robot.joint_names])
    np.testing.assert_allclose(robot.tau_max[swap], robot.tau_max)
    np.testing.assert_allclose(np.where(signs > 0, robot.q_min, -robot.q_max)[swap], robot.q_min)
    rng = np.random.default_rng(1)
    q = pin.neutral(robot.model)
    q[7:] = rng.uniform(robot.q_min, robot.q_max)
    q_mirror = q.copy()
    q_mirror[7:] = (signs * q[7:])[swap]
    data, data_mirror = robot.model.createData(), robot.model.createData()
    pin.centerOfMass(robot.model, data, q)
    pin.centerOfMass(robot.model, data_mirror, q_mirror)
    np.testing.assert_allclose(data_mirror.com[0], mirror @ data.com[0], rtol=0, atol=1e-8)
    pin.ccrba(robot.model, data, q, np.zeros(robot.nv))
    pin.ccrba(robot.model, data_mirror, q_mirror, np.zeros(robot.nv))
    np.testing.assert_allclose(
        data_mirror.Ig.inertia, mirror @ data.Ig.inertia @ mirror, rtol=0, atol=1e-6
    )


@pytest.mark.parametrize("name", ["humanoid33", "biped20", "upper17", "arm6"])
def test_inertias_are_those_of_the_shapes_at_one_density_as_mujoco_computes_them(name, made):
    mujoco = pytest.importorskip("mujoco")
    root = ET.fromstring(made[f"{name}.urdf"])
    for link in root.iter("link"):
        for collision in link.findall("collision"):
            link.remove(collision)
    options = {
        "inertiafromgeom": "true",
        "discardvisual": "false",
        "fusestatic": "false",
        "balanceinertia": "false",
    }
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", options)
    of_shapes = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    # MuJoCo fixes the root to the world, which has no inertia.
    for link in root.findall("link")[1:]:
        body = of_shapes.body(link.get("name")).id
        mass = float(link.find("inertial/mass").get("value"))
        com = np.fromstring(link.find("inertial/origin").get("xyz"), sep=" ")
        xx, xy, xz, yy, yz, zz = (float(v) for v in link.find("inertial/inertia").attrib.values())
        np.testing.assert_allclose(of_shapes.body_ipos[body], com, rtol=0, atol=1e-8)
        axes = Rotation.from_quat(of_shapes.body_iquat[body], scalar_first=True).as_matrix()
        expected = axes * of_shapes.body_inertia[body] @ axes.T
        expected *= mass / of_shapes.body_mass[body]
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        np.testing.assert_allclose(matrix, expected, rtol=0, atol=1e-7 * np.trace(matrix))
