"""MJCF as people write it, against what MuJoCo itself computes from the same file."""

import numpy as np
import pinocchio as pin
import pytest

mujoco = pytest.importorskip("mujoco")

from poise.errors import RobotError  # noqa: E402
from poise.robots import describe, load_robot  # noqa: E402
from poise.robots._document import read_document  # noqa: E402

MODEL = """<mujoco model="odd">
  <compiler angle="degree" autolimits="true" meshdir="meshes"/>
  <option iterations="1" gravity="0 0 -9.81"/>
  <default>
    <joint damping="0.3" armature="0.01"/>
    <default class="leg"><joint axis="0 1 0" range="-80 80"/>
      <motor ctrlrange="-1 1" gear="40"/>
      <default class="ankle"><joint armature="0.02" frictionloss="0.1"/></default></default>
  </default>
  <asset><mesh name="shell" file="shell.stl"/></asset>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="1 1 0.1"/>
    <body name="marker" pos="1 0 0"><geom size="0.01"/></body>
  </worldbody>
  <worldbody>
    <frame pos="0 0 0.3" childclass="leg">
      <body name="trunk" pos="0 0 0.7" quat="0.8 0.1 0.2 0.3">
        <freejoint/>
        <inertial pos="0.01 0.02 0.2" mass="10" fullinertia="0.3 0.25 0.1 0.01 0.02 -0.01"/>
        <geom type="mesh" mesh="shell"/>
        <site name="torso" pos="0 0 0.4" euler="0 20 0"/>
        <body name="head" pos="0 0 0.5" gravcomp="1"><inertial pos="0 0 0.1" mass="1"
            diaginertia="0.01 0.01 0.01"/>
          <joint name="neck_z" axis="0 0 1" range="-40 40" pos="0.01 0 0.02" stiffness="20"/>
          <joint name="neck_y" axis="0 1 1" range="-40 40" ref="15" pos="-0.01 0.01 0"/></body>
        <frame euler="0 10 0">{legs}</frame>
      </body>
    </frame>
  </worldbody>
  <contact><pair geom1="left_foot" geom2="no_such_floor"/></contact>
  <equality><joint joint1="neck_y" joint2="neck_z"/></equality>
  <actuator>
    <motor class="leg" joint="left_hip"/><motor joint="left_ankle" gear="2" ctrlrange="-20 20"/>
    <position joint="right_hip" kp="300" forcerange="-70 60"/>
    <position joint="right_ankle" kp="300" ctrlrange="-1 1"/>
  </actuator>
  <sensor><jointpos joint="left_hip"/></sensor>
  <keyframe><key name="home" qpos="0 0 1 1 0 0 0 0 0.2 0.1 -0.1 0.1 -0.1"/></keyframe>
</mujoco>"""
LEG = """<body name="{side}_shin" pos="0 {y} 0"><joint name="{side}_hip"/>
  <geom type="capsule" size="0.04" fromto="0 0 0 0.02 0 -0.4" mass="2"/>
  <body name="{side}_foot" pos="0 0 -0.4" euler="0 -10 0">
    <joint name="{side}_ankle" class="ankle"/>
    <geom name="{side}_foot" type="box" size="0.1 0.05 0.02" pos="0.03 0 -0.03" mass="1"/>
  </body></body>"""
SOLE = {"position": [0.03, 0.0, -0.05], "length": 0.2, "width": 0.1}
FACTS = {
    "base": "floating",
    "pelvis": "trunk",
    "torso": "trunk",
    "soles": {f"{s}_sole": {"link": f"{s}_foot", **SOLE} for s in ("left", "right")},
}

