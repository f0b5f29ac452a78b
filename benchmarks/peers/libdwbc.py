"""`write_libdwbc_handoff`: what `libdwbc_peer.cpp` is told, a URDF in its order and a run in words.

libdwbc takes for granted that the joints between base and soles come first, and knows a link only
where a joint that moves carries mass.
"""

import xml.etree.ElementTree as ET
from collections.abc import Generator, Iterable
from pathlib import Path

import numpy as np
import pinocchio as pin

from benchmarks.recording import Recording, bench_stack
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import ComTask, FrameTask, Stack, SurfaceContact


def write_libdwbc_handoff(urdf: Path, run: Path, recording: Recording, kind: str) -> None:
    """Renames a document's joints and writes the run as words, which need no reader of a format.

    A record a line: a key, a name, numbers. Links are those that move; points and rotations are in
    such a link's frame, targets in the world. What is written: the joints' links, limits, contacts,
    tasks by level, then for every tick q, v and, of each task that moves, position, velocity and
    acceleration of its target.
    """
    robot = recording.robot
    stack = bench_stack(robot, kind, recording.stance)
    stack.bind(robot)
    root = ET.fromstring(urdf.read_text(encoding="utf-8"))
    links = _order_joints(root, robot, [contact.frame for contact in stack.contacts])
    urdf.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
    lines = [
        *(_line("joint", links[name]) for name in robot.joint_names),
        _line("limits", "all", [robot.tau_max.max(), stack.joint_limit.acceleration_max]),
        *_contacts(stack, robot, links),
        *_tasks(stack, recording, links),
    ]
    moving = [
        recording.paths[task.name] for _, task in stack.tasks() if task.name in recording.paths
    ]
    for tick, state in enumerate(recording.states):
        aims = [(p.position[tick], p.velocity[tick], p.acceleration[tick]) for p in moving]
        lines.append(
            _line("tick", str(tick), np.concatenate((state.q, state.v, *map(np.ravel, aims))))
        )
    run.write_text("\n".join(lines) + "\nend run\n", encoding="utf-8")


def _order_joints(root: ET.Element, robot: Robot, soles: Iterable[str]) -> dict[str, str]:
    """Gives joints names by whose order those that carry soles come first."""
    model = robot.model
    legs = {
        model.names[joint]
        for sole in soles
        for joint in model.supports[model.frames[robot.frame_id(sole)].parentJoint]
    }
    ranks = sorted(robot.joint_names, key=lambda name: name not in legs)
    links: dict[str, str] = {}
    inner = {child.get("link") for child in root.iter("child")}
    base = next(link.get("name", "") for link in root.iter("link") if link.get("name") not in inner)
    for joint in root.findall("joint"):
        name, child = joint.get("name", ""), joint.find("child")
        if name in robot.joint_names and child is not None:
            links[name] = child.get("link", "")
            joint.set("name", f"{ranks.index(name):03d}_{name}")
    return {model.names[1]: base} | {name: links[name] for name in robot.joint_names}


def _contacts(stack: Stack, robot: Robot, links: dict[str, str]) -> Generator[str]:
    for contact in stack.contacts:
        if not isinstance(contact, SurfaceContact):
            continue
        link, placement = _mount(robot, contact.frame, links)
        if not np.allclose(placement.rotation, np.eye(3), atol=1e-9):
            raise ConfigurationError(
                "libdwbc's contacts have the frame of the link that carries them",
                got=f"{contact.frame}, which is turned against {link}",
                wanted="a sole that is not",
            )
        sole = robot.soles[contact.frame]
        half = [0.5 * sole.length - contact.margin, 0.5 * sole.width - contact.margin]
        numbers = [*placement.translation, *half, contact.friction]
        yield _line("contact", link, numbers)


def _tasks(stack: Stack, recording: Recording, links: dict[str, str]) -> Generator[str]:
    robot = recording.robot
    for index, level in enumerate(stack.levels):
        for task in level:
            gains = [float(index), task.kp[0], task.kd[0]]
            if isinstance(task, ComTask):
                yield _line("com", "CoM", gains)
            elif isinstance(task, FrameTask):
                link, placement = _mount(robot, task.frame, links)
                turned = recording.rotations[task.name] @ placement.rotation.T
                what = "pose" if task.dim == 6 else "orientation"
                yield _line(what, link, [*gains, *placement.translation, *turned.ravel()])


def _mount(robot: Robot, name: str, links: dict[str, str]) -> tuple[str, pin.SE3]:
    """The moving link that carries a frame, and the frame's placement in it."""
    frame = robot.model.frames[robot.frame_id(name)]
    return links[robot.model.names[frame.parentJoint]], frame.placement


def _line(key: str, name: str, numbers: Iterable[float] = ()) -> str:
    return " ".join((key, name, *(repr(float(number)) for number in numbers)))
