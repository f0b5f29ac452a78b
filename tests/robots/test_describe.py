"""Descriptions proposed for files that nobody has described, beside those that people wrote."""

import re

import numpy as np
import pinocchio as pin
import pytest

from poise.errors import RobotError
from poise.robots import describe, load_robot
from poise.robots._catalog import find_entry, open_entry

LINK = """<link name="{name}"><inertial><origin xyz="0 0 {z}"/><mass value="{mass}"/>
  <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial>{shape}</link>"""
JOINT = """<joint name="{name}" type="{type}"><origin xyz="{xyz}" rpy="{rpy}"/>
  <parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>{limit}</joint>"""
LIMIT = '<limit lower="-1.6" upper="1.6" effort="60" velocity="12"/>'
BOX = """<collision><origin xyz="0.04 0 -0.04"/><geometry><box size="0.2 0.1 0.03"/></geometry>
  </collision>"""
WHEEL = """<collision><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.06" length="0.04"/>
  </geometry></collision>"""
SIX = (("hip_z", "0 0 1"), ("hip_x", "1 0 0"), ("hip_y", "0 1 0"), ("knee", "0 1 0"),
       ("ankle_y", "0 1 0"), ("ankle_x", "1 0 0"))  # fmt: skip
FIVE = SIX[:5]


def leg(side, joints, shape, tilt):
    """A leg of 0.3 m and 0.3 m whose first axis may be tilted, as R1's and H2's are."""
    text, above = "", "trunk"
    for k, (name, axis) in enumerate(joints):
        low, y = k == len(joints) - 1, 0.1 if side == "left" else -0.1
        xyz = {0: f"0 {y} 0", 3: "0 0 -0.3", 4: "0 0 -0.3"}.get(k, "0 0 0")
        rpy = {0: f"0 {tilt} 0", 1: f"0 {-tilt} 0"}.get(k, "0 0 0")
        link = f"{side}_{name}_link"
        text += JOINT.format(
            name=f"{side}_{name}", type="revolute", xyz=xyz, rpy=rpy, parent=above, child=link,
            axis=axis, limit=LIMIT,
        )  # fmt: skip
        text += LINK.format(name=link, z="-0.02" if low else "-0.1", mass=1.0,
                            shape=shape if low else "")  # fmt: skip
        above = link
    return text


def walker(joints=SIX, shape=BOX, tilt=0.0, right=None):
    """A trunk on two legs, as URDF."""
    trunk = LINK.format(name="trunk", z=0.2, mass=12.0, shape="")
    legs = leg("left", joints, shape, tilt) + leg("right", joints, right or shape, tilt)
    return f"<robot name='walker'>{trunk}{legs}</robot>"


def chain(prefix, above, place, joints):
    """Links one below the other, each behind a joint with an axis [name, axis, offset]."""
    text = ""
    for name, axis, offset in joints:
        link = f"{prefix}{name}_link"
        text += JOINT.format(name=f"{prefix}{name}", type="revolute", xyz=place, rpy="0 0 0",
                             parent=above, child=link, axis=axis, limit=LIMIT)  # fmt: skip
        text += LINK.format(name=link, z=-0.05, mass=1.0, shape="")
        above, place = link, offset
    return text


ARM = (("shoulder_y", "0 1 0", "0 0 0"), ("shoulder_x", "1 0 0", "0 0 -0.3"),
       ("elbow", "0 1 0", "0 0 -0.28"), ("wrist", "0 0 1", "0 0 0"))  # fmt: skip


def upper_body(waist=True):
    """A root that nothing fixes, a torso that turns on it, and two arms that hang."""
    text = LINK.format(name="root", z=0.1, mass=20.0, shape="")
    if waist:
        text += JOINT.format(name="waist", type="revolute", xyz="0 0 0.3", rpy="0 0 0",
                             parent="root", child="torso", axis="0 0 1", limit=LIMIT)  # fmt: skip
        text += LINK.format(name="torso", z=0.2, mass=10.0, shape="")
    carrier = "torso" if waist else "root"
    for side, y in (("left", 0.2), ("right", -0.2)):
        text += chain(f"{side}_", carrier, f"0 {y} 0.4", ARM)
    return f"<robot name='upper'>{text}</robot>"