PLAIN = """<mujoco model="plain">
  <compiler angle="degree" {compiler}/>
  <default><default class="leg"><joint axis="0 1 0" range="-60 60" actuatorfrcrange="-50 50"
    armature="0.03"/></default></default>
  {before}
  <worldbody>
    <body name="trunk" pos="0 0 1">
      <freejoint/>
      <inertial pos="0 0 0.2" mass="10" diaginertia="0.3 0.3 0.1"/>
      {legs}
    </body>
    {world}
  </worldbody>
  {after}
</mujoco>"""
PLAIN_LEG = """<body name="{side}_shin" pos="0 {y} 0"><joint name="{side}_hip" class="leg"/>
  <geom type="capsule" size="0.04" fromto="0 0 0 0 0 -0.4" mass="2"/>
  <body name="{side}_foot" pos="0 0 -0.4"><joint name="{side}_ankle" class="leg"/>
    <geom type="box" size="0.1 0.05 0.02" pos="0.03 0 -0.03" mass="1"/></body></body>"""
FIXED_FACTS = {"base": "fixed", "limits": {"velocity": {".*": 8.0}}}
PLAIN_FACTS = FACTS | FIXED_FACTS | {"base": "floating"}


def plain(compiler="", before="", leg=PLAIN_LEG, world="", after=""):
    """A biped of four joints whose parts a test may change."""
    legs = "".join(leg.format(side=s, y=y) for s, y in (("left", 0.1), ("right", -0.1)))
    return PLAIN.format(compiler=compiler, before=before, legs=legs, world=world, after=after)


@pytest.fixture
def path(tmp_path):
    legs = "".join(LEG.format(side=s, y=y) for s, y in (("left", 0.1), ("right", -0.1)))
    path = tmp_path / "odd.xml"
    path.write_text(MODEL.format(legs=legs))
    return path


@pytest.fixture
def robot(path):
    with pytest.warns(UserWarning, match=r"odd\.xml"):
        return load_robot(path, FACTS)


def reference(path):
    """The same file in MuJoCo, without what never compiles, and the joint that is locked."""
    text = path.read_text().replace('<geom type="mesh" mesh="shell"/>', "")
    text = text.replace('<asset><mesh name="shell" file="shell.stl"/></asset>', "")
    text = text.replace('stiffness="20"', "").replace('gravcomp="1"', "")
    for section in ("contact", "equality", "keyframe"):
        start, end = text.index(f"<{section}>"), text.index(f"</{section}>")
        text = text[:start] + text[end + len(section) + 3 :]
    return mujoco.MjModel.from_xml_string(text)


def test_one_warning_says_what_was_assumed_and_left_out(path):
    with pytest.warns(UserWarning, match="odd") as said:
        load_robot(path, FACTS)
    (warning,) = said
    text = str(warning.message)
    for part in (
        "velocity limits of 10 rad/s",
        "torque limits of",
        "mimic others are locked at zero: neck_y",
        "springs are left out: neck_z",
        "missing in pictures: shell.stl",
    ):
        assert part in text


def test_limits_and_rotor_inertias_are_those_of_joints_and_actuators(robot):
    assert robot.joint_names == ("neck_z", "left_hip", "left_ankle", "right_hip", "right_ankle")
    np.testing.assert_allclose(robot.q_max, np.radians([40, 80, 80, 80, 80]))
    np.testing.assert_allclose(robot.tau_max[1:4], [40.0, 40.0, 70.0])
    # A position servo without a range of force says nothing: a part of weight times leg length.
    assert 5.0 < robot.tau_max[4] < 50.0
    np.testing.assert_allclose(robot.model.armature[6:], [0.01, 0.01, 0.02, 0.01, 0.02])
    np.testing.assert_allclose(robot.model.damping[6:], 0.3)
    np.testing.assert_allclose(robot.model.upperDryFrictionLimit[6:], [0.0, 0.0, 0.1, 0.0, 0.1])


