"""What Foxglove shows of a record: topics of its signals and notes, and a robot of boxes.

Messages are serialised as those of ROS 1, which Foxglove reads by their definition alone: numbers
as they are in memory, one after the other, little-endian; before a text or a list of any length
four bytes that count it. So all messages of a topic are one array.
"""

import json
import math
import struct
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float64, Int64

from poise.sim._mapping import StateMap
from poise.sim._mcap import McapFile, nanoseconds
from poise.sim._plant import Plant
from poise.sim._record_part import RecordPart
from poise.sim._table import Names, Rows

_SIGNAL, _SIGNALS, _NOTE = "poise/Number", "poise/Numbers", "poise/Text"
_JOINTS, _TRANSFORMS = "poise/Joints", "foxglove_msgs/FrameTransforms"

_DEFINITIONS = {
    _SIGNAL: "float64 time  # [s]\nfloat64 value",
    _SIGNALS: "float64 time  # [s]\nfloat64[] value  # row by row",
    _NOTE: "float64 time  # [s]\nstring value",
    _JOINTS: """float64 time  # [s]
string[] name
float64[] position  # [rad]
float64[] velocity  # [rad/s]
float64[] torque  # [N m]""",
    _TRANSFORMS: """foxglove_msgs/FrameTransform[] transforms
================================================================================
MSG: foxglove_msgs/FrameTransform
time timestamp
string parent_frame_id
string child_frame_id
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w""",
}
"""What the messages look like; Foxglove knows its own by their names."""

_SCENE = "foxglove.SceneUpdate"
"""The one message that is JSON: a log has it once."""

_SCENE_SCHEMA = {
    "title": _SCENE,
    "type": "object",
    "properties": {
        "deletions": {"type": "array", "items": {"type": "object"}},
        "entities": {"type": "array", "items": {"type": "object"}},
    },
}

_SLACK = 5e-10
"""Of a rate [s]: one that the control period divides stays exact."""

_WORLD = b"world"
_XYZW = [1, 2, 3, 0]
"""Order of ROS in a quaternion of MuJoCo."""

_FLAT = 1e-3
"""Boxes are at least this thick [m], so that they can be seen."""


class Pace:
    """Picks instants that are far enough apart.

    Args:
        dt: from one to the next, 0 for all [s].
    """

    def __init__(self, dt: float) -> None:
        self._dt, self._next = dt, -math.inf

    def is_due(self, time: float) -> bool:
        """Whether a time [s] is picked; ask once for each."""
        due = time >= self._next - _SLACK
        if due:
            self._next = time + self._dt
        return due

    def due(self, times: Float64[np.ndarray, " n"]) -> Int64[np.ndarray, " m"]:
        """Places of those that are picked."""
        if self._dt == 0.0:
            return np.arange(len(times))
        picked = [row for row, time in enumerate(times.tolist()) if self.is_due(time)]
        return np.array(picked, dtype=np.int64)


