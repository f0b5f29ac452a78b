"""Pictures of the plant, drawn without a screen.

Finding a platform to draw without a screen, without touching the user's environment.
Points and arrows drawn into a picture: centre of mass, targets, contact forces.

MuJoCo's package decides on OpenGL while it is imported, and PyOpenGL does so once for the life of a
process. So each platform is tried in a process of its own, and the first that draws is then used
here by its own module, whatever MuJoCo's package has decided.
"""

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

from poise._schema import Bounds, Count, Number, Positive, Triple, Vector, checked
from poise.robots import Robot
from poise.sim._mapping import StateMap
from poise.sim._mujoco import asked_platform, missing_library

_PLATFORMS = ("egl", "osmesa")
"""EGL first: it uses a graphics card where there is one."""

_TRIAL = """
import importlib, sys
import mujoco
context = importlib.import_module("mujoco." + sys.argv[1]).GLContext(64, 64)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 50).free()
context.free()
"""

_TRIAL_SECONDS = 60.0
"""A driver that hangs counts as none."""


@cache
def find_opengl() -> str | None:
    """The platform to draw without a screen that works here: "egl", "osmesa", or None.

    MUJOCO_GL and PYOPENGL_PLATFORM are obeyed if they name one of the two. The answer is kept for
    the life of the process.
    """
    asked = asked_platform()
    for platform in _PLATFORMS if asked is None else asked[1:]:
        try:
            done = subprocess.run(
                [sys.executable, "-c", _TRIAL, platform],
                env=os.environ | {"MUJOCO_GL": platform, "PYOPENGL_PLATFORM": platform},
                capture_output=True,
                timeout=_TRIAL_SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired:
            continue
        if done.returncode == 0:
            return platform
    return None


def make_context(width: int, height: int) -> Any:
    """Make an OpenGL context without a screen, current in this thread."""
    platform = find_opengl()
    if platform is None:
        raise missing_library()
    context = importlib.import_module(f"mujoco.{platform}").GLContext(width, height)
    context.make_current()
    return context


Colour = Annotated[tuple[float, float, float, float], Vector(4, Bounds(least=0.0, most=1.0))]
"""Red, green, blue, opacity in [0, 1]."""

COM_COLOUR: Colour = (0.95, 0.55, 0.05, 1.0)
ZMP_COLOUR: Colour = (0.80, 0.10, 0.55, 1.0)
TARGET_COLOUR: Colour = (0.10, 0.60, 0.25, 0.85)
FORCE_COLOUR: Colour = (0.05, 0.45, 0.85, 1.0)

_ARROW_WIDTH = 0.016
"""Radius of an arrow's shaft [m]."""


@checked()
@dataclass(frozen=True, kw_only=True)
class Marker:
    """A ball at a point, or an arrow from it.

    Attributes:
        position: where it is in the world [m].
        arrow: from the point to the arrow's tip in the world [m]; None for a ball.
        radius: of the ball [m].
        colour: red, green, blue, opacity in [0, 1].
    """

    position: Triple
    arrow: Triple | None = None
    radius: Positive = 0.025
    colour: Colour = TARGET_COLOUR


def add_marker(scene: mujoco.MjvScene, marker: Marker) -> None:
    """Add a marker to a scene; one that has no room left in the scene is not drawn."""
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    colour = np.array(marker.colour, dtype=np.float32)
    position = np.array(marker.position, dtype=np.float64)
    size = np.full(3, marker.radius)
    mujoco.mjv_initGeom(geom, int(mujoco.mjtGeom.mjGEOM_SPHERE), size, position, _IDENTITY, colour)
    if marker.arrow is not None:
        # MuJoCo draws half of what it is given (seen with 4.0, and held by a test).
        tip = position + 2.0 * np.array(marker.arrow)
        mujoco.mjv_connector(geom, int(mujoco.mjtGeom.mjGEOM_ARROW), _ARROW_WIDTH, position, tip)
    scene.ngeom += 1


def force_marker(
    position: Float64[np.ndarray, "3"], force: Float64[np.ndarray, "3"], scale: float
) -> Marker:
    """An arrow for a force in the world [N], `scale` metres a newton."""
    x, y, z = (float(f) * scale for f in force)
    px, py, pz = (float(p) for p in position)
    return Marker(position=(px, py, pz), arrow=(x, y, z), colour=FORCE_COLOUR)


_IDENTITY = np.eye(3).ravel()


_MAX_GEOMS = 4000
_FILLED = 0.9
"""How much of the picture's height and width the robot may fill; the rest is for the lag."""

_FOLLOW_SECONDS = 0.4
"""The camera follows the robot with this lag, so that the picture does not shake with it."""


@checked()
@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """Size of the picture and where it is taken from.

    Attributes:
        width: [pixel]
        height: [pixel]
        azimuth: direction of view about z, 0 looks along x [deg].
        elevation: direction of view above the horizon, negative looks down [deg].
        distance: from the camera to the robot, in robot heights; it steps back where the robot
            would not be seen whole.
        antialiasing: samples a pixel, 0 for none; each costs time in software.
    """

    width: Count = 960
    height: Count = 540
    azimuth: Number = 145.0
    elevation: Number = -12.0
    distance: Positive = 1.4
    antialiasing: Annotated[int, Bounds(least=0.0, whole=True)] = 0


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
        self._rect = mujoco.MjrRect(0, 0, self.config.width, self.config.height)
        self._gl = make_context(self.config.width, self.config.height)
        self._context = self._make_drawing_context()
        self._scene = mujoco.MjvScene(model, _MAX_GEOMS)
        for flag in (
            mujoco.mjtRndFlag.mjRND_SHADOW,
            mujoco.mjtRndFlag.mjRND_REFLECTION,
            mujoco.mjtRndFlag.mjRND_HAZE,
        ):
            self._scene.flags[flag] = False
        self._option = mujoco.MjvOption()
        self._view = mujoco.MjvCamera()
        self._frame_home(robot)

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
        self._data.qpos[:] = self._map.qpos(q)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        self._follow(dt)
        mujoco.mjv_updateScene(
            self._model,
            self._data,
            self._option,
            None,
            self._view,
            int(mujoco.mjtCatBit.mjCAT_ALL),
            self._scene,
        )
        for marker in markers:
            add_marker(self._scene, marker)
        self._gl.make_current()
        mujoco.mjr_render(self._rect, self._scene, self._context)
        rgb = np.empty((self.config.height, self.config.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(rgb, None, self._rect, self._context)
        return rgb[::-1]

    def close(self) -> None:
        """Free the graphics memory."""
        self._gl.make_current()
        self._context.free()
        self._gl.free()

    def __enter__(self) -> "Camera":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _make_drawing_context(self) -> mujoco.MjrContext:
        """MuJoCo takes the size of its picture buffer from the model: lend it, and put it back."""
        buffer, quality = self._model.vis.global_, self._model.vis.quality
        before = (buffer.offwidth, buffer.offheight, quality.offsamples, quality.shadowsize)
        try:
            buffer.offwidth, buffer.offheight = self.config.width, self.config.height
            quality.offsamples, quality.shadowsize = self.config.antialiasing, 0
            context = mujoco.MjrContext(self._model, int(mujoco.mjtFontScale.mjFONTSCALE_150))
        finally:
            buffer.offwidth, buffer.offheight, quality.offsamples, quality.shadowsize = before
        mujoco.mjr_setBuffer(int(mujoco.mjtFramebuffer.mjFB_OFFSCREEN), context)
        return context

    def _frame_home(self, robot: Robot) -> None:
        """Look at the middle of the robot in its home posture."""
        self._data.qpos[:] = self._map.qpos(robot.q_home)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        _, upper = self._box()
        height = float(upper[2])
        self._lift = 0.5 * height - float(self._data.subtree_com[1, 2])
        self._nearest = self.config.distance * height
        self._view.distance = self._nearest
        self._view.azimuth, self._view.elevation = self.config.azimuth, self.config.elevation
        self._view.lookat[:] = self._aim()

    def _box(self) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
        """Corners of a box around the robot, along the world's axes [m]."""
        data, model = self._data, self._model
        own = model.geom_bodyid > 0
        turns = data.geom_xmat[own].reshape(-1, 3, 3)
        boxes = model.geom_aabb[own]
        centers = data.geom_xpos[own] + np.einsum("nij,nj->ni", turns, boxes[:, :3])
        halves = np.einsum("nij,nj->ni", np.abs(turns), boxes[:, 3:])
        # Bodies count too: some documents have pictures of a few links only.
        bodies = data.xpos[1:]
        lower = np.vstack([centers - halves, bodies]).min(axis=0)
        return lower, np.vstack([centers + halves, bodies]).max(axis=0)

    def _distance_for_all(self) -> float:
        """How far away the camera has to be to see the whole robot [m].

        A point at d from the robot's middle, where the camera looks, is seen if

            |d . up| <= tan(fov / 2) (distance + d . ahead),

        and to the sides in the picture's ratio.
        """
        azimuth, elevation = np.radians([self._view.azimuth, self._view.elevation])
        c, s = np.cos(elevation), np.sin(elevation)
        ahead = np.array([np.cos(azimuth) * c, np.sin(azimuth) * c, s])
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        up = np.cross(right, ahead)
        corners = np.array(list(product(*np.transpose(self._box())))) - self._aim()
        slope = _FILLED * np.tan(0.5 * np.radians(float(self._model.vis.global_.fovy)))
        ratio = self.config.width / self.config.height
        across = np.maximum(np.abs(corners @ up), np.abs(corners @ right) / ratio)
        return float(np.max(across / slope - corners @ ahead))

    def _aim(self) -> Float64[np.ndarray, "3"]:
        com = self._data.subtree_com[1]
        return np.array([com[0], com[1], com[2] + self._lift])

    def _follow(self, dt: float | None) -> None:
        ratio = 1.0 if dt is None else 1.0 - np.exp(-dt / _FOLLOW_SECONDS)
        aim = self._aim()
        if not np.isfinite(aim).all():
            return
        self._view.lookat[:] += ratio * (aim - self._view.lookat)
        # It steps back at once for an arm or a foot that would be cut off, and comes back slowly.
        rest = self._view.distance + ratio * (self._nearest - self._view.distance)
        self._view.distance = max(rest, self._distance_for_all())
