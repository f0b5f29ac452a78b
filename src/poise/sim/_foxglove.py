"""`RobotTopics`: the robot's motion as Foxglove draws it, in messages serialised as by ROS 1."""

import json
import math
import re
import struct
from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.robots import Robot
from poise.sim._mapping import StateMap
from poise.sim._record import Signal, Table, time_of

NOTES, MESSAGES = "notes", "messages"  # content of topics that are no rows of signals

# Kinds of number that ROS 1 has
_ROS = {"float32", "float64", "bool", *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64))}


class Topic(NamedTuple):
    """A topic of a log and the type of its messages."""

    name: str  # of the topic
    schema: str = ""  # name of the message type, "" for none
    text: str = ""  # definition of the type
    holds: str = ""  # content of the record: `NOTES`, `MESSAGES`, signals in JSON
    language: str = "ros1msg"  # of the definition
    encoding: str = "ros1"  # of the messages


def events_topic(topic: str, kind: str) -> Topic:
    """Topic of the log for notes or messages of a record."""
    if kind == MESSAGES:
        return Topic(f"/{topic}", holds=kind, encoding=MESSAGES)
    return Topic(f"/{topic}", "poise/Text", "float64 time  # [s]\nstring value", kind)


def rows_topic(name: str, signals: tuple[Signal, ...]) -> Topic:
    """Topic of the rows of a `Table`, whose fields have names that ROS 1 takes."""
    lines = {"order": "int64 order", "time": "float64 time  # [s]"}
    for signal in signals:
        field, count = re.sub(r"\W", "_", signal.name), math.prod(signal.shape)
        kind = signal.dtype.name
        if kind not in _ROS:  # shown as their bytes
            kind, count = "uint8", count * signal.dtype.itemsize
        size = f"[{count}]" if signal.shape or kind != signal.dtype.name else ""
        while field in lines:
            field += "_"
        unit = f"  # [{signal.unit}]" if signal.unit else ""
        lines[field] = f"{kind}{size} {field}{unit}"
    holds = json.dumps([(s.name, s.unit, s.dtype.str, s.shape) for s in signals])
    return Topic(f"/{name}", f"poise/{name}", "\n".join(lines.values()), holds)


_JOINTS = Topic(
    "/joints",
    "poise/Joints",
    """float64 time  # [s]
string[] name
float64[] position  # [rad]
float64[] velocity  # [rad/s]
float64[] torque  # [N m]""",
)
_MSG = f"\n{80 * '='}\nMSG: "
_TRANSFORMS = Topic(
    "/tf",
    "foxglove_msgs/FrameTransforms",
    "foxglove_msgs/FrameTransform[] transforms"
    f"{_MSG}foxglove_msgs/FrameTransform\ntime timestamp\nstring parent_frame_id\n"
    "string child_frame_id\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation"
    f"{_MSG}geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"
    f"{_MSG}geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w",
)
_LIST = {"type": "array", "items": {"type": "object"}}
_SCENE = Topic(
    "/scene",
    "foxglove.SceneUpdate",
    json.dumps({"type": "object", "properties": {"deletions": _LIST, "entities": _LIST}}),
    language="jsonschema",
    encoding="json",
)

_DRAWN = {"q", "v", "torque"}  # signals of the rows that are drawn
_SLACK = 5e-10  # of a rate [s]: one that the control period divides stays exact


class Pace:
    """Picks instants that are far enough apart."""

    def __init__(self, dt: float) -> None:
        self._dt, self._next = dt, -math.inf

    def is_due(self, time: float) -> bool:
        """Pick a time [s] or not; call once for each."""
        due = time >= self._next - _SLACK
        if due:
            self._next = time + self._dt
        return due


def ros_text(text: str) -> bytes:
    """A text as ROS 1 has it."""
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded


