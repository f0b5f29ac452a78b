"""Your own MuJoCo loop: a model with motors or position servos, and a squat."""

import argparse
import math
import xml.etree.ElementTree as ET

import mujoco
import numpy as np

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a robot from a URDF, such as g1")
parser.add_argument("--actuators", choices=["motor", "position"], default="position")
parser.add_argument("--seconds", type=float, default=4.0)
options = parser.parse_args()


def your_model(robot: poise.Robot, actuators: str) -> mujoco.MjModel:
    """Stands in for the file that you have: `mujoco.MjModel.from_xml_path("scene.xml")`."""
    urdf = ET.fromstring(robot.source.text)
    for link in urdf.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    spec = mujoco.MjSpec.from_string(ET.tostring(urdf, encoding="unicode"))
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.worldbody.first_body().add_freejoint()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    for name, sole in robot.soles.items():
        half, role = (sole.length / 2, sole.width / 2, 0.01), robot.roles[name]
        center = role.position + role.rotation @ (0.0, 0.0, half[2])
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, role.rotation.ravel())
        box = mujoco.mjtGeom.mjGEOM_BOX
        spec.body(role.link).add_geom(type=box, size=half, pos=center, quat=quaternion, mass=0)
    inertias = robot.model.armature[robot.base_dofs :]
    for name, limit, inertia in zip(robot.joint_names, robot.tau_max, inertias, strict=True):
        spec.joint(name).armature = inertia
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.forcerange = (-limit, limit)
        if actuators == "position":
            motor.set_to_position(kp=100.0, kv=2.0)
    return spec.compile()


robot = poise.load_robot(options.robot)
model = your_model(robot, options.actuators)
data = mujoco.MjData(model)

bridge = poise.sim.MujocoBridge(robot, model)
bridge.place(data)  # at home, on the ground; leave it out where your keyframe does that
controller = poise.WholeBodyController(robot)
com, start = controller.stack.task("com"), controller.dynamics.com.copy()
w, lowest = 0.5 * math.pi, start[2]
while data.time < options.seconds:
    c, s = math.cos(w * data.time), math.sin(w * data.time)
    com.set_target(
        start - [0.0, 0.0, 0.04 * (1.0 - c)],
        velocity=[0.0, 0.0, -0.04 * w * s],
        acceleration=[0.0, 0.0, -0.04 * w * w * c],
    )
    command = controller.step(bridge.state(data))
    bridge.apply(command, data)
    mujoco.mj_step(model, data)
    lowest = min(lowest, controller.dynamics.com[2])
print(controller.status())
print(f"down by {1e3 * (start[2] - lowest):.1f} mm, rejected {bridge.rejected}")