@pytest.fixture
def save(tmp_path):
    def write(text, name="walker.urdf"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("name", ["humanoid33", "biped20"])
def test_soles_of_robots_made_in_code_are_found_where_they_were_put(save, name):
    entry = find_entry(name)
    path = save(open_entry(entry)[0], f"{name}.urdf")
    proposal = describe(path)
    robot, original = load_robot(path, proposal.facts), load_robot(name)
    for sole in ("left_sole", "right_sole"):
        ours, theirs = robot.roles[sole], original.roles[sole]
        assert ours.link == theirs.link
        np.testing.assert_allclose(ours.position, theirs.position, rtol=0, atol=1e-3)
        assert robot.soles[sole].length == pytest.approx(original.soles[sole].length, abs=2e-3)
        assert robot.soles[sole].width == pytest.approx(original.soles[sole].width, abs=2e-3)
    assert robot.hands == ("left_hand", "right_hand")
    assert robot.roles["pelvis"].link == original.roles["pelvis"].link
    assert not proposal.remarks


@pytest.mark.parametrize(("name", "within"), [("g1", 0.011), ("talos", 0.004)])
def test_soles_of_real_robots_are_near_those_that_people_measured(get_robot, name, within):
    original = get_robot(name)
    from poise.robots._catalog import _data_folder

    path = _data_folder() / find_entry(name).file
    robot = load_robot(path, describe(path).facts)
    for sole in original.soles:
        sizes = [(r.soles[sole].length, r.soles[sole].width) for r in (robot, original)]
        np.testing.assert_allclose(*sizes, rtol=0, atol=within)
        centres = []
        for r in (robot, original):
            data = r.model.createData()
            pin.framesForwardKinematics(r.model, data, pin.neutral(r.model))
            centres.append(data.oMf[r.frame_id(sole)].translation.copy())
        np.testing.assert_allclose(*centres, rtol=0, atol=5e-3)


LEGS = {
    "six joints": {},
    "tilted hips": {"tilt": 0.5},
}


@pytest.mark.parametrize("case", LEGS)
def test_home_stands_level_with_the_com_over_the_soles(save, case):
    path = save(walker(**LEGS[case]))
    robot = load_robot(path, describe(path).facts)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_home)
    com = pin.centerOfMass(robot.model, data, robot.q_home)
    for name in robot.soles:
        place = data.oMf[robot.frame_id(name)]
        assert place.rotation[2, 2] > 1.0 - 1e-6
        assert abs(place.translation[2]) < 1e-3
    # The middle of the soles is the origin.
    assert np.linalg.norm(com[:2]) < 2e-3
    knee = robot.q_home[7 + robot.joint_index("left_knee")]
    assert abs(knee) > 0.1
    assert robot.soles["left_sole"].length == pytest.approx(0.2, abs=2e-3)
    assert robot.soles["left_sole"].width == pytest.approx(0.1, abs=2e-3)


def test_a_plain_file_is_described_in_memory_with_one_warning(save):
    path = save(walker())
    with pytest.warns(
        UserWarning, match=r"guessed.*left_sole 200 x 100 mm.*poise describe"
    ) as said:
        robot = load_robot(path)
    assert len(said) == 1
    np.testing.assert_array_equal(robot.q_home, load_robot(path, describe(path).facts).q_home)


def test_what_the_file_lacks_is_estimated_and_said(save):
    text = walker().replace('effort="60" velocity="12"', 'effort="0" velocity="0"')
    proposal = describe(save(text.replace('name="left_knee" type="revolute"',
                                          'name="left_knee" type="continuous"')))  # fmt: skip
    limits = proposal.facts["limits"]
    assert limits["position"] == {"left_knee": [-3.1416, 3.1416]}
    assert set(limits["velocity"].values()) == {10.0}
    weight = 9.81 * 24.0
    assert limits["torque"]["left_knee"] == pytest.approx(0.3 * weight * 0.65, rel=0.1)
    assert all(0.0 < value < 1.0 for value in proposal.facts["armature"].values())
    for key in ("limits.position", "limits.velocity", "limits.torque", "armature"):
        assert key in proposal.reasons


