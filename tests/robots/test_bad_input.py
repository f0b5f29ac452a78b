import inspect
import re

import numpy as np
import pinocchio as pin
import pytest
import yaml

from poise.errors import ConfigurationError, PoiseError, RobotError, UnknownNameError
from poise.robots import Robot, description_template, load_robot

PLAIN = r"; (got|choices|wanted)"
FOOT = '<link name="left_foot">'


def spoil(facts, path, value):
    """Set the value at a dotted path; None takes the key away."""
    *parents, last = path.split("/")
    place = facts
    for key in parents:
        place = place.setdefault(key, {})
    if value is None:
        del place[last]
    else:
        place[last] = value
    return facts


@pytest.fixture
def good(load, urdf, facts):
    return load(urdf, facts)


SPOILT = {
    "base missing": ("base", None, "lacks the key 'base'"),
    "base unknown": ("base", "flying", "unknown base.*'flying'.*floating, fixed"),
    "pelvis missing": ("pelvis", None, r"facts missing.*\['pelvis'\]"),
    "unknown key": ("sole", {}, "unknown key.*'sole'.*choices: soles"),
    "sole without length": ("soles/left_sole/length", None, "lacks the key 'length'"),
    "zero width": ("soles/left_sole/width", 0, "width is out of range"),
    "length with a unit": ("soles/left_sole/length", "0.2 m", "wrong kind.*'0.2 m'.*number"),
    "two coordinates": ("soles/left_sole/position", [0, 0], "wrong kind.*3 numbers"),
    "sole not on a link": ("soles/left_sole/link", "left_toe", "left_sole.*'left_toe'.*left_foot"),
    "hand named as a sole": ("hands/left_sole", "trunk", "stands twice.*'left_sole'"),
    "home of no joint": ("home/knee", 0.1, "home names no joint.*'knee'.*left_hip"),
    "home outside limits": ("home/left_ankle", 2.0, "'left_ankle'.*outside.*2.0.*-1 to 1"),
    "pattern that is none": ("home/left_(", 0.1, "cannot be read.*'left_\\('"),
    "soles not flat": ("home/left_ankle", 0.5, "does not lie in the plane|left_sole|right_sole"),
    "negative torque limit": ("limits/torque/.*", -5.0, "out of range.*-5.0"),
    "crossed limits": ("limits/position/left_hip", [1.0, -1.0], "cross.*1.0, -1.0"),
    "negative armature": ("armature", -0.1, r"armature.* is out of range; got -0.1"),
    "locked joint that is none": ("locked", ["finger"], "locked names no joint.*'finger'"),
}


@pytest.mark.parametrize("case", SPOILT)
def test_a_wrong_description_is_refused_with_what_would_be_right(load, urdf, facts, case):
    path, value, message = SPOILT[case]
    with pytest.raises(PoiseError, match=message) as error:
        load(urdf, spoil(facts, path, value))
    assert re.search(PLAIN, str(error.value))
    assert "\n" not in str(error.value)


def turned(*rpy):
    return {"rpy": list(rpy)}


def on(link):
    return {"link": link}


MIXED_UP = {
    "soles swapped": (
        {"left_sole": on("right_foot"), "right_sole": on("left_foot")},
        "'left_sole' on 'right_foot', 0.2 m to the right of 'right_sole' on 'left_foot'.*wanted",
    ),
    "soles back to front": (
        {"left_sole": turned(0, 0, 3.14159), "right_sole": turned(0, 0, 3.14159)},
        "'left_sole' and 'right_sole' .*wrong sides.*x of the soles towards the toes",
    ),
    "one sole back to front": (
        {"left_sole": turned(0, 0, 3.14159)},
        "'left_sole' and 'right_sole' .*against each other.*180 degrees.*rpy",
    ),
    "soles upside down": (
        {"left_sole": turned(3.14159, 0, 0), "right_sole": turned(3.14159, 0, 0)},
        r"upside down on its soles \(left_sole, right_sole\).*pelvis -0.\d+ m above.*z points up",
    ),
    "soles on one link": (
        {"right_sole": on("left_foot")},
        "'left_sole' and 'right_sole' .*on one link; got 'left_foot'; wanted .*two legs",
    ),
}


@pytest.mark.parametrize("case", MIXED_UP)
def test_soles_that_are_mixed_up_are_refused_by_name(load, urdf, facts, case):
    changes, message = MIXED_UP[case]
    for sole, change in changes.items():
        facts["soles"][sole].update(change)
    with pytest.raises(RobotError, match=message):
        load(urdf, facts)