def test_both_engines_agree_at_random_states(path, robot):
    model = reference(path)
    data, ours = mujoco.MjData(model), robot.model.createData()
    rng = np.random.default_rng(3)
    address = [model.joint(n).qposadr[0] for n in robot.joint_names]
    dofs = [*range(6), *(model.joint(n).dofadr[0] for n in robot.joint_names)]
    for _ in range(10):
        q = pin.integrate(robot.model, pin.neutral(robot.model), rng.normal(size=robot.nv))
        v = rng.normal(size=robot.nv)
        data.qpos[:3], data.qpos[3:7] = q[:3], q[[6, 3, 4, 5]]
        data.qpos[model.joint("neck_y").qposadr[0]] = 0.0
        data.qpos[address], data.qvel[:] = q[7:], 0.0
        world_R_base = pin.Quaternion(q[3:7]).toRotationMatrix()
        data.qvel[dofs] = np.r_[world_R_base @ v[:3], v[3:]]
        mujoco.mj_forward(model, data)
        pin.forwardKinematics(robot.model, ours, q, v)
        pin.updateFramePlacements(robot.model, ours)
        for frame in ("head", "left_foot", "right_shin"):
            place = ours.oMf[robot.frame_id(frame)]
            np.testing.assert_allclose(place.translation, data.body(frame).xpos, atol=1e-12)
            np.testing.assert_allclose(place.rotation.ravel(), data.body(frame).xmat, atol=1e-12)
        site = ours.oMf[robot.frame_id("torso_site")]
        np.testing.assert_allclose(site.translation, data.site("torso").xpos, atol=1e-12)
        com = pin.centerOfMass(robot.model, ours, q)
        np.testing.assert_allclose(com, data.body("trunk").subtree_com, atol=1e-12)
        compare_dynamics(robot, ours, model, data, q, v, dofs, world_R_base)


def compare_dynamics(robot, ours, model, data, q, v, dofs, world_R_base):
    T, Tdot = np.eye(robot.nv), np.zeros((robot.nv, robot.nv))
    T[:3, :3], Tdot[:3, :3] = world_R_base, world_R_base @ pin.skew(v[3:6])
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    M, bias = M[np.ix_(dofs, dofs)], data.qfrc_bias[dofs]
    pin.computeAllTerms(robot.model, ours, q, v)
    mass = np.triu(ours.M) + np.triu(ours.M, 1).T
    np.testing.assert_allclose(mass, T.T @ M @ T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.nle, T.T @ (bias + M @ (Tdot @ v)), rtol=0, atol=1e-9)


def test_the_plant_is_the_same_robot(robot):
    from poise.sim import Plant

    plant = Plant(robot)
    assert plant.mass == pytest.approx(robot.mass)
    assert plant.model.njnt == 1 + robot.nj
    assert not plant.model.jnt_stiffness.any()
    assert not plant.model.body_gravcomp.any()
    data, ours = mujoco.MjData(plant.model), robot.model.createData()
    data.qpos[:] = plant.map.qpos(robot.q_home)
    mujoco.mj_forward(plant.model, data)
    pin.framesForwardKinematics(robot.model, ours, robot.q_home)
    # The head hangs on a locked joint with a `ref`.
    for body in ("trunk", "head", "left_foot"):
        place = ours.oMf[robot.frame_id(body)]
        np.testing.assert_allclose(data.body(body).xpos, place.translation, atol=1e-12)
        np.testing.assert_allclose(data.body(body).xmat, place.rotation.ravel(), atol=1e-12)


MOTORS = {
    "a motor that has more": ('motor joint="{}" ctrlrange="-200 200"', 50.0),
    "a motor that has less": ('motor joint="{}" ctrlrange="-30 30"', 30.0),
    "a servo that has less": ('position joint="{}" kp="9" forcerange="-40 40"', 40.0),
    "a control without an end": ('motor joint="{}" ctrllimited="false" ctrlrange="-30 30"', 50.0),
}


@pytest.mark.parametrize("case", MOTORS)
def test_torque_limits_are_the_tighter_of_joints_and_actuators(tmp_path, case):
    motor, limit = MOTORS[case]
    motors = "".join(f"<{motor.format(j)}/>" for j in ("left_hip", "right_ankle"))
    path = tmp_path / "plain.xml"
    path.write_text(plain(after=f"<actuator>{motors}</actuator>"))
    robot = load_robot(path, PLAIN_FACTS)
    np.testing.assert_allclose(robot.tau_max, [limit, 50.0, 50.0, limit])
    # `describe` estimates rotors by the same limits: 4 ms times torque over 10 rad/s.
    bare = path.read_text().replace('armature="0.03"', "").replace("<freejoint/>", "")
    path.write_text(bare)
    assert describe(path).facts["armature"]["left_hip"] == pytest.approx(0.004 * limit / 10.0)