def test_toes_and_joints_without_room_are_locked(save):
    text = walker().replace("</robot>", "")
    for side in ("left", "right"):
        text += JOINT.format(
            name=f"{side}_toe", type="revolute", xyz="0.14 0 -0.04", rpy="0 0 0",
            parent=f"{side}_ankle_x_link", child=f"{side}_toe_link", axis="0 1 0", limit=LIMIT,
        )  # fmt: skip
        toe = '<collision><geometry><box size="0.04 0.08 0.02"/></geometry></collision>'
        text += LINK.format(name=f"{side}_toe_link", z=0.0, mass=0.1, shape=toe)
    proposal = describe(save(text + "</robot>"))
    assert proposal.facts["locked"] == ["left_toe", "right_toe"]
    assert proposal.facts["soles"]["left_sole"]["link"] == "left_ankle_x_link"


def test_a_torso_on_a_waist_has_arms_and_no_legs(save):
    proposal = describe(save(upper_body(), "upper.urdf"))
    assert proposal.facts["base"] == "fixed"
    assert any("does not fix the root" in remark for remark in proposal.remarks)
    assert proposal.facts["torso"]["link"] == "torso"
    assert proposal.facts["pelvis"]["link"] == "root"
    assert {h: m["link"] for h, m in proposal.facts["hands"].items()} == {
        "left_hand": "left_wrist_link", "right_hand": "right_wrist_link"}  # fmt: skip
    # Forearms forward: about y that is a negative angle.
    assert proposal.facts["home"] == {"left_elbow": -0.8, "right_elbow": -0.8}
    path = save(upper_body(), "upper.urdf")
    assert not load_robot(path, proposal.facts).floating_base


def test_an_arm_by_itself_is_fixed_has_a_hand_and_its_gripper_is_locked(save):
    arm = LINK.format(name="root", z=0.1, mass=5.0, shape="") + chain("", "root", "0 0 0.3", ARM)
    for name, y in (("grip", 0.02), ("other_grip", -0.02)):
        arm += JOINT.format(name=name, type="revolute", xyz=f"0 {y} -0.1", rpy="0 0 0",
                            parent="wrist_link", child=f"{name}_link", axis="1 0 0",
                            limit=LIMIT)  # fmt: skip
        arm += LINK.format(name=f"{name}_link", z=-0.02, mass=0.1, shape="")
    arm = arm.replace('<joint name="other_grip" type="revolute">',
                      '<joint name="other_grip" type="revolute"><mimic joint="grip"/>')  # fmt: skip
    proposal = describe(save(f"<robot name='arm'>{arm}</robot>", "arm.urdf"))
    assert proposal.facts["base"] == "fixed"
    assert proposal.facts["hands"]["hand"]["link"] == "wrist_link"
    assert proposal.facts["locked"] == ["grip"]
    assert list(proposal.facts["home"]) == ["elbow"]


@pytest.mark.parametrize(
    ("name", "home"),
    [("talos", {"arm_left_4_joint": -0.8, "arm_right_4_joint": -0.8}),
     ("icub", {"l_elbow": 0.8, "r_elbow": 0.8}),
     ("g1", {})],
)  # fmt: skip
def test_straight_arms_of_real_robots_are_bent_at_the_elbow(get_robot, name, home):
    get_robot(name)  # skips where its files are missing
    from poise.robots._catalog import _data_folder

    said = describe(_data_folder() / find_entry(name).file).facts["home"]
    arms = {joint: angle for joint, angle in said.items() if abs(angle) > 0.2}
    legs = [j for j in arms if any(w in j.lower() for w in ("leg", "hip", "knee", "ank"))]
    assert {j: a for j, a in arms.items() if j not in legs} == pytest.approx(home, abs=1e-3)