TOES = """
  <joint name="left_toe" type="revolute"><origin xyz="0.05 0 0"/><parent link="left_foot"/>
    <child link="left_toes"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="30" velocity="8"/></joint>
  <link name="left_toes"><inertial><mass value="0.1"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>"""


def test_two_soles_on_one_leg_are_refused_by_name(load, urdf, facts):
    with_toes = urdf.replace("</robot>", f"{TOES}</robot>")
    assert "left_toe" in load(with_toes, facts).joint_names
    facts["soles"]["right_sole"]["link"] = "left_toes"
    with pytest.raises(
        RobotError,
        match="'right_sole' .*on the leg of 'left_sole', further down;"
        " got 'left_foot and left_toes, below left_hip, left_ankle'; wanted .*two legs",
    ):
        load(with_toes, facts)


def test_the_left_sole_is_listed_first_whatever_its_name(load, urdf, facts):
    left, right = facts["soles"].values()
    facts["soles"] = {"right_sole": right, "left_sole": left}
    with pytest.raises(RobotError, match="'right_sole' is listed first.*wanted .*left sole listed"):
        load(urdf, facts)
    facts["soles"] = {"a": left, "b": right}
    assert list(load(urdf, facts).soles) == ["a", "b"]
    facts["soles"] = {"right_sole": left, "left_sole": right}
    with pytest.raises(RobotError, match="their names say left and right"):
        load(urdf, facts)


ARM = """
  <joint name="{side}_{name}" type="revolute"><origin xyz="0 {y} {z}"/><parent link="{parent}"/>
    <child link="{side}_{name}_arm"/><axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" effort="30" velocity="8"/></joint>
  <link name="{side}_{name}_arm"><inertial><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>"""


def with_arms(urdf):
    """Two arms of three joints about x, shoulders 0.3 m apart, that hang by 0.5 m."""
    arms = "".join(
        ARM.format(side=side, name=name, y=0.15 * sign if z > 0.0 else 0.0, z=z, parent=parent)
        for side, sign in (("left", 1), ("right", -1))
        for name, z, parent in (
            ("shoulder", 0.4, "trunk"),
            ("elbow", -0.3, f"{side}_shoulder_arm"),
            ("wrist", -0.2, f"{side}_elbow_arm"),
        )
    )
    return urdf.replace("</robot>", f"{arms}</robot>")


def test_hands_are_on_the_side_that_their_names_say(load, urdf, facts):
    facts["hands"] = {"left_hand": "right_wrist_arm", "right_hand": "left_wrist_arm"}
    message = "'left_hand' on 'right_wrist_arm', 0.3 m to the right of 'right_hand'"
    with pytest.raises(RobotError, match=message):
        load(with_arms(urdf), facts)
    facts["hands"] = {"left_hand": "left_wrist_arm"}
    assert load(with_arms(urdf), facts).hands == ("left_hand",)


def test_limbs_may_cross_and_legs_may_be_locked(load, urdf, facts):
    facts["hands"] = {"left_hand": "left_wrist_arm", "right_hand": "right_wrist_arm"}
    facts["home"] |= {"left_shoulder": -0.5, "right_shoulder": 0.5}
    robot = load(with_arms(urdf), facts)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_home)
    left, right = (data.oMf[robot.frame_id(hand)].translation[1] for hand in robot.hands)
    assert left < right - 0.1
    for key in ("home", "hands"):
        del facts[key]
    assert load(urdf, facts | {"locked": [".*_hip", ".*_ankle"]}).nj == 0


EDITS = {
    "no mass": (r'<mass value="\d+"/>', '<mass value="0"/>', "without mass.*left_hip"),
    "no limits at all": (r"<limit [^>]*/>", "", "limits.position.*left_hip"),
    "a mass without inertia": (
        r"(?s)(<mass value=.2./>)\s*<inertia [^>]*/>",
        r"\1",
        "^tiny.urdf: the <inertial> of link 'left_shin' has no <inertia>.*got '<origin>, <mass>'",
    ),
    "a loop": (r'<child link="left_shin"/>', '<child link="trunk"/>', "not a tree.*trunk"),
    "a link with two parents": ('link="right_foot"', 'link="left_foot"', "single root.*right_foot"),
    "an inertia at two coordinates": (
        '<origin xyz="0 0 -0.2"/>',
        '<origin xyz="0 0"/>',
        "xyz in <origin> of link 'left_shin'.*'0 0'",
    ),
    "two lower limits": ('lower="-1"', 'lower="-1 2"', "lower in <limit>.*left_ankle.*'-1 2'"),
}