class Topics:
    """Makes Foxglove's messages of a record, with data of its own: safe in a thread.

    Args:
        plant: the plant; its state is not touched.
        log_dt: time from one sample of a topic to the next, 0 for every one [s].
        scene_dt: time from one set of body transforms to the next, 0 for none [s].
    """

    def __init__(self, plant: Plant, *, log_dt: float, scene_dt: float) -> None:
        self._robot, self._log_dt = plant.robot, log_dt
        self._paces: dict[Names, Pace] = {}
        self._scene = Scene(plant) if scene_dt > 0.0 else None
        self._scene_pace, self._scene_begun = Pace(scene_dt), False

    def write(self, file: McapFile, part: RecordPart) -> None:
        """Adds the messages of a part of the record to a file."""
        for rows in part.rows:
            names = tuple(signal.name for signal in rows.signals)
            due = self._paces.setdefault(names, Pace(self._log_dt)).due(rows.times)
            if len(due):
                _write_signals(file, rows, due)
                if {"q", "v", "torque"} <= set(names):
                    self._write_joints(file, rows, due)
            if self._scene is not None and "q" in names:
                self._write_scene(file, self._scene, rows.times, rows.columns[names.index("q")])
        for topic, notes in part.notes.items():
            channel = _channel(file, f"/{topic}", _NOTE)
            for time, text in notes:
                encoded = text.encode()
                content = struct.pack("<dI", time, len(encoded)) + encoded
                file.put(channel, time, content)

    def _write_joints(self, file: McapFile, rows: Rows, due: Int64[np.ndarray, " n"]) -> None:
        robot = self._robot
        columns = {s.name: column for s, column in zip(rows.signals, rows.columns, strict=True)}
        texts = [name.encode() for name in robot.joint_names]
        names = b"".join(struct.pack("<I", len(text)) + text for text in texts)
        numbers = [("count", "<u4"), ("value", "<f8", (robot.nj,))]
        layout = [("time", "<f8"), ("count", "<u4"), ("names", f"V{len(names)}")]
        layout += [("position", numbers), ("velocity", numbers), ("torque", numbers)]
        content = np.empty(len(due), dtype=layout)
        content["time"], content["count"] = rows.times[due], robot.nj
        content["names"] = np.void(names)
        for field, column in (
            ("position", columns["q"][due, -robot.nj :]),
            ("velocity", columns["v"][due, robot.base_dofs :]),
            ("torque", columns["torque"][due]),
        ):
            content[field]["count"], content[field]["value"] = robot.nj, column
        file.put_rows(_channel(file, "/joints", _JOINTS), rows.times[due], content)

    def _write_scene(
        self,
        file: McapFile,
        scene: "Scene",
        times: Float64[np.ndarray, " n"],
        q: Float64[np.ndarray, "n nq"],
    ) -> None:
        due = self._scene_pace.due(times)
        if not len(due):
            return
        if not self._scene_begun:
            self._scene_begun = True
            channel = file.channel(
                "/scene", "json", _SCENE, "jsonschema", json.dumps(_SCENE_SCHEMA)
            )
            first = float(times[due[0]])
            file.put(channel, first, json.dumps(scene.boxes(first)).encode())
        content = scene.transforms(times[due], q[due])
        file.put_rows(_channel(file, "/tf", _TRANSFORMS), times[due], content)


def _channel(file: McapFile, topic: str, schema: str) -> int:
    return file.channel(topic, "ros1", schema, "ros1msg", _DEFINITIONS[schema])


def _write_signals(file: McapFile, rows: Rows, due: Int64[np.ndarray, " n"]) -> None:
    times = rows.times[due]
    number = np.dtype([("time", "<f8"), ("value", "<f8")])
    for signal, column in zip(rows.signals, rows.columns, strict=True):
        layout, schema = number, _SIGNAL
        if signal.shape:
            value = ("value", "<f8", (signal.size,))
            layout, schema = np.dtype([("time", "<f8"), ("count", "<u4"), value]), _SIGNALS
        content = np.empty(len(due), dtype=layout)
        content["time"] = times
        if signal.shape:
            content["count"] = signal.size
        content["value"] = column[due].reshape(content["value"].shape)
        file.put_rows(_channel(file, f"/{signal.name}", schema), times, content)