REFUSED = {
    "a foot without a flat face": (walker(shape=WHEEL), "foot 'left_ankle_x_link' of walker.urdf.*"
                                   "no flat face.*cm\\^2.*measured"),
    "a robot without feet": (
        walker(joints=SIX[:2]), "no feet are found in walker.urdf.*description_template"),
    "a robot on four legs": (
        walker().replace("</robot>", leg("left", FIVE, BOX, 0.0).replace("left_", "hind_left_")
                         + leg("right", FIVE, BOX, 0.0).replace("right_", "hind_right_")
                         + "</robot>"),
        "walker.urdf has more than two legs.*hind_left_ankle_y.*description_template"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_described_is_refused_with_a_remedy(save, case):
    text, message = REFUSED[case]
    with pytest.raises(RobotError, match=message):
        load_robot(save(text))


def with_arms(legs, names=("left_", "right_")):
    """A walker with two arms, whose left one is on the side of +y."""
    arms = "".join(
        chain(n, "trunk", f"0 {y} 0.4", ARM) for n, y in zip(names, (0.2, -0.2), strict=True)
    )
    return legs.replace("</robot>", f"{arms}</robot>")


def exchanged(text):
    return text.replace("left_", "tmp_").replace("right_", "left_").replace("tmp_", "right_")


def knee(inertial):
    """A walker with arms whose left shank has another <inertial>."""
    mass = '<inertial><origin xyz="0 0 -0.1"/><mass value="1.0"/>'
    return with_arms(walker()).replace(
        f'<link name="left_knee_link">{mass}', f'<link name="left_knee_link">{inertial}'
    )


COM_UP = '<inertial><origin xyz="0 0 0.1"/><mass value="1.0"/>'
ODD = {
    "a CoM of the wrong sign": (
        knee(COM_UP), "left and right differ: centres of mass behind left_knee \\(0.2 m from"),
    "arms of the other side": (
        with_arms(exchanged(walker())),
        "left arm \\(left_shoulder_y.*is on the side of the right leg \\(right_hip_z"),
    "limits in degrees": (
        walker().replace('"-1.6" upper="1.6"', '"-92" upper="92"'),
        "two turns.*degrees.*left_hip_z \\(-92 to 92\\).* more$"),
    "masses in grams": (
        walker().replace('mass value="1', 'mass value="1000'), "kg on legs of 0.6.*in grams"),
    "torques in another unit": (
        walker().replace('effort="60"', 'effort="0.06"'),
        "legs has 0.06 N m under 24 kg on legs of 0.6.*far too little"),
    "names that are exchanged": (
        exchanged(with_arms(walker())), "taken to face along -x of its root link"),
}  # fmt: skip


@pytest.mark.parametrize("case", ODD)
def test_what_looks_like_a_mistake_is_remarked_on(save, case):
    text, message = ODD[case]
    assert any(re.search(message, remark) for remark in describe(save(text)).remarks)


def test_a_mirrored_robot_is_not_remarked_on(save):
    assert not describe(save(with_arms(walker()))).remarks


def test_remarks_stand_in_the_warning_of_a_load(save):
    path = save(knee(COM_UP))
    (remark,) = describe(path).remarks
    with pytest.warns(UserWarning, match="guessed") as said:
        load_robot(path)
    assert str(said[0].message).endswith(f"; {remark}")
    path = save(walker().replace('izz="0.01"', 'izz="0.1"', 1))
    with pytest.warns(UserWarning, match="guessed") as said:
        load_robot(path)
    assert str(said[0].message).count("made possible: trunk") == 1


@pytest.mark.parametrize("name", ["axis(1)", "a.b", "ä-/_1"])
def test_a_joint_may_be_named_like_a_pattern(save, name):
    """Beside one that the name as a pattern would match, too, and one that is locked."""
    links = ("base", "tip", "end", "last")
    arm = '<link name="world"/>' + "".join(
        LINK.format(name=n, z=0.1, mass=3.0, shape="") for n in links
    )
    joints = (("weld", "fixed", ""), (name, "continuous", ""), ("aXb", "revolute", LIMIT),
              (f"{name}{name}", "revolute", '<limit lower="0" upper="0"/>'))  # fmt: skip
    for (joint, kind, limit), parent, child in zip(joints, ("world", *links), links, strict=False):
        arm += JOINT.format(
            name=joint, type=kind, xyz="0 0 0.1", rpy="0 0 0", parent=parent, child=child,
            axis="0 0 1", limit=limit,
        )  # fmt: skip
    path = save(f"<robot name='arm'>{arm}</robot>", "arm.urdf")
    path.with_suffix(".poise.yaml").write_text(describe(path).text)
    robot = load_robot(path)
    assert robot.joint_names == (name, "aXb")
    assert robot.source.locked_joints == (f"{name}{name}",)
    np.testing.assert_allclose(robot.q_max, [3.1416, 1.6])
    assert robot.v_max.tolist() == [10.0, 12.0]


WRONG = {
    "too low": ({"position": [0.04, 0.0, -0.08]}, "'left_sole' lies 25 mm below the lowest"),
    "too high": ({"position": [0.04, 0.0, -0.04]}, "'left_sole' lies 15 mm above the lowest"),
    "too long": ({"length": 0.3}, "'left_sole' reaches 50 mm over the edge"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_sole_that_is_off_its_foot_is_told(save, case):
    path = save(walker())
    facts = describe(path).facts
    changed, message = WRONG[case]
    for sole in facts["soles"].values():
        sole.update(changed)
    with pytest.warns(UserWarning, match=message):
        load_robot(path, facts)


def test_a_sole_is_the_largest_rectangle_inside_the_flat_face(save):
    angles = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    rim = "".join(
        f'<collision><origin xyz="{0.15 * np.cos(a)} {0.05 * np.sin(a)} -0.05"/><geometry>'
        '<sphere radius="0.001"/></geometry></collision>'
        for a in angles
    )
    sole = describe(save(walker(shape=rim))).facts["soles"]["left_sole"]
    # The largest rectangle in an ellipse has sqrt(2) times its half axes.
    assert sole["length"] == pytest.approx(0.15 * np.sqrt(2.0), rel=0.03)
    assert sole["width"] == pytest.approx(0.05 * np.sqrt(2.0), rel=0.05)
    corner = 0.5 * np.array([sole["length"], sole["width"]]) + np.abs(sole["position"][:2])
    assert ((corner / [0.15, 0.05]) ** 2).sum() <= 1.0 + 1e-6


@pytest.mark.parametrize(("rpy", "axis"), [("0 0.2 0", 1), ("0 0 0.3", 2)])
def test_a_turned_foot_gives_its_turn(save, rpy, axis):
    """A foot of 0.2 by 0.08 m that a joint at zero tilts, or that points outwards."""
    box = (
        f'<collision><origin xyz="0 0 -0.04" rpy="{rpy}"/><geometry><box size="0.2 0.08 0.03"/>'
        "</geometry></collision>"
    )
    sole = describe(save(walker(shape=box))).facts["soles"]["left_sole"]
    turn = np.zeros(3)
    turn[axis] = float(rpy.split()[axis])
    np.testing.assert_allclose(sole["rpy"], turn, rtol=0, atol=1e-3)
    assert (sole["length"], sole["width"]) == (pytest.approx(0.2), pytest.approx(0.08))


def test_left_is_left_by_name_and_ahead_follows_from_it(save):
    path = save(exchanged(walker()))
    proposal = describe(path)
    assert proposal.facts["soles"]["left_sole"]["link"] == "left_ankle_x_link"
    robot = load_robot(path, proposal.facts)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_home)
    # Ahead is x: the root link is turned round.
    np.testing.assert_allclose(data.oMi[1].rotation[:, 0], [-1.0, 0.0, 0.0], atol=1e-4)
    assert data.oMf[robot.frame_id("left_sole")].translation[1] > 0.05


def test_arms_without_sides_in_their_names_have_those_of_the_legs(save):
    path = save(with_arms(exchanged(walker()), names=("one_", "two_")))
    hands = describe(path).facts["hands"]
    assert hands["left_hand"]["link"] == "two_wrist_link"
    assert load_robot(path, describe(path).facts).hands == ("left_hand", "right_hand")
