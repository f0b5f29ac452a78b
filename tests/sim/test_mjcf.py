import dataclasses

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from poise.robots import FrameRole, ModelSource, Robot, Sole
from poise.sim import Plant

DOCUMENT = """
<mujoco model="hopper">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 1"/>
    <body name="trunk" pos="0 0 1">
      <freejoint name="root"/>
      <inertial pos="0 0 0.1" mass="8" diaginertia="0.1 0.12 0.08"/>
      <geom type="box" size="0.1 0.1 0.15"/>
      <body name="leg" pos="0 0 -0.2">
        <joint name="hip" axis="0 1 0" range="-1 1" damping="3" frictionloss="2" armature="7"/>
        <inertial pos="0 0 -0.2" mass="2" diaginertia="0.02 0.02 0.004"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.35" size="0.04"/>
        <body name="foot" pos="0 0 -0.4">
          <joint name="ankle" axis="0 1 0" range="-1 1"/>
          <inertial pos="0 0 -0.02" mass="1" diaginertia="0.002 0.003 0.003"/>
          <geom type="box" size="0.15 0.1 0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="hip"/></actuator>
  <keyframe><key qpos="0 0 1 1 0 0 0 0 0"/></keyframe>
</mujoco>
"""


@pytest.fixture(scope="module")
def hopper(tmp_path_factory):
    path = tmp_path_factory.mktemp("hopper") / "hopper.xml"
    path.write_text(DOCUMENT)
    model = pin.buildModelFromMJCF(str(path))
    model.armature = np.r_[np.zeros(6), 0.02, 0.01]

    def role(name, link, z):
        return FrameRole(name=name, link=link, position=np.array([0.0, 0.0, z]), rotation=np.eye(3))

    roles = {r.name: r for r in (role("sole", "foot", -0.05), role("pelvis", "trunk", 0.0))}
    for r in roles.values():
        parent = model.getFrameId(r.link)
        frame = model.frames[parent]
        placement = frame.placement * pin.SE3(r.rotation, r.position)
        model.addFrame(
            pin.Frame(r.name, frame.parentJoint, parent, placement, pin.FrameType.OP_FRAME)
        )
    q_home = np.array([0.0, 0.0, 0.65, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    return Robot(
        name="hopper",
        model=model,
        floating_base=True,
        joint_names=("hip", "ankle"),
        q_min=-np.ones(2),
        q_max=np.ones(2),
        v_max=10.0 * np.ones(2),
        tau_max=50.0 * np.ones(2),
        soles={"sole": Sole(name="sole", length=0.2, width=0.1)},
        hands=(),
        pelvis="pelvis",
        torso="pelvis",
        roles=roles,
        q_home=q_home,
        licence="Apache-2.0",
        source=ModelSource(kind="mjcf", text=DOCUMENT, directory=path.parent),
    )


def test_an_mjcf_document_moves_as_pinocchio_says(hopper):
    plant = Plant(hopper)
    rng = np.random.default_rng(0)
    q = pin.integrate(hopper.model, hopper.q_home, rng.uniform(-0.5, 0.5, hopper.nv))
    q[2] += 3.0
    v = np.r_[np.zeros(6), 0.3, -0.2]
    plant.data.qpos[:], plant.data.qvel[:] = plant.map.qpos(q), plant.map.qvel(q, v)
    plant.data.ctrl[:] = (5.0, -3.0)
    mujoco.mj_forward(plant.model, plant.data)
    data = hopper.model.createData()
    expected = pin.aba(hopper.model, data, q, v, np.r_[np.zeros(6), 5.0, -3.0])
    qacc = plant.data.qacc.copy()
    qacc[:3] = pin.Quaternion(q[3:7]).toRotationMatrix().T @ qacc[:3]
    np.testing.assert_allclose(qacc, expected, rtol=0, atol=1e-8)


def test_an_mjcf_document_touches_the_floor_with_its_sole_alone(hopper):
    plant = Plant(hopper)
    for _ in range(20):
        plant.step(None)
    assert plant.mass == pytest.approx(11.0)
    touching = {plant.model.geom(int(g)).name for c in plant.data.contact for g in c.geom}
    assert touching == {"floor", "sole_contact"}
    assert plant.model.nu == 2
    assert plant.model.nkey == 0


def test_a_document_that_asks_for_a_sparse_constraint_jacobian_gets_a_dense_one(hopper):
    text = DOCUMENT.replace("<worldbody>", '<option jacobian="sparse"/><worldbody>')
    source = dataclasses.replace(hopper.source, text=text)
    assert not mujoco.mj_isSparse(Plant(dataclasses.replace(hopper, source=source)).model)
