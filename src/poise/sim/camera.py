"""Pictures of the plant, drawn without a screen."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType

import mujoco
import numpy as np
from jaxtyping import Float64, UInt8

from poise.robots.robot import Robot
from poise.sim.checks import require_finite, require_positive
from poise.sim.mapping import StateMap
from poise.sim.markers import Marker, add_marker
from poise.sim.opengl import make_context

_MAX_GEOMS = 4000
_FOLLOW_SECONDS = 0.4
"""The camera follows the robot with this lag, so that the picture does not shake with it."""


@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """Size of the picture and where it is taken from.

    Attributes:
        width: [pixel]
        height: [pixel]
        azimuth: direction of view about z, 0 looks along x [deg].
        elevation: direction of view above the horizon, negative looks down [deg].
        distance: from the camera to the robot, in robot heights.
        antialiasing: samples a pixel, 0 for none; each costs time in software.
    """

    width: int = 960
    height: int = 540
    azimuth: float = 145.0
    elevation: float = -12.0
    distance: float = 1.4
    antialiasing: int = 0

    def __post_init__(self) -> None:
        require_positive("width", self.width)
        require_positive("height", self.height)
        require_positive("distance", self.distance)
        require_finite("azimuth", self.azimuth)
        require_finite("elevation", self.elevation)


class Camera:
    """Draws a robot's configurations; a context manager that frees the graphics memory.

    It has model data of its own and never changes the plant. Make and use it in one thread.

    Args:
        robot: the robot.
        model: its MuJoCo model.
        config: size and view.

    Raises:
        NoOpenGLError: this machine cannot draw without a screen.
    """

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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
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
        """Stand back far enough to see the whole robot in its home posture."""
        self._data.qpos[:] = self._map.qpos(robot.q_home)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        reach = self._data.geom_xpos[:, 2] + self._model.geom_rbound
        # Bodies count too: some documents have pictures of a few links only.
        bodies = float(self._data.xpos[1:, 2].max(initial=0.3))
        height = float(reach[self._model.geom_bodyid > 0].max(initial=bodies))
        self._lift = 0.5 * height - float(self._data.subtree_com[1, 2])
        self._view.distance = self.config.distance * height
        self._view.azimuth, self._view.elevation = self.config.azimuth, self.config.elevation
        self._view.lookat[:] = self._aim()

    def _aim(self) -> Float64[np.ndarray, "3"]:
        com = self._data.subtree_com[1]
        return np.array([com[0], com[1], com[2] + self._lift])

    def _follow(self, dt: float | None) -> None:
        share = 1.0 if dt is None else 1.0 - np.exp(-dt / _FOLLOW_SECONDS)
        aim = self._aim()
        if np.isfinite(aim).all():
            self._view.lookat[:] += share * (aim - self._view.lookat)
