"""Inputs that a new user brings: each is loaded with a remark, or refused in one line."""

import os
import types
import warnings

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from unchecked import run_unchecked

from poise.errors import PoiseError, RobotError
from poise.robots import load_robot
from poise.sim import Plant

INERTIA = '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/>'
BOX = '<collision><geometry><box size="0.2 0.1 0.04"/></geometry></collision>'


def link(name, mass=1.0, shape=""):
    inertial = f'<inertial><mass value="{mass}"/>{INERTIA}</inertial>' if mass else ""
    return f'<link name="{name}">{inertial}{shape}</link>'


def joint(name, parent, child, xyz, axis="0 1 0", kind="revolute", inside=None):
    limit = '<limit lower="-1.5" upper="1.5" effort="60" velocity="8"/>'
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{xyz}"/><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="{axis}"/>{limit if inside is None else inside}</joint>'
    )


def biped(extra="", foot=BOX):
    """A biped with legs of five joints and feet that are boxes, as URDF text."""
    parts = ['<robot name="walker one">', link("trunk", 10.0)]
    for side, y in (("left", 0.1), ("right", -0.1)):
        chain = [
            ("hip_yaw", "thigh_1", f"0 {y} 0", "0 0 1", 0.5),
            ("hip_roll", "thigh_2", "0 0 0", "1 0 0", 0.5),
            ("hip_pitch", "thigh", "0 0 0", "0 1 0", 2.0),
            ("knee", "shin", "0 0 -0.3", "0 1 0", 2.0),
            ("ankle_pitch", "ankle", "0 0 -0.3", "0 1 0", 0.5),
            ("ankle_roll", "foot", "0 0 0", "1 0 0", 1.0),
        ]
        parent = "trunk"
        for name, child, xyz, axis, mass in chain:
            child = f"{side}_{child}"
            parts.append(link(child, mass, foot if name == "ankle_roll" else ""))
            parts.append(joint(f"{side}_{name}", parent, child, xyz, axis))
            parent = child
    return "".join([*parts, extra, "</robot>"])


def finger(name, inside):
    """A gripper's finger on the trunk, whose joint holds more elements."""
    limit = '<limit lower="0" upper="0.5" effort="5" velocity="2"/>'
    return link(name, 0.01) + joint(
        f"{name}_joint", "trunk", name, "0.1 0 0", inside=limit + inside
    )


ARM = """<mujoco model="arm"><compiler angle="radian"/>{before}<worldbody>{world}
  <body name="base" pos="0 0 0.5">{root}<geom size="0.05" mass="2"/>
    <body name="upper"><joint name="shoulder" axis="0 1 0" range="-2 2" actuatorfrcrange="-50 50"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0 0 0.3" mass="1"/>
      <body name="lower" pos="0 0 0.3"><joint name="elbow" axis="0 1 0" range="-2 2"
        actuatorfrcrange="-50 50"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0 0 0.3" mass="1"/>
        <body name="palm" pos="0 0 0.3"><joint name="wrist" axis="1 0 0" range="-2 2"
          actuatorfrcrange="-50 50"/><geom size="0.04" mass="0.3"/>{tip}</body></body></body>{side}
  </body></worldbody>{after}</mujoco>"""
"""An arm of three joints as MJCF."""


def arm(**parts):
    return ARM.format(
        **dict.fromkeys(("before", "world", "root", "tip", "side", "after"), "") | parts
    )


def loaded(given, description=None, **options):
    """A robot, and all that was remarked."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        robot = load_robot(given, description, **options)
    return robot, " ".join(str(w.message) for w in said)


def simulated(robot):
    """The robot's plant, with or without rotor inertias."""
    with warnings.catch_warnings(action="ignore"):
        return Plant(robot)


HEAD = link("head")
FIXED = {"base": "fixed"}


def module_of(**paths):
    module = types.ModuleType("some_description")
    vars(module).update(paths)
    return module


