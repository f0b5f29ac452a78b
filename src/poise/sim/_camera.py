"""Pictures of the plant, drawn without a screen, with points and arrows in them."""

import importlib
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Annotated, Any, ClassVar

import mujoco
import numpy as np
from jaxtyping import Float64, UInt8
from mujoco.rendering.classic import gl_context

from poise._schema import Bounds, Count, Number, Positive, Triple, Vector, checked
from poise.robots import Robot
from poise.sim._mapping import StateMap
from poise.sim._mujoco import asked_platform, missing_library

_PLATFORMS = ("egl", "osmesa")  # EGL first: it uses a graphics card where there is one
_TRIAL = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco/>")
renderer = mujoco.Renderer(model, 64, 64)
renderer.update_scene(mujoco.MjData(model))
renderer.render()
"""


# Red, green, blue, opacity in [0, 1]
Colour = Annotated[tuple[float, float, float, float], Vector(4, Bounds(least=0.0, most=1.0))]


@cache
def find_opengl() -> str | None:
    """Platform that draws without a screen here, "egl" or "osmesa"; the environment may name it."""
    asked = asked_platform()
    # PyOpenGL decides on one once for the life of a process, so each is tried in another process.
    for platform in _PLATFORMS if asked is None else asked[1:]:
        try:
            done = subprocess.run(
                [sys.executable, "-c", _TRIAL],
                env=os.environ | {"MUJOCO_GL": platform, "PYOPENGL_PLATFORM": platform},
                capture_output=True,
                timeout=60.0,  # a driver that hangs counts as none
                check=False,
            )
        except subprocess.TimeoutExpired:
            continue
        if done.returncode == 0:
            return platform
    return None


@checked()
@dataclass(frozen=True, kw_only=True)
class Marker:
    """A ball at a point, or an arrow from it."""

    position: Triple  # in the world [m]
    arrow: Triple | None = None  # from the point to the tip in the world [m]; None for a ball
    radius: Positive = 0.025  # of the ball [m]
    colour: Colour = (0.10, 0.60, 0.25, 0.85)  # red, green, blue, opacity in [0, 1]


@checked()
@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """Size of the picture and place of the camera, which steps back to show the robot whole."""

    width: Count = 960  # [pixel]
    height: Count = 540  # [pixel]
    azimuth: Number = 145.0  # direction of view about z, 0 looks along x [deg]
    elevation: Number = -12.0  # direction of view above the horizon [deg]
    distance: Positive = 1.4  # least one from the camera to the robot, in robot heights
    antialiasing: Annotated[int, Bounds(least=0.0, whole=True)] = 0  # samples a pixel, 0 for none


class Camera:
    """Draws a robot's configurations; a context manager that frees the graphics memory.

    It has model data of its own and never changes the plant. Make and use it in one thread.

    Args:
        robot: the robot.
        model: a MuJoCo model of it, such as `Plant.drawn_model()`.
        config: size and view.

    Raises:
        MissingExtraError: this machine cannot draw without a screen.
    """

    Config: ClassVar = CameraConfig

    def __init__(
        self, robot: Robot, model: mujoco.MjModel, config: CameraConfig | None = None
    ) -> None:
        self.config = config if config is not None else CameraConfig()
        self._model, self._data = model, mujoco.MjData(model)
        self._map = StateMap(robot, model)
        self._renderer = _renderer(model, self.config)
        self._view = mujoco.MjvCamera()
        self._view.azimuth, self._view.elevation = self.config.azimuth, self.config.elevation
        self._place(robot.q_home)
        self._height = float(self._boxes(model.geom_bodyid > 0)[1][:, 2].max())
        self._lift = 0.5 * self._height - float(self._data.subtree_com[1, 2])
        self._view.distance = self.config.distance * self._height
        self._view.lookat[:] = self._aim()

    def picture(
        self,
        q: Float64[np.ndarray, " nq"],
        markers: Sequence[Marker] = (),
        dt: float | None = None,
    ) -> UInt8[np.ndarray, "height width 3"]:
        """Draw the robot.

        Args:
            q: configuration [m, rad].
            markers: points and arrows to draw with it.
            dt: time since the last picture, for the camera that follows [s]; None looks straight
                at the robot.

        Returns:
            Red, green, blue, top row first.
        """
        self._place(q)
        mujoco.mj_camlight(self._model, self._data)
        self._follow(dt)
        self._renderer.update_scene(self._data, self._view)
        for marker in markers:
            _add_marker(self._renderer.scene, marker)
        return self._renderer.render()

    def close(self) -> None:
        """Free the graphics memory."""
        self._renderer.close()

    def __enter__(self) -> "Camera":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _place(self, q: Float64[np.ndarray, " nq"]) -> None:
        self._data.qpos[:] = self._map.qpos(q)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def _boxes(
        self, chosen: Any
    ) -> tuple[Float64[np.ndarray, "ngeom 3"], Float64[np.ndarray, "ngeom 3"]]:
        """Lower and upper corners of boxes around shapes, along the world's axes [m]."""
        turns = self._data.geom_xmat[chosen].reshape(-1, 3, 3)
        boxes = self._model.geom_aabb[chosen]
        centers = self._data.geom_xpos[chosen] + np.einsum("nij,nj->ni", turns, boxes[:, :3])
        halves = np.einsum("nij,nj->ni", np.abs(turns), boxes[:, 3:])
        return centers - halves, centers + halves

    def _seen(self, step: float = 0.35) -> list[Float64[np.ndarray, "corners 3"]]:
        """Corners of a box around the robot, and of blocks a step by its height away [m]."""
        model, bodies = self._model, self._data.xpos[1:]
        lower, upper = self._boxes(model.geom_bodyid > 0)
        # Bodies count too: some documents have pictures of a few links only.
        ends = [(np.vstack([lower, bodies]).min(axis=0), np.vstack([upper, bodies]).max(axis=0))]
        planes = model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)
        aim, reach = self._aim(), np.array([step, step, 1.0]) * self._height
        for low, high in zip(*self._boxes((model.geom_bodyid == 0) & ~planes), strict=True):
            low, high = np.maximum(low, aim - reach), np.minimum(high, aim + reach)
            ends += [(low, high)] if (low < high).all() else []
        return [np.array(list(product(*np.transpose(box)))) for box in ends]

    def _distance_for_all(self, filled: float = 0.9) -> float:
        """Least distance at which robot and ground fill that part of the picture [m]."""
        # A point at d from the robot's middle, where the camera looks, is seen if
        # |d . up| <= tan(fov / 2) (distance + d . ahead), and to the sides in the picture's ratio.
        azimuth, elevation = np.radians([self._view.azimuth, self._view.elevation])
        c, s = np.cos(elevation), np.sin(elevation)
        ahead = np.array([np.cos(azimuth) * c, np.sin(azimuth) * c, s])
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        corners = np.vstack(self._seen()) - self._aim()
        slope = filled * np.tan(0.5 * np.radians(float(self._model.vis.global_.fovy)))
        ratio = self.config.width / self.config.height
        up = np.abs(corners @ np.cross(right, ahead))
        across = np.maximum(up, np.abs(corners @ right) / ratio)
        return float(np.max(across / slope - corners @ ahead))

    def _aim(self) -> Float64[np.ndarray, "3"]:
        return self._data.subtree_com[1] + [0.0, 0.0, self._lift]

    def _follow(self, dt: float | None, lag: float = 0.4) -> None:
        # With a lag the picture does not shake with the robot.
        ratio = 1.0 if dt is None else 1.0 - np.exp(-dt / lag)
        aim, nearest = self._aim(), self.config.distance * self._height
        if not np.isfinite(aim).all():
            return
        self._view.lookat[:] += ratio * (aim - self._view.lookat)
        # It steps back without delay for what would be cut off, and comes back slowly.
        rest = self._view.distance + ratio * (nearest - self._view.distance)
        self._view.distance = max(rest, self._distance_for_all())


