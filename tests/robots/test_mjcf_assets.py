"""Options of MJCF's compiler and meshes, against what MuJoCo makes of the same file."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from poise.errors import RobotError  # noqa: E402
from poise.robots import load_robot  # noqa: E402
from poise.sim import Plant  # noqa: E402

MODEL = """<mujoco>
  {compiler}
  <default><default class="picture"><geom type="mesh" {picture}/></default></default>
  <asset>{assets}</asset>
  <worldbody><body name="trunk">
    <body name="arm" pos="0 0 0.1"><joint name="arm" range="-1 1"/>{inertial}
      <geom type="box" size="0.1 0.05 0.02" {mass}/>{shape}</body>
  </body></worldbody>
</mujoco>"""
INERTIAL = '<inertial pos="0 0 0" mass="4" diaginertia="0.03 0.02 0.02"/>'
FACTS = {
    "base": "fixed",
    "limits": {"velocity": {".*": 1.0}, "torque": {".*": 1.0}},
    "armature": 0.01,
}
CORNERS = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]], np.float32)


def tetrahedron():
    """A binary STL."""
    faces = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
    return b"\0" * 80 + (4).to_bytes(4, "little") + b"".join(
        bytes(12) + CORNERS[list(face)].tobytes() + bytes(2) for face in faces
    )  # fmt: skip


@pytest.fixture
def write(tmp_path):
    """Write a model, and its mesh where it is said to be."""

    def write_model(at=None, **parts):
        if at is not None:
            (tmp_path / at).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / at).write_bytes(tetrahedron())
        path = tmp_path / "arm.xml"
        none = dict.fromkeys(("compiler", "picture", "assets", "inertial", "shape"), "")
        path.write_text(MODEL.format(**none | {"mass": 'mass="1"'} | parts))
        return path

    return write_model


def compare(path):
    """Poise's two models beside the one that MuJoCo makes of the file by itself."""
    robot, theirs = load_robot(path, FACTS), mujoco.MjModel.from_xml_path(str(path))
    arm, plant = theirs.body("arm"), Plant(robot).model.body("arm")
    assert robot.mass == pytest.approx(arm.mass[0], rel=1e-12)
    np.testing.assert_allclose(plant.mass, arm.mass, rtol=1e-12)
    np.testing.assert_allclose(plant.inertia, arm.inertia, rtol=1e-12)
    moments = np.linalg.eigvalsh(robot.model.inertias[1].inertia)
    np.testing.assert_allclose(moments, np.sort(arm.inertia), rtol=1e-9)
    return robot


COMPILERS = {
    "one": ('<compiler meshdir="meshes"/>', "toe.stl", "meshes/toe.stl"),
    "another after it": (
        '<compiler meshdir="meshes"/><compiler angle="radian"/>', "toe.stl", "meshes/toe.stl",
    ),
    "one that wins": (
        '<compiler meshdir="meshes"/><compiler assetdir="all"/>', "toe.stl", "all/toe.stl",
    ),
    "paths stripped": (
        '<compiler meshdir="meshes" strippath="true"/>', "far/toe.stl", "meshes/toe.stl",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", COMPILERS)
def test_meshes_are_looked_for_where_mujoco_does(write, case):
    compiler, name, at = COMPILERS[case]
    path = write(
        at,
        compiler=compiler,
        assets=f'<mesh name="toe" file="{name}"/>',
        shape='<geom type="mesh" mesh="toe"/>',
    )
    # A thousand times a tetrahedron's volume, and the box.
    assert compare(path).mass == pytest.approx(1.0 + 1000.0 * 0.1 * 0.2 * 0.3 / 6.0)


@pytest.mark.parametrize(
    ("options", "inertial"),
    [
        ('boundmass="5"', INERTIAL),
        ('boundinertia="0.5"', INERTIAL),
        ('boundmass="5" boundinertia="0.5"', ""),
        ('balanceinertia="true"', INERTIAL.replace("0.03 0.02 0.02", "0.9 0.02 0.02")),
    ],
)
def test_options_of_the_compiler_mean_what_they_mean_to_mujoco(write, options, inertial):
    compare(write(compiler=f"<compiler {options}/>", inertial=inertial))


TOE = {"assets": '<mesh name="toe" file="toe.stl"/>'}
PICTURE = TOE | {"shape": '<geom class="picture" mesh="toe"/>'}
SPARED = {
    "no mass": TOE | {"shape": '<geom type="mesh" mesh="toe" mass="0"/>'},
    "a group that has no mass": PICTURE
    | {"picture": 'group="4"', "compiler": '<compiler inertiagrouprange="0 3"/>'},
    "a mass of the body's own": PICTURE | {"inertial": INERTIAL},
    "a mass that no shape gives": PICTURE
    | {"inertial": INERTIAL, "compiler": '<compiler inertiafromgeom="false"/>'},
}


@pytest.mark.parametrize("case", SPARED)
def test_a_picture_that_weighs_nothing_may_be_missing(write, case):
    whole = compare(write("toe.stl", **SPARED[case]))
    path = write(**SPARED[case])
    (path.parent / "toe.stl").unlink()
    with pytest.warns(UserWarning, match="missing in pictures: toe.stl"):
        robot = load_robot(path, FACTS)
    assert robot.mass == pytest.approx(whole.mass, rel=1e-12)


WEIGHING = {
    "a mass": PICTURE | {"picture": 'mass="3" density="0"'},
    "a mass in a frame": TOE
    | {"shape": '<frame><geom class="picture" mesh="toe" mass="3"/></frame>'},
    "a mass in place of the body's own": PICTURE
    | {"inertial": INERTIAL, "compiler": '<compiler inertiafromgeom="true"/>'},
}


@pytest.mark.parametrize("case", WEIGHING)
def test_a_mesh_that_a_mass_comes_from_may_not(write, case):
    assert compare(write("toe.stl", **WEIGHING[case])).mass > 1.5
    path = write(**WEIGHING[case])
    (path.parent / "toe.stl").unlink()
    with pytest.raises(RobotError, match=r"mass.*'arm'.*'toe\.stl'.*<inertial>"):
        load_robot(path, FACTS)