@pytest.mark.parametrize("case", EDITS)
def test_a_document_with_something_missing_is_refused_by_name(load, urdf, facts, case, capfd):
    pattern, replacement, message = EDITS[case]
    text, count = re.subn(pattern, replacement, urdf)
    assert count
    with pytest.raises(PoiseError, match=message) as error:
        load(text, facts)
    assert "\n" not in str(error.value)
    assert capfd.readouterr().err == ""


SHAPES = {
    "a box of two sizes": ('<box size="1 2"/>', "size in <box> of link 'left_foot'.*'1 2'"),
    "a ball of letters": ('<sphere radius="big"/>', "radius in <sphere>.*'big'.*a finite number"),
    "a mesh scaled by one": ('<mesh filename="toe.stl" scale="2"/>', "scale in <mesh>.*3 finite"),
}


@pytest.mark.parametrize("case", SHAPES)
def test_a_shape_without_the_numbers_it_needs_is_refused_by_name(load, urdf, facts, case):
    solid, message = SHAPES[case]
    shape = f"{FOOT}<visual><geometry>{solid}</geometry></visual>"
    with pytest.raises(RobotError, match=message):
        load(urdf.replace(FOOT, shape), facts)


def test_what_other_programs_put_into_a_file_is_no_part_of_the_robot(load, urdf, facts):
    nested = "<inertial><mass value='-1'/></inertial>"
    mesh = '<visual><geometry><mesh filename="model://toe.dae"/></geometry></visual>'
    foreign = f"<gazebo><plugin><link name='extra'>{nested}{mesh}</link></plugin></gazebo>"
    robot = load(urdf.replace("</robot>", f"{foreign}</robot>"), facts)
    assert robot.mass == pytest.approx(16.0)
    assert "extra" not in robot.source.text


def with_mesh(filename):
    return f'{FOOT}<visual><geometry><mesh filename="{filename}"/></geometry></visual>'


GAPS = {
    "no torque limits": (r'effort="\d+"', 'effort="0"', "torque limits of .* N m.*left_hip"),
    "no velocity limits": (r'velocity="\d+"', "", "velocity limits of 10 rad/s.*left_hip"),
    "a mesh that is missing": (FOOT, with_mesh("package://feet/toe.stl"), "pictures.*feet/toe.stl"),
}


@pytest.mark.parametrize("case", GAPS)
def test_what_a_controller_can_do_without_is_told_in_one_warning(load, urdf, facts, case):
    pattern, replacement, message = GAPS[case]
    text, count = re.subn(pattern, replacement, urdf)
    assert count
    with pytest.warns(UserWarning, match=f"^tiny.urdf: .*{message}") as said:
        robot = load(text, facts)
    assert len(said) == 1
    assert (robot.tau_max > 0.0).all()
    assert (robot.v_max > 0.0).all()
    assert "<mesh" not in robot.source.text


def test_what_is_assumed_of_slides_and_hinges_is_told_in_their_units(load, urdf):
    text = urdf.replace('"left_hip" type="revolute"', '"left_hip" type="prismatic"')
    text = re.sub(r' effort="\d+" velocity="\d+"', "", text)
    with pytest.warns(UserWarning, match="assumed") as said:
        robot = load(text, {"base": "fixed"})
    (warning,) = (str(w.message) for w in said)
    # A slide bears three times the weight of its 3 kg, as any joint that carries no robot.
    assert robot.v_max.tolist() == [1.0, 10.0, 10.0, 10.0]
    assert robot.tau_max[0] == pytest.approx(3.0 * 3.0 * 9.81)
    hinges = "left_ankle, right_hip, right_ankle"
    assert f"velocity limits of 10 rad/s for {hinges} and 1 m/s for left_hip" in warning
    spread = f"{robot.tau_max[1:].min():.3g} to {robot.tau_max[1:].max():.3g} N m for {hinges}"
    assert f"torque limits of {spread} and 88.3 N for left_hip, from the weights" in warning


@pytest.mark.parametrize("content", [b"", b"version https://git-lfs.github.com/spec/v1\noid 1"])
def test_a_mesh_with_nothing_in_it_is_refused(tmp_path, load, urdf, facts, content):
    (tmp_path / "toe.stl").write_bytes(content)
    with pytest.raises(RobotError, match=r"toe\.stl.*tiny.*bytes in .*toe\.stl.*git lfs pull"):
        load(urdf.replace(FOOT, with_mesh("toe.stl")), facts)


def test_without_a_description_the_message_says_how_to_get_one(tmp_path, urdf):
    path = tmp_path / "tiny.urdf"
    path.write_text(urdf)
    with pytest.raises(RobotError, match=r"no feet.*tiny\.urdf.*description_template.*left_ankle"):
        load_robot(path)


