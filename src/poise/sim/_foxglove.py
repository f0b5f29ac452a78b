"""What Foxglove's 3D panel shows: transforms of the bodies, and boxes that look like them."""

from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.robots import Robot
from poise.sim._mapping import StateMap

_FLAT = 1e-3
"""Boxes are at least this thick [m], so that they can be seen."""


class Scene:
    """Makes Foxglove's messages from configurations, with data of its own: safe in a thread.

    Args:
        robot: the robot.
        model: its MuJoCo model.
    """

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        self._model = model
        self._data = mujoco.MjData(model)
        self._map = StateMap(robot, model)
        self._bodies = [(i, model.body(i).name) for i in range(1, model.nbody)]
        self._bodies = [(i, name) for i, name in self._bodies if name]

    def transforms(self, time: float, q: Float64[np.ndarray, " nq"]) -> dict[str, Any]:
        """A `foxglove.FrameTransforms` message: where each body is in the world [m]."""
        self._data.qpos[:] = self._map.qpos(q)
        mujoco.mj_kinematics(self._model, self._data)
        stamp = _stamp(time)
        return {
            "transforms": [
                {
                    "timestamp": stamp,
                    "parent_frame_id": "world",
                    "child_frame_id": name,
                    "translation": _xyz(self._data.xpos[i]),
                    "rotation": _xyzw(self._data.xquat[i]),
                }
                for i, name in self._bodies
            ]
        }

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
            for i, name in self._bodies
            if (cubes := [_box(self._model, g) for g in self._drawn(i)])
        ]
        return {"deletions": [], "entities": entities}

    def _drawn(self, body: int) -> list[int]:
        model = self._model
        first = int(model.body_geomadr[body])
        geoms = range(first, first + int(model.body_geomnum[body]))
        pictures = [g for g in geoms if model.geom_group[g] < 3]
        return pictures or list(geoms)


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
    return {
        "x": float(wxyz[1]),
        "y": float(wxyz[2]),
        "z": float(wxyz[3]),
        "w": float(wxyz[0]),
    }