def kinds(tmp_path):
    """Each kind of input, by name: the input, further options, the robot's name and its joints."""
    text, folder = biped(), tmp_path / "pkg"
    folder.mkdir()
    urdf, mjcf, xacro = (folder / n for n in ("model.urdf", "arm.xml", "walker.urdf.xacro"))
    urdf.write_text(text)
    mjcf.write_text(arm())
    header = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" '
    (folder / "part.xacro").write_text(
        f'{header}><xacro:macro name="tag">{link("tag")}'
        f"{joint('tag', 'trunk', 'tag', '0 0 0.3')}</xacro:macro></robot>"
    )
    xacro.write_text(
        text.replace("<robot ", header).replace(
            "</robot>", '<xacro:include filename="part.xacro"/><xacro:tag/></robot>'
        )
    )
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    return {
        "a path as text": (str(urdf), {}, "walker_one", 12),
        "a path": (urdf, {}, "walker_one", 12),
        "URDF text": (text, {}, "walker_one", 12),
        "MJCF text": (arm(), {}, "arm", 3),
        "an MJCF file": (mjcf, {}, "arm", 3),
        "a xacro file": (xacro, {}, "walker_one", 13),
        "a Pinocchio model": (model, {"geometry": geometry}, "walker_one", 12),
        "a MuJoCo model": (mujoco.MjModel.from_xml_string(arm()), {}, "arm", 3),
        "a MuJoCo specification": (mujoco.MjSpec.from_string(arm()), {}, "arm", 3),
        "a module with a URDF": (
            module_of(URDF_PATH=str(urdf), PACKAGE_PATH=str(folder)), {}, "walker_one", 12),
        "a module with an MJCF": (module_of(MJCF_PATH=str(mjcf)), {}, "arm", 3),
        "a module with a xacro": (module_of(XACRO_PATH=str(xacro)), {}, "walker_one", 13),
        "a name": ("arm6", {}, "arm6", 6),
    }  # fmt: skip


def test_every_kind_of_input_is_loaded_under_the_name_of_its_model(tmp_path):
    for kind, (given, options, name, joints) in kinds(tmp_path).items():
        robot, _ = loaded(given, **options)
        assert (robot.name, robot.nj) == (name, joints), kind


