"""What a peer is told: the robot as a URDF without geometry, the run's states and targets."""

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.recording import Recording
from benchmarks.stances import bench_stack
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import ComTask, FrameTask, JointTask, SurfaceContact

FRAME_PREFIX = "role_"
"""Frames with a part to play get links of their own, under a name that no document uses."""

URDF, RUN = "robot.urdf", "run.npz"


def write_handoff(folder: Path, recording: Recording, kind: str) -> None:
    """Writes `robot.urdf` and `run.npz`.

    Args:
        folder: where to.
        recording: the run.
        kind: the stack that the peer should come near to.

    Raises:
        ConfigurationError: the robot does not come from a URDF.
    """
    robot = recording.robot
    (folder / URDF).write_text(_urdf(robot), encoding="utf-8")
    arrays: dict[str, Any] = {
        "q": np.array([s.q for s in recording.states]),
        "v": np.array([s.v for s in recording.states]),
        "time": np.array([s.time for s in recording.states]),
        "q_home": robot.q_home,
        "tau_max": robot.tau_max,
        "v_max": robot.v_max,
        "armature": np.array(robot.model.armature)[robot.base_dofs :],
    }
    for name, path in recording.paths.items():
        points = np.stack((path.position, path.velocity, path.acceleration))
        arrays[f"path {name}"] = points
    for name, rotation in recording.rotations.items():
        arrays[f"rotation {name}"] = rotation
    facts = json.dumps(_facts(recording, kind))
    np.savez(folder / RUN, facts=np.array(facts), **arrays)


def _facts(recording: Recording, kind: str) -> dict[str, Any]:
    """Joint order, contacts and tasks, with the gains of Poise's own."""
    robot = recording.robot
    stack = bench_stack(robot, kind, recording.stance)
    stack.bind(robot)
    tasks: list[dict[str, Any]] = []
    for _, task in stack.tasks():
        fact = {"name": task.name, "kp": float(task.kp[0]), "kd": float(task.kd[0])}
        if isinstance(task, FrameTask):
            part = "pose" if task.dim == 6 else "orientation"
            tasks.append({**fact, "kind": part, "frame": FRAME_PREFIX + task.frame})
        elif isinstance(task, ComTask):
            tasks.append({**fact, "kind": "com"})
        elif isinstance(task, JointTask):
            tasks.append({**fact, "kind": "posture"})
    contacts = [c for c in stack.contacts if isinstance(c, SurfaceContact)]
    return {
        "joints": robot.joint_names,
        "mass": robot.mass,
        "acceleration_max": stack.joint_limit.acceleration_max,
        "contacts": [
            {
                "frame": FRAME_PREFIX + c.frame,
                "friction": c.friction,
                "damping": c.damping,
                "length": robot.soles[c.frame].length - 2.0 * c.margin,
                "width": robot.soles[c.frame].width - 2.0 * c.margin,
            }
            for c in contacts
        ],
        "tasks": tasks,
    }


def _urdf(robot: Robot) -> str:
    """The robot's document without geometry, locked joints welded, with links for its roles."""
    if robot.source.kind != "urdf":
        raise ConfigurationError(
            f"peers read URDF only, and robot {robot.name!r} is not one",
            got=robot.source.kind,
            wanted="a robot from a URDF",
        )
    root = ET.fromstring(robot.source.text)
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    for tag in ("transmission", "gazebo", "mujoco"):
        for element in root.findall(tag):
            root.remove(element)
    for joint in root.findall("joint"):
        if joint.get("name") in robot.source.locked_joints:
            joint.set("type", "fixed")
    for role in robot.roles.values():
        name = FRAME_PREFIX + role.name
        ET.SubElement(root, "link", name=name)
        joint = ET.SubElement(root, "joint", name=f"{name}_mount", type="fixed")
        ET.SubElement(joint, "parent", link=role.link)
        ET.SubElement(joint, "child", link=name)
        rpy = Rotation.from_matrix(role.rotation).as_euler("xyz")
        ET.SubElement(joint, "origin", xyz=_words(role.position), rpy=_words(rpy))
    return ET.tostring(root, encoding="unicode")


def _words(vector: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in vector)