class Scene:
    """Makes Foxglove's messages from configurations, with data of its own: safe in a thread.

    Args:
        plant: the plant; its state is not touched.
    """

    def __init__(self, plant: Plant) -> None:
        self._model = model = plant.model
        self._data = mujoco.MjData(model)
        self._map = StateMap(plant.robot, model)
        self._bodies = [(i, model.body(i).name) for i in range(1, model.nbody)]
        self._bodies = [(i, name) for i, name in self._bodies if name]
        self._layout = np.dtype(
            [("count", "<u4"), *((str(i), _transform_of(name)) for i, name in self._bodies)]
        )
        drawn = plant.drawn_model()
        self._cubes = {name: [_box(drawn, g) for g in _shown(drawn, i)] for i, name in self._bodies}

    def transforms(
        self, times: Float64[np.ndarray, " n"], q: Float64[np.ndarray, "n nq"]
    ) -> np.ndarray:
        """`foxglove_msgs/FrameTransforms` messages: where each body is in the world [m].

        Args:
            times: of the configurations [s].
            q: the configurations [m, rad].
        """
        content = np.empty(len(times), dtype=self._layout)
        content["count"] = len(self._bodies)
        stamps = nanoseconds(times)
        ids = [i for i, _ in self._bodies]
        positions = np.empty((len(times), len(ids), 3))
        quaternions = np.empty((len(times), len(ids), 4))
        for row, configuration in enumerate(q):
            self._data.qpos[:] = self._map.qpos(configuration)
            mujoco.mj_kinematics(self._model, self._data)
            positions[row], quaternions[row] = self._data.xpos[ids], self._data.xquat[ids]
        for k, (i, name) in enumerate(self._bodies):
            bodies, text = content[str(i)], name.encode()
            bodies["sec"], bodies["nsec"] = stamps // 10**9, stamps % 10**9
            bodies["parent_size"], bodies["parent"] = len(_WORLD), _WORLD
            bodies["child_size"], bodies["child"] = len(text), text
            bodies["translation"] = positions[:, k]
            bodies["rotation"] = quaternions[:, k, _XYZW]
        return content

    def boxes(self, time: float) -> dict[str, Any]:
        """A `foxglove.SceneUpdate` message: the bounding boxes of each body's geometry."""
        entities = [
            {
                "timestamp": _stamp(time),
                "frame_id": name,
                "id": name,
                "lifetime": {"sec": 0, "nsec": 0},
                "frame_locked": True,
                "cubes": cubes,
            }
            for name, cubes in self._cubes.items()
            if cubes
        ]
        return {"deletions": [], "entities": entities}


def _shown(model: mujoco.MjModel, body: int) -> list[int]:
    first = int(model.body_geomadr[body])
    geoms = range(first, first + int(model.body_geomnum[body]))
    pictures = [g for g in geoms if model.geom_group[g] < 3]
    return pictures or list(geoms)


def _transform_of(name: str) -> np.dtype[Any]:
    """How a `foxglove_msgs/FrameTransform` of a body lies in memory."""
    return np.dtype(
        [
            ("sec", "<u4"),
            ("nsec", "<u4"),
            ("parent_size", "<u4"),
            ("parent", f"S{len(_WORLD)}"),
            ("child_size", "<u4"),
            ("child", f"S{len(name.encode())}"),
            ("translation", "<f8", (3,)),
            ("rotation", "<f8", (4,)),
        ]
    )


def _box(model: mujoco.MjModel, geom: int) -> dict[str, Any]:
    """The bounding box of a geometry, as a cube in its body's frame [m]."""
    center, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    turned = np.empty(3)
    mujoco.mju_rotVecQuat(turned, center, model.geom_quat[geom])
    red, green, blue, alpha = (float(c) for c in model.geom_rgba[geom])
    return {
        "pose": {
            "position": _xyz(model.geom_pos[geom] + turned),
            "orientation": _xyzw(model.geom_quat[geom]),
        },
        "size": _xyz(np.maximum(2.0 * half, _FLAT)),
        "color": {"r": red, "g": green, "b": blue, "a": alpha},
    }


def _stamp(time: float) -> dict[str, int]:
    nanoseconds = round(time * 1e9)
    return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}


def _xyz(v: Float64[np.ndarray, "3"]) -> dict[str, float]:
    return {"x": float(v[0]), "y": float(v[1]), "z": float(v[2])}


def _xyzw(wxyz: Float64[np.ndarray, "4"]) -> dict[str, float]:
    return dict(zip("xyzw", wxyz[_XYZW].tolist(), strict=True))