def _renderer(model: mujoco.MjModel, config: CameraConfig) -> mujoco.Renderer:
    """Make a renderer on the platform that draws here, without shadows and reflections."""
    platform = find_opengl()
    if platform is None:
        raise missing_library()
    # MuJoCo takes the size of its picture buffer from the model, and the platform from its package,
    # which has decided on one while it was imported.
    buffer, quality = model.vis.global_, model.vis.quality
    before = (buffer.offwidth, buffer.offheight, quality.offsamples, quality.shadowsize)
    packaged = getattr(gl_context, "GLContext", None)
    try:
        buffer.offwidth, buffer.offheight = config.width, config.height
        quality.offsamples, quality.shadowsize = config.antialiasing, 0
        gl_context.GLContext = importlib.import_module(f"mujoco.{platform}").GLContext
        renderer = mujoco.Renderer(model, config.height, config.width)
    finally:
        gl_context.GLContext = packaged
        buffer.offwidth, buffer.offheight, quality.offsamples, quality.shadowsize = before
    for flag in ("SHADOW", "REFLECTION", "HAZE"):
        renderer.scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = False
    return renderer


def _add_marker(scene: mujoco.MjvScene, marker: Marker, shaft: float = 0.016) -> None:
    """Add a marker to a scene; one that has no room left in the scene is not drawn."""
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    colour = np.array(marker.colour, dtype=np.float32)
    position = np.array(marker.position, dtype=np.float64)
    size, turn = np.full(3, marker.radius), np.eye(3).ravel()
    mujoco.mjv_initGeom(geom, int(mujoco.mjtGeom.mjGEOM_SPHERE), size, position, turn, colour)
    if marker.arrow is not None:
        # MuJoCo draws half of what it is given (seen with 4.0, and held by a test).
        tip = position + 2.0 * np.array(marker.arrow)
        mujoco.mjv_connector(geom, int(mujoco.mjtGeom.mjGEOM_ARROW), shaft, position, tip)
    scene.ngeom += 1
