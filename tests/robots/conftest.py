import copy

import pytest

from poise.robots import load_robot

BIPED = """<robot name="tiny">
  <link name="trunk"><inertial><origin xyz="0 0 0.2"/><mass value="10"/>
    <inertia ixx="0.3" ixy="0" ixz="0" iyy="0.3" iyz="0" izz="0.1"/></inertial></link>
  {legs}
</robot>"""

LEG = """
  <joint name="{side}_hip" type="revolute"><origin xyz="0 {y} 0"/><parent link="trunk"/>
    <child link="{side}_shin"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="50" velocity="8"/></joint>
  <link name="{side}_shin"><inertial><origin xyz="0 0 -0.2"/><mass value="2"/>
    <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.01"/></inertial></link>
  <joint name="{side}_ankle" type="revolute"><origin xyz="0 0 -0.4"/><parent link="{side}_shin"/>
    <child link="{side}_foot"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="30" velocity="8"/></joint>
  <link name="{side}_foot"><inertial><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>"""

FACTS = {
    "base": "floating",
    "pelvis": "trunk",
    "torso": {"link": "trunk", "position": [0.0, 0.0, 0.3]},
    "soles": {
        f"{side}_sole": {
            "link": f"{side}_foot",
            "position": [0.0, 0.0, -0.05],
            "length": 0.2,
            "width": 0.1,
        }
        for side in ("left", "right")
    },
    "home": {".*_hip": -0.3, ".*_ankle": 0.3},
    "armature": 0.01,
}


@pytest.fixture
def urdf():
    """A biped of four joints as URDF text."""
    legs = "".join(LEG.format(side=s, y=y) for s, y in (("left", 0.1), ("right", -0.1)))
    return BIPED.format(legs=legs)


@pytest.fixture
def facts():
    """A description of that biped that is right, for the test to spoil."""
    return copy.deepcopy(FACTS)


@pytest.fixture
def load(tmp_path):
    """Load a document given as text with a description given as a mapping."""

    def load_text(text, description, suffix=".urdf"):
        path = tmp_path / f"tiny{suffix}"
        path.write_text(text)
        return load_robot(path, description)

    return load_text


@pytest.fixture
def robot(request, get_robot):
    """The robot of the catalog that the test's parameter names."""
    return get_robot(request.param)