WORLDS = {
    "bodies of a replicate in frames": (
        '<frame><frame><replicate count="2" offset="0 1 0">{}</replicate></frame></frame>'
    ),
    "a body that a camera follows": '{}<frame><camera mode="targetbody" target="crate"/></frame>',
}


@pytest.mark.parametrize("base", ["floating", "fixed"])
@pytest.mark.parametrize("case", WORLDS)
def test_scenery_is_no_part_of_the_robot(tmp_path, case, base):
    from poise.sim import Plant

    path = tmp_path / "plain.xml"
    crate = '<body name="crate" pos="1 0 0"><geom size="0.1" mass="7"/></body>'
    text, facts, mass = plain(world=WORLDS[case].format(crate)), PLAIN_FACTS, 16.0
    if base == "fixed":
        # The mass of a link that is fixed to the world does not count.
        text, facts, mass = text.replace("<freejoint/>", ""), FIXED_FACTS, 6.0
    path.write_text(text)
    robot = load_robot(path, facts)
    assert not [f.name for f in robot.model.frames if "crate" in f.name]
    assert robot.mass == pytest.approx(mass)
    assert Plant(robot).model.nbody == 1 + 5


@pytest.mark.parametrize(
    "frames", ["{outer}{plain}", "{plain}{outer}", "{other}{outer}", "{outer}"]
)
def test_a_class_of_frames_around_the_robot_is_kept(tmp_path, frames):
    outer, other = '<frame childclass="leg">', '<frame childclass="other">'
    opened = frames.format(outer=outer, plain='<frame pos="0 0 1">', other=other)
    text = plain(leg=PLAIN_LEG.replace(' class="leg"', ""))
    text = text.replace('<default class="leg">', '<default class="other"/><default class="leg">')
    text = text.replace('<body name="trunk"', f'{opened}<body name="trunk"')
    text = text.replace("</worldbody>", "</frame>" * opened.count("<frame") + "</worldbody>")
    path = tmp_path / "plain.xml"
    path.write_text(text)
    robot, theirs = load_robot(path, PLAIN_FACTS), mujoco.MjModel.from_xml_string(text)
    np.testing.assert_allclose(robot.q_max, theirs.jnt_range[1:, 1])
    np.testing.assert_allclose(robot.model.armature[6:], theirs.dof_armature[6:])
    assert robot.model.armature[6] == 0.03


def test_joints_that_are_locked_off_their_ref_stand_at_zero_in_both_engines(tmp_path):
    """Hinges and slides, at an offset, in a frame, before and after others of the same body."""
    from poise.sim import Plant, StateMap

    hip = '<joint name="{side}_hip" class="leg"'
    text = plain(
        leg=PLAIN_LEG.replace(hip, hip + ' ref="35" pos="0.02 0.01 -0.03"').replace(
            '<joint name="{side}_ankle" class="leg"/>',
            """<joint name="{side}_slide" type="slide" axis="1 2 0" range="-1 1" ref="0.04"/>
            <frame pos="0 0.03 0.01" euler="20 0 30">
              <joint name="{side}_b" range="-60 60" axis="0 0 2" ref="-25" pos="0 0.02 0"/>
              <joint name="{side}_c" range="-60 60" axis="1 1 0" ref="10"/></frame>
            <joint name="{side}_ankle" class="leg" ref="15" pos="0.01 0 0"/>""",
        )
    )
    # The foot stands in a frame, and is turned by angles.
    text = text.replace('_foot" pos="0 0 -0.4">', '_foot" pos="0 0 -0.4" euler="5 10 15">')
    path = tmp_path / "plain.xml"
    path.write_text(text.replace("<freejoint/>", ""))
    facts = {"base": "fixed", "limits": {"velocity": {".*": 8.0}, "torque": {".*": 50.0}}}
    locked = ["left_(hip|b|ankle)", "right_slide"]
    robot = load_robot(path, facts | {"armature": 0.01, "locked": locked})
    model, ours = Plant(robot).model, robot.model.createData()
    data, state = mujoco.MjData(model), StateMap(robot, model)
    assert robot.joint_names == ("left_slide", "left_c", "right_hip", "right_b", "right_c",
                                 "right_ankle")  # fmt: skip
    rng = np.random.default_rng(5)
    for _ in range(5):
        q = rng.uniform(robot.q_min, robot.q_max)
        data.qpos[:] = state.qpos(q)
        mujoco.mj_forward(model, data)
        pin.framesForwardKinematics(robot.model, ours, q)
        for body in ("left_shin", "left_foot", "right_shin", "right_foot"):
            place = ours.oMf[robot.frame_id(body)]
            np.testing.assert_allclose(data.body(body).xpos, place.translation, atol=1e-12)
            np.testing.assert_allclose(data.body(body).xmat, place.rotation.ravel(), atol=1e-12)