class RobotTopics:
    """Makes Foxglove's messages of a robot's motion, with data of its own: safe in a thread."""

    def __init__(self, robot: Robot, model: mujoco.MjModel, dt: float) -> None:
        self._robot, self._model, self._data = robot, model, mujoco.MjData(model)
        self._map, self._pace, self._begun = StateMap(robot, model), Pace(dt), False
        named = [(i, model.body(i).name) for i in range(1, model.nbody)]
        self._bodies = [(i, name) for i, name in named if name]
        self._frames = [ros_text("world") + ros_text(name) for _, name in self._bodies]
        self._joint_count = struct.pack("<I", robot.nj)
        self._joint_names = b"".join(map(ros_text, robot.joint_names))

    def messages(self, table: Table, row: bytes) -> Iterator[tuple[Topic, float, bytes]]:
        """Topic, time [s] and content of the messages of a row."""
        time = time_of(row)
        if not (table.places.keys() >= _DRAWN and self._pace.is_due(time)):
            return
        stamp = divmod(round(time * 1e9), 10**9)
        if not self._begun:
            self._begun = True
            yield _SCENE, time, self._boxes(stamp)
        q, v, torque = (row[table.places[name]] for name in ("q", "v", "torque"))
        yield _JOINTS, time, self._joints(time, [q, v, torque])
        yield _TRANSFORMS, time, self._transforms(stamp, np.frombuffer(q))

    def _joints(self, time: float, numbers: list[bytes]) -> bytes:
        """The last numbers of q, v and torque are those of the joints."""
        size = 8 * self._robot.nj
        parts = [struct.pack("<d", time) + self._joint_count + self._joint_names]
        return b"".join(parts + [self._joint_count + x[len(x) - size :] for x in numbers])

    def _transforms(self, stamp: tuple[int, int], q: Float64[np.ndarray, " nq"]) -> bytes:
        """Each body's pose in the world [m]."""
        data, ids = self._data, [i for i, _ in self._bodies]
        data.qpos[:] = self._map.qpos(q)
        mujoco.mj_kinematics(self._model, data)
        poses = np.hstack((data.xpos[ids], data.xquat[ids][:, [1, 2, 3, 0]]))
        begin = struct.pack("<II", *stamp)
        parts = [begin + frame + x.tobytes() for frame, x in zip(self._frames, poses, strict=True)]
        return struct.pack("<I", len(parts)) + b"".join(parts)

    def _boxes(self, stamp: tuple[int, int]) -> bytes:
        """The bounding boxes of each body's pictures, or of its other geometry without any."""
        model, entities = self._model, list[dict[str, Any]]()
        at = dict(zip(("sec", "nsec"), stamp, strict=True))
        about = {"timestamp": at, "lifetime": {"sec": 0, "nsec": 0}, "frame_locked": True}
        for body, name in self._bodies:
            geoms = np.flatnonzero(model.geom_bodyid == body)
            pictures = geoms[model.geom_group[geoms] < 3]
            cubes = [_box(model, k) for k in (pictures if len(pictures) else geoms).tolist()]
            if cubes:
                entities.append({"frame_id": name, "id": name, "cubes": cubes, **about})
        return json.dumps({"deletions": [], "entities": entities}).encode()


def _box(model: mujoco.MjModel, k: int, thinnest: float = 1e-3) -> dict[str, Any]:
    """The bounding box of a geometry, as a visible cube in its body's frame [m]."""
    turned, geom, box = np.empty(3), model.geom(k), model.geom_aabb[k]
    mujoco.mju_rotVecQuat(turned, box[:3], geom.quat)
    position, orientation = _named("xyz", geom.pos + turned), _named("wxyz", geom.quat)
    return {
        "pose": {"position": position, "orientation": orientation},
        "size": _named("xyz", np.maximum(2.0 * box[3:], thinnest)),
        "color": _named("rgba", geom.rgba),
    }


def _named(names: str, numbers: np.ndarray) -> dict[str, float]:
    return dict(zip(names, map(float, numbers), strict=True))
