import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import load_robot
from poise.robots._parametric import generate
from poise.robots._parametric._humanoid import TELEOPERATED_BIPED, TOCABI_CLASS
from poise.robots._parametric._proportions import Proportions, share_joints
from poise.robots._parametric._solids import box, combined_inertia, drum, rod, sphere

PARAMETRIC = ("humanoid20", "humanoid33", "humanoid45", "humanoid60", "biped20")


@pytest.mark.fast_cases(14)
@pytest.mark.parametrize("joints", range(20, 61))
def test_a_humanoid_has_the_joints_it_is_asked_for(joints):
    robot = load_robot(f"humanoid{joints}")
    assert robot.nj == joints
    assert robot.mass == pytest.approx(100.0, abs=1e-9)
    assert sum("hip" in n or "knee" in n or "ankle" in n for n in robot.joint_names) == 12


def test_the_tocabi_class_humanoid_shares_its_joints_as_the_paper_says():
    names = load_robot("humanoid33").joint_names
    arm = ("clavicle", "shoulder", "elbow", "forearm", "wrist")
    assert sum(n.startswith("left_") and any(a in n for a in arm) for n in names) == 8
    assert sum(n.startswith("waist_") for n in names) == 3
    assert sum(n.startswith("neck_") for n in names) == 2


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


@pytest.mark.parametrize(
    ("name", "proportions"), [("humanoid33", TOCABI_CLASS), ("biped20", TELEOPERATED_BIPED)]
)
def test_height_from_sole_to_crown_with_straight_knees(name, proportions):
    robot = load_robot(name)
    q = pin.neutral(robot.model)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    sole = data.oMf[robot.frame_id("left_sole")].translation[2]
    assert top_of(robot, q) - sole == pytest.approx(proportions.height, abs=0.002)


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


def test_the_six_joint_arm_reaches_nine_tenths_of_a_metre():
    robot = load_robot("arm6")
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, pin.neutral(robot.model))
    shoulder = data.oMi[robot.model.getJointId("joint2")].translation
    hand = data.oMf[robot.frame_id("hand")].translation
    assert np.linalg.norm(hand - shoulder) == pytest.approx(0.9, abs=0.05)


@pytest.mark.parametrize("name", PARAMETRIC)
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


@pytest.mark.parametrize("name", PARAMETRIC)
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


def test_mass_is_where_a_humanoid_has_it():
    robot = load_robot("humanoid33")
    legs = sum(
        inertia.mass
        for name, inertia in zip(robot.model.names, robot.model.inertias, strict=True)
        if any(part in name for part in ("hip", "knee", "ankle"))
    )
    assert legs == pytest.approx(45.0, abs=1e-9)


def test_inertia_of_shapes_agrees_with_sampling():
    shapes = [
        box((0.1, 0.2, 0.3), (0.1, 0.0, 0.2), rpy=(0.3, -0.5, 0.9)),
        rod((0.0, 0.1, 0.0), (0.3, -0.1, 0.2), 0.05),
        sphere(0.08, (-0.2, 0.1, 0.1)),
        drum("x", 0.06, 0.2, (0.0, -0.3, 0.0)),
    ]
    rng = np.random.default_rng(3)
    points = np.vstack([sample(shape, rng, 60_000) for shape in shapes])
    weights = np.repeat([s.volume for s in shapes], 60_000)
    weights = 5.0 * weights / weights.sum()
    com = weights @ points / 5.0
    r = points - com
    matrix = (weights[:, None, None] * inertia_kernel(r)).sum(axis=0)
    ours = combined_inertia(shapes, 5.0)
    np.testing.assert_allclose(ours.com, com, rtol=0, atol=1e-3)
    np.testing.assert_allclose(ours.matrix, matrix, rtol=0, atol=0.01 * np.trace(matrix))


def inertia_kernel(r):
    return (r**2).sum(axis=1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :]


def sample(shape, rng, count):
    if shape.kind == "box":
        local = rng.uniform(-0.5, 0.5, (count, 3)) * np.array(shape.size)
    elif shape.kind == "sphere":
        direction = rng.normal(size=(count, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        local = direction * shape.size[0] * rng.uniform(0, 1, (count, 1)) ** (1 / 3)
    else:
        angle = rng.uniform(0, 2 * np.pi, count)
        radius = shape.size[0] * np.sqrt(rng.uniform(0, 1, count))
        height = shape.size[1] * rng.uniform(-0.5, 0.5, count)
        local = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    return local @ shape.rotation.T + np.array(shape.position)


@pytest.mark.parametrize("total", range(20, 61))
def test_joints_are_shared_out_completely(total):
    count = share_joints(total)
    assert 12 + 2 * count.arm + count.waist + count.head == total
    assert count.arm >= 4
    assert min(count.waist, count.head) >= 0


def test_what_cannot_be_made_is_refused():
    with pytest.raises(ConfigurationError, match="20 to 60"):
        share_joints(19)
    with pytest.raises(UnknownNameError, match="choices: humanoid"):
        generate("humanoids", 33)
    with pytest.raises(ConfigurationError, match="mass"):
        Proportions(height=1.8, mass=-1.0, sole_length=0.3, sole_width=0.1, hip_offset=0.1)
    with pytest.raises(ConfigurationError, match="overlap"):
        Proportions(height=1.8, mass=80.0, sole_length=0.3, sole_width=0.3, hip_offset=0.1)