ACCEPTED = {
    "two materials in one visual": (
        biped(foot=BOX + '<visual><geometry><box size="0.2 0.1 0.04"/></geometry>'
              '<material name="a"><color rgba="1 0 0 1"/></material>'
              '<material name="b"><color rgba="0 1 0 1"/></material></visual>'),
        "of several materials of a shape the first is taken: left_foot, right_foot",
    ),
    "a macro that xacro left behind": (
        biped('<xacro:wheel xmlns:xacro="http://www.ros.org/wiki/xacro"/>'),
        "macros that xacro left behind are left out: wheel",
    ),
    "elements of a simulator": (biped('<gazebo reference="trunk"><link name="x"/></gazebo>'), ""),
    "text behind a mark of the byte order": ("\ufeff\n" + biped(), ""),
    "shapes without a solid": (
        biped(foot=BOX + "".join(f"<visual>{solid}</visual>" for solid in (
            "", "<geometry/>", '<geometry><cone radius="1"/></geometry>',
            "<geometry><sphere/></geometry>"))),
        "",
    ),
    "a speed below zero": (
        biped().replace('velocity="8"', 'velocity="-1"', 1), "velocity limits of 1 joint",
    ),
    "names of the plant's own": (
        arm(before='<asset><texture name="sky" type="2d" builtin="flat" width="8" height="8"/>'
            '<material name="floor" texture="sky"/></asset>',
            tip='<geom name="floor" size="0.01" material="floor"/>'),
        "",
    ),
    "bodies that MuJoCo repeats": (
        arm(side='<replicate count="2" offset="0 0.1 0"><body name="stick" pos="0.2 0 0"><joint '
            'name="peg" range="-1 1"/><geom size="0.02"/></body></replicate>'),
        "velocity limits of 5 joints",
    ),
    "an inertia that no body has": (
        biped().replace('izz="0.02"', 'izz="0.5"', 1),
        "inertias that no body has are made possible: trunk",
    ),
    "a mesh that is missing": (
        biped(foot=BOX + '<visual><geometry><mesh filename="a.stl"/></geometry></visual>'),
        "meshes that cannot be found are missing in pictures: a.stl",
    ),
    "a joint that turns without end": (
        biped(HEAD + joint("neck", "trunk", "head", "0 0 0.3", kind="continuous", inside="")),
        "position limits of 1 joint",
    ),
    "a joint without room": (
        biped(HEAD + joint("neck", "trunk", "head", "0 0 0.3",
                                   inside='<limit lower="0" upper="0" effort="5" velocity="2"/>')),
        "limits of these joints leave no room: neck",
    ),
    "a joint that mimics another": (
        biped(finger("one", "") + finger("two", '<mimic joint="one_joint"/>')),
        "joints that mimic others are locked at zero: two_joint",
    ),
    "an absurd torque limit": (
        biped().replace('effort="60"', 'effort="50000"', 2),
        "torque limits that no motor of a robot of this weight has: left_hip_yaw (50000 N m), "
        "left_hip_roll (50000 N m)",
    ),
    "several root bodies, one of them free": (
        arm(world='<body name="door" pos="2 0 0"><joint range="-1 1"/><geom size="0.1"/></body>'
            '<body name="ball"><freejoint/><geom size="0.1"/></body>'),
        "the world is the base, from which several limbs hang: door, base",
    ),
    "a loop": (
        arm(after='<equality><connect name="rod" body1="palm" body2="base" anchor="0 0 0"/>'
            "</equality>"),
        "loops that these equalities close are left open: rod",
    ),
    "a spring": (
        arm().replace('name="wrist"', 'name="wrist" stiffness="3"'),
        "springs are left out: wrist",
    ),
    "a keyframe outside its limits": (
        arm(after='<keyframe><key name="home" qpos="3 0.5 0"/></keyframe>'),
        "keyframe 'home' is outside the limits and clipped: shoulder",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", ACCEPTED)
def test_a_fault_that_published_models_have_is_repaired_with_a_remark(case, capfd):
    text, remark = ACCEPTED[case]
    robot, said = loaded(text)
    simulated(robot)
    assert remark in said
    assert robot.nj >= 3
    assert capfd.readouterr() == ("", "")


KINDS_WANTED = (
    "wanted a name of `poise robots`, a path to URDF, MJCF or xacro, XML text, a pinocchio"
)
SDF = "<sdf version='1.7'/>"

REFUSED = {
    "a number": (3, f"this is no robot; got 3; {KINDS_WANTED}"),
    "a link called world": (
        biped(link("world") + joint("tie", "trunk", "world", "0 0 0", kind="fixed")),
        "text has a link 'world' that is not its root; wanted another name for it",
    ),
    "NaN in an MJCF": (
        arm().replace('pos="0 0 0.5"', 'pos="0 0 nan"'),
        "text: pos in <body> 'base' is NaN; got '0 0 nan'; wanted numbers",
    ),
    "an unknown name": ("g2", "unknown robot; got 'g2'; choices: g1,"),
    "a missing file": ("g2.urdf", "cannot read a file (No such file or directory); got 'g2.urdf'"),
    "text that is not XML": ("<robot", "text is not valid XML: "),
    "another format": (
        SDF,
        "text is neither URDF nor MJCF; got '<sdf>'; wanted <robot> (URDF) or <mujoco> (MJCF) as",
    ),
    "no links": ("<robot name='r'/>", "text has no links; got '<robot>'; wanted a robot"),
    "xacro under another name": (
        biped('<xacro:property name="r" value="1" xmlns:xacro="http://www.ros.org/wiki/xacro"/>'),
        "text is a xacro file, which is not expanded; got ['property']; wanted the suffix "
        ".xacro, which Poise expands with `pip install poise[xacro]`",
    ),
    "two links of one name": (biped(HEAD + HEAD), "text has two links of one name; got ['head']"),
    "two joints of one name": (
        biped(HEAD + joint("left_knee", "trunk", "head", "0 0 0.3")),
        "text has two joints of one name; got ['left_knee']",
    ),
    "a mimic of an unknown joint": (
        biped(finger("two", '<mimic joint="thumb"/>')),
        "text: joint 'two_joint' mimics a joint that does not exist; got 'thumb'; choices: ",
    ),
    "a planar joint": (
        biped(HEAD + joint("neck", "trunk", "head", "0 0 0.3", kind="planar")),
        "text: joint 'neck' is of a type that Poise has not; got 'planar'; wanted revolute, ",
    ),
    "a floating joint inside": (
        biped(HEAD + joint("neck", "trunk", "head", "0 0 0.3", kind="floating", inside="")),
        "text has a floating joint that is not its base; got ['neck']; wanted at most one, from",
    ),
    "an axis of zeros": (
        biped(HEAD + joint("neck", "trunk", "head", "0 0 0.3", axis="0 0 0")),
        "text: the axis of joint 'neck' has no direction; got '0 0 0'; wanted three numbers",
    ),
    "limits that cross": (
        biped().replace('lower="-1.5"', 'lower="2"', 1),
        "text has joints whose lower limit is above the upper one; got 'left_hip_yaw: lower 2, ",
    ),
    "a negative mass": (
        biped().replace('value="10.0"', 'value="-1"'),
        "text: link 'trunk' has a negative mass or inertia; got 'mass -1 kg, principal inertias",
    ),
    "letters for numbers": (
        biped().replace('xyz="0 0.1 0"', 'xyz="0 a 0"'),
        "text: xyz in <origin> of joint 'left_hip_yaw' is not 3 numbers; got '0 a 0'; wanted 3",
    ),
    "two roots": (biped(HEAD), "text has no single root link; got ['trunk', 'head']; wanted one"),
    "a joint of no link": (
        biped(joint("neck", "trunk", "hat", "0 0 0.3")),
        "text: child of joint 'neck' is no link; got 'hat'; choices: ",
    ),
    "several robots": (
        arm(root="<freejoint/>", world='<body name="other"><freejoint/><geom size="0.1"/><body '
            'name="tail"><joint range="-1 1"/><geom size="0.1"/></body></body>'),
        "text has several robots; got ['other', 'base']; wanted one body with joints under",
    ),
    "a base that floats without legs": (
        arm(root="<freejoint/>"),
        "no feet are found in text; got 'a free base",
    ),
    "a robot on wheels": (
        arm(root="<freejoint/>", side="".join(
            f'<body name="wheel{k}" pos="{x} {y} 0"><joint name="wheel{k}" axis="0 1 0"/>'
            '<geom type="cylinder" size="0.1 0.02" zaxis="0 1 0" mass="1"/></body>'
            for k, (x, y) in enumerate([(0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)]))),
        "no feet are found in text; got 'a free base, and joints that turn without end, as wheels "
        "do: wheel0, wheel1, wheel2, wheel3'; wanted two legs",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_anything_else_is_refused_in_one_line(case, capfd):
    given, message = REFUSED[case]
    with pytest.raises(PoiseError) as error:
        loaded(given)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 2000
    assert capfd.readouterr() == ("", "")


def test_of_several_bodies_the_one_with_a_free_joint_is_the_robot():
    door = '<body name="door" pos="2 0 0"><joint range="-1 1"/><geom size="0.1"/></body>'
    on_base = {"link": "base", "length": 0.1, "width": 0.1}
    stands = {"base": "floating", "pelvis": "base", "torso": "base", "soles": {"sole": on_base}}
    tied = '<equality><joint joint1="door" joint2="hatch"/></equality>'
    scene = door + door.replace('"door"', '"hatch"').replace("joint ", 'joint name="hatch" ')
    scene = scene.replace("<joint range", '<joint name="door" range')
    robot, said = loaded(arm(root="<freejoint/>", world=scene, after=tied), stands)
    assert robot.joint_names == ("shoulder", "elbow", "wrist")
    assert "bodies beside the robot are left out: door, hatch" in said


@pytest.mark.parametrize("kind", ["pipe", "pipe.urdf", "pipe.xacro"])
def test_a_pipe_is_refused_and_not_waited_for(tmp_path, kind):
    os.mkfifo(tmp_path / kind)
    with pytest.raises(PoiseError, match=r"^(unknown robot|cannot read what is no file); got "):
        load_robot(tmp_path / kind)


MESHES = {
    "too short": (b"solid", "a mesh of the robot cannot be read: "),
    "empty": (bytes(84), "a mesh of the robot has no triangles, or NaN in them; got "),
    "NaN": (
        bytes(80) + (1).to_bytes(4, "little") + np.full(12, np.nan, "<f4").tobytes() + bytes(2),
        "a mesh of the robot has no triangles, or NaN in them; got ",
    ),
}


@pytest.mark.parametrize("case", MESHES)
def test_a_mesh_that_is_none_is_refused_in_one_line(tmp_path, case):
    content, message = MESHES[case]
    (tmp_path / "foot.stl").write_bytes(content)
    mesh = f'<collision><geometry><mesh filename="{tmp_path}/foot.stl"/></geometry></collision>'
    with pytest.raises(RobotError) as error:
        loaded(biped(foot=mesh))
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_models_that_a_document_attaches_are_part_of_the_robot(tmp_path):
    hand = '<body name="finger"><joint name="bend" range="-1 1"/><geom size="0.02"/></body>'
    (tmp_path / "hand.xml").write_text(f"<mujoco><worldbody>{hand}</worldbody></mujoco>")
    main = tmp_path / "main.xml"
    main.write_text(
        arm(
            before='<asset><model name="hand" file="hand.xml"/></asset>',
            tip='<attach model="hand" body="finger" prefix="right_"/>',
        )
    )
    assert loaded(main, FIXED)[0].joint_names == ("shoulder", "elbow", "wrist", "right_bend")


def test_nan_leaves_no_log_of_mujocos(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    model = mujoco.MjModel.from_xml_string(arm())
    model.jnt_range[0, 0] = np.nan
    with pytest.raises(RobotError, match=r"^MjModel: range in <joint> 'shoulder' is NaN"):
        loaded(model, FIXED)
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())


OF_OTHER_KINDS = """
import json, pinocchio as pin
from poise.errors import PoiseError
from poise.robots import JointOrder, load_robot
from poise.sim import MujocoBridge
said, arm = [], load_robot("arm6")
text = "<mujoco><worldbody><body name='b'/></worldbody></mujoco>"
for call in [
    lambda: load_robot(text, 3),
    lambda: load_robot(pin.Model(), geometry=3),
    lambda: MujocoBridge("arm6", 3),
    lambda: MujocoBridge(arm, 3),
    lambda: JointOrder.of("arm6"),
]:
    try:
        call()
    except PoiseError as error:
        said.append(str(error))
print(json.dumps(said))
"""


def test_things_of_other_kinds_are_refused():
    assert run_unchecked(OF_OTHER_KINDS) == [
        "this is no description; got 3; wanted a path or a mapping",
        "geometry of a model is of the wrong kind; got 3; wanted GeometryModel",
        "robot of the bridge is of the wrong kind; got 'arm6'; wanted Robot",
        "model of the bridge is of the wrong kind; got 3; wanted MjModel",
        "robot of an order is of the wrong kind; got 'arm6'; wanted Robot",
    ]


def test_a_screw_of_pinocchios_is_no_hinge():
    model = pin.Model()
    screw = model.addJoint(0, pin.JointModelHX(0.1), pin.SE3.Identity(), "screw")
    model.appendBodyToJoint(screw, pin.Inertia.Identity(), pin.SE3.Identity())
    with pytest.raises(RobotError, match=r"^joint 'screw' of pin.Model is neither hinge nor slide"):
        loaded(model, FIXED)


def test_a_robot_is_the_same_from_text_from_pinocchio_and_from_mujoco():
    """Mass matrices at a random posture, from one MJCF document read in three ways."""
    text = arm(before="<option/>").replace('name="elbow"', 'name="elbow" armature="0.05" ref="0.3"')
    limits = {"limits": {"velocity": {".*": 5.0}}}
    robots = [
        loaded(given, FIXED | limits)[0]
        for given in (text, mujoco.MjModel.from_xml_string(text), mujoco.MjSpec.from_string(text))
    ]
    robots.append(loaded(robots[0].model, FIXED | limits)[0])
    q = np.random.default_rng(3).uniform(-1.0, 1.0, 3)
    M, *others = [pin.crba(r.model, r.model.createData(), q) for r in robots]
    for other, robot in zip(others, robots[1:], strict=True):
        np.testing.assert_allclose(np.triu(other), np.triu(M), rtol=0, atol=1e-12)
        for limit in ("q_min", "q_max", "v_max", "tau_max"):
            np.testing.assert_allclose(getattr(robot, limit), getattr(robots[0], limit))


def test_a_pinocchio_model_keeps_the_order_of_its_joints():
    """MuJoCo's order, in which legs come right first, is not that of Pinocchio's URDF parser."""
    sides = ("right", "left")
    legs = "".join(
        f'<body name="{side}_thigh" pos="0 {y} 0"><joint name="{side}_hip" range="-1 1" '
        'actuatorfrcrange="-9 9" damping="0.2"/><geom size="0.05" mass="1"/></body>'
        for side, y in zip(sides, (-0.1, 0.1), strict=True)
    )
    limits = {"limits": {"velocity": {".*": 5.0}}}
    model = loaded(arm(side=legs), FIXED | limits)[0].model
    robot = loaded(model, FIXED | limits)[0]
    assert robot.joint_names == tuple(model.names)[1:]
    q = np.linspace(-0.5, 0.5, robot.nq)
    M, other = (np.triu(pin.crba(m, m.createData(), q)) for m in (model, robot.model))
    np.testing.assert_allclose(other, M, rtol=0, atol=1e-12)
    np.testing.assert_allclose(robot.model.damping, model.damping)
    frames = [m.frames[m.getFrameId("left_thigh")] for m in (model, robot.model)]
    assert frames[0].placement.isApprox(frames[1].placement)
    assert frames[0].parentJoint == frames[1].parentJoint


def gears(ratio=-0.5):
    """A gear on the base that drives the shoulder: q_shoulder = ratio q_gear."""
    gear = (
        '<body name="gear"><joint name="gear" axis="0 1 0" range="-3 3" armature="0.01" '
        'actuatorfrcrange="-8 8"/><geom type="cylinder" size="0.02 0.01" mass="0.02"/></body>'
    )
    tied = (
        f'<equality><joint joint1="shoulder" joint2="gear" polycoef="0 {ratio} 0 0 0"/></equality>'
    )
    text = arm(side=gear, after=tied)
    return text.replace('range="-2 2" actuatorfrcrange="-50 50"', 'range="-2 2"', 1)


def test_a_gear_and_its_output_are_one_joint_with_the_motor_of_the_gear():
    """The output has torque over |ratio|, range times it and rotor inertia over its square."""
    robot, said = loaded(gears(), FIXED)
    assert robot.joint_names == ("shoulder", "elbow", "wrist")
    assert "gears are one joint with their output" in said
    shoulder = robot.joint_index("shoulder")
    assert robot.tau_max[shoulder] == pytest.approx(8.0 / 0.5)
    assert robot.model.armature[shoulder] == pytest.approx(0.01 / 0.5**2)
    assert (robot.q_min[shoulder], robot.q_max[shoulder]) == (-1.5, 1.5)


def test_a_gear_of_a_gear_passes_on_its_drive_in_any_order():
    motor = (
        '<body name="motor"><joint name="motor" axis="0 1 0" range="-9 9" armature="0.001" '
        'actuatorfrcrange="-1 1"/><geom size="0.01" mass="0.005"/></body>'
    )
    text = gears().replace('<body name="gear">', motor + '<body name="gear">')
    text = text.replace('actuatorfrcrange="-8 8"', "")
    first = '<joint joint1="gear" joint2="motor" polycoef="0 0.25 0 0 0"/></equality>'
    robot, said = loaded(text.replace("</equality>", first), FIXED)
    shoulder = robot.joint_index("shoulder")
    assert robot.tau_max[shoulder] == pytest.approx(1.0 / 0.25 / 0.5)
    rotors = 0.01 + 0.001 / 0.25**2
    assert robot.model.armature[shoulder] == pytest.approx(rotors / 0.5**2)
    assert said.endswith("speed and rotor: shoulder")


def test_a_joint_is_welded_below_a_joint_with_the_name_of_its_link():
    text = arm().replace('body name="lower"', 'body name="elbow"')
    robot, _ = loaded(text, FIXED | {"locked": ["wrist"]})
    assert robot.joint_names == ("shoulder", "elbow")
    names = [frame.name for frame in robot.model.frames]
    assert names.count("elbow") == 2
    assert names.count("palm") == 1
    simulated(robot)


def test_a_gear_and_its_output_move_as_mujoco_moves_them_coupled():
    """The acceleration under a torque at the gear, against MuJoCo's with a stiff equality."""
    stiff = 'solref="0.002 1" solimp="0.9999 0.9999 0.001 0.5 2"'
    text = gears().replace("<joint joint1", f"<joint {stiff} joint1")
    text = text.replace("<worldbody>", '<option><flag contact="disable"/></option><worldbody>')
    robot, _ = loaded(text, FIXED)
    model = mujoco.MjModel.from_xml_string(text)
    data, torque = mujoco.MjData(model), 2.0
    data.qfrc_applied[model.joint("gear").dofadr] = torque
    mujoco.mj_forward(model, data)
    ours = pin.aba(
        robot.model, robot.model.createData(), np.zeros(3), np.zeros(3),
        np.array([torque / -0.5, 0.0, 0.0]),
    )  # fmt: skip
    theirs = [float(data.qacc[model.joint(n).dofadr[0]]) for n in robot.joint_names]
    # The gear's own inertia about its axis is neglected: 4e-6 of 0.01 kg m^2.
    np.testing.assert_allclose(ours, theirs, rtol=2e-3)


def test_a_robot_without_a_joint_to_move_is_refused():
    with pytest.raises(RobotError, match=r"^text has no joint to move; got \('shoulder', 'elbow'"):
        loaded(arm(), FIXED | {"locked": [".*"]})


def test_places_at_infinity_are_refused():
    text = arm().replace('pos="0 0 0.3"', 'pos="0 0 inf"')
    with pytest.raises(RobotError, match=r"^text can move without inertia; got "):
        loaded(text, FIXED)


def test_files_are_included_from_the_folder_of_the_file_that_includes_them(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/arm.xml").write_text('<mujoco><include file="leaf.xml"/></mujoco>')
    (tmp_path / "parts/leaf.xml").write_text(arm())
    main = tmp_path / "main.xml"
    main.write_text('<mujoco model="main"><include file="parts/arm.xml"/></mujoco>')
    assert loaded(main)[0].joint_names == ("shoulder", "elbow", "wrist")
    (tmp_path / "parts/leaf.xml").write_bytes(b"\xff\xfe")
    with pytest.raises(RobotError, match=r"^file is not text; got .*leaf.xml"):
        loaded(main)
    (tmp_path / "parts/leaf.xml").write_text('<mujoco><include file="../parts/arm.xml"/></mujoco>')
    with pytest.raises(RobotError, match=r"^a file included by leaf.xml includes it"):
        loaded(main)
    (tmp_path / "parts/leaf.xml").unlink()
    with pytest.raises(RobotError, match=r"^a file included by arm.xml cannot be found"):
        loaded(main)