TURNS = {
    "a quaternion": 'quat="0.8 0.1 0.2 0.3"',
    "angles": 'euler="10 90 20"',
}


@pytest.mark.parametrize("framed", [False, True])
@pytest.mark.parametrize("case", TURNS)
def test_how_the_root_stands_is_read_in_any_spelling(case, framed):
    text = plain(compiler='eulerseq="zyx"').replace(' pos="0 0 1"', f' pos="0 0 1" {TURNS[case]}')
    if framed:
        opened = f'<frame {TURNS[case]}><frame euler="0 0 30"><body name="trunk"'
        text = text.replace('<body name="trunk"', opened)
        text = text.replace("</worldbody>", "</frame></frame></worldbody>")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    upright = read_document(text, "plain.xml").facts.upright
    np.testing.assert_allclose(upright.ravel(), data.body("trunk").xmat, rtol=0, atol=1e-12)


def test_what_has_no_name_gets_one_that_nothing_else_has(tmp_path):
    path = tmp_path / "plain.xml"
    leg = PLAIN_LEG.replace(' name="{side}_hip"', "").replace('name="{side}_shin"', "")
    text = plain(leg=leg, world='<body name="body2"><geom size="0.1"/></body>')
    # Bodies 2 and 4 are the shins.
    path.write_text(text.replace("right_ankle", "body4_joint"))
    robot = load_robot(path, PLAIN_FACTS)
    assert robot.joint_names == ("body2__joint", "left_ankle", "body4_joint_", "body4_joint")
    assert robot.mass == pytest.approx(16.0)


TIED = {
    "a joint": '<joint joint1="left_ankle" joint2="right_ankle" {}/>',
    "a loop": '<connect body1="left_foot" body2="right_foot" anchor="0 0 0" {}/>',
}


@pytest.mark.parametrize("case", TIED)
def test_an_equality_that_is_switched_off_ties_nothing(case):
    for active, ties in (("true", 1), ("false", 0)):
        tied = TIED[case].format(f'active="{active}"')
        text = plain(after=f"<equality>{tied}</equality>")
        facts = read_document(text, "plain.xml").facts
        assert len(facts.couplings) + len(facts.remarks) == ties


BAD = {
    "two robots": (
        '<body name="marker" pos="1 0 0">',
        '<body name="marker"><freejoint/><body name="arm"><joint/><geom size="0.1"/></body>',
        "several robots.*'marker', 'trunk'.*one with a free joint",
    ),
    "a ball": (
        'name="left_hip"/>',
        'name="left_hip" type="ball" range="0 9"/>',
        "left_hip.*ball joint.*three hinges",
    ),
    "a mesh that gives the mass": (
        'type="capsule"',
        'type="mesh" mesh="shell"',
        "left_shin.*shell",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_read_is_refused_by_name(path, case):
    old, new, message = BAD[case]
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(RobotError, match=message) as error:
        load_robot(path, FACTS)
    assert "odd.xml" in str(error.value) or "odd" in str(error.value)
    assert "\n" not in str(error.value)