def test_the_template_names_links_and_joints_and_loads_once_filled_in(tmp_path, urdf):
    path = tmp_path / "tiny.urdf"
    path.write_text(urdf)
    template = description_template(path)
    assert "left_foot" in template
    assert "right_ankle" in template
    for name in ("left", "right"):
        template = template.replace(
            f"{name}_sole: {{link: LINK", f"{name}_sole: {{link: {name}_foot"
        )
    (tmp_path / "tiny.poise.yaml").write_text(template.replace("LINK", "trunk"))
    robot = load_robot(path)
    assert robot.name == "tiny"
    assert set(robot.soles) == {"left_sole", "right_sole"}
    assert robot.hands == ("left_hand",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("base: [", "not valid YAML"),
        ("- base", "wrong kind"),
        ("base: floating\nbase: fixed", "'base' stands twice"),
        ("1: 2", "unknown key; got 1; choices: base"),
        ("", "wrong kind"),
    ],
)
def test_a_description_file_that_is_none_is_refused(tmp_path, urdf, text, message):
    path = tmp_path / "tiny.urdf"
    path.write_text(urdf)
    (tmp_path / "tiny.poise.yaml").write_text(text)
    with pytest.raises(RobotError, match=message) as error:
        load_robot(path)
    assert "\n" not in str(error.value)


def test_unknown_frames_and_joints_list_those_there_are(good):
    with pytest.raises(UnknownNameError, match=r"unknown frame.*'left_foott'.*choices: left_foot"):
        good.frame_id("left_foott")
    with pytest.raises(UnknownNameError, match=r"unknown joint.*'left_hips'.*choices: left_hip"):
        good.joint_index("left_hips")


@pytest.mark.parametrize("name", [None, 3])
def test_what_is_no_name_is_no_frame(good, name):
    """As a user calls it: the type check of the tests would answer first."""
    with pytest.raises(ConfigurationError, match=f"name of a frame.*got {name}; wanted str"):
        inspect.unwrap(Robot.frame_id)(good, name)


@pytest.mark.parametrize("offset", ["abc", [0.0, 1.0], [0.0, 0.0, float("nan")], 0.0])
def test_a_load_at_no_place_is_refused(good, offset):
    with pytest.raises(ConfigurationError, match=r"offset of the load \[m\].*3 finite numbers"):
        good.carrying("left_sole", 1.0, offset)


@pytest.mark.parametrize("spelling", ["urdf", "mjcf"])
def test_a_name_that_a_link_and_a_joint_share_means_the_link(load, urdf, facts, spelling):
    if spelling == "urdf":
        text, suffix = urdf.replace("left_ankle", "left_foot"), ".urdf"
    else:
        text, suffix = BOTH, ".xml"
        facts = {"base": "fixed", "limits": {"velocity": {".*": 1.0}, "torque": {".*": 1.0}}}
    robot = load(text, facts | {"home": {}}, suffix)
    frame = robot.model.frames[robot.frame_id("left_foot")]
    assert frame.type == pin.FrameType.BODY
    # A foot of the URDF is where its joint is, one of the MJCF beside it.
    offset = (0.0, 0.0, 0.0) if spelling == "urdf" else (0.0, 0.0, 0.1)
    np.testing.assert_allclose(frame.placement.translation, offset)
    names = robot.frame_names()
    assert len(set(names)) == len(names)
    assert "left_foot" in names


BOTH = """<mujoco><worldbody><body name="trunk">
  <body name="left_foot"><joint name="left_foot" range="-1 1" pos="0 0 -0.1"/>
  <geom size="0.1" mass="1"/></body></body></worldbody></mujoco>"""


def test_random_descriptions_give_a_poise_error_or_a_robot(load, urdf, facts):
    """100 descriptions with one value replaced at random; seed 7."""
    rng = np.random.default_rng(7)
    junk = [None, -1, 0, 1e9, float("nan"), "x", "", [], [1, 2, 3], {}, {"a": 1}, True, ".*", "("]
    for trial in range(100):
        spoilt = yaml.safe_load(yaml.safe_dump(facts))
        place = spoilt
        while True:
            key = list(place)[rng.integers(len(place))]
            if not isinstance(place[key], dict) or not place[key] or rng.random() < 0.3:
                break
            place = place[key]
        place[key] = junk[rng.integers(len(junk))]
        try:
            load(urdf, spoilt)
        except PoiseError:
            continue
        except Exception as error:
            raise AssertionError(f"trial {trial}: {spoilt}") from error
