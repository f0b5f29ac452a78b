"""The simulated robot: a MuJoCo plant with actuators, sensors, disturbances, recorder and video.

The only package that imports MuJoCo.
"""

from importlib.util import find_spec

from poise.errors import MissingExtraError

if find_spec("mujoco") is None:
    raise MissingExtraError("mujoco", "sim", "Simulation")

from poise.sim.camera import Camera, CameraConfig
from poise.sim.config import Actuation, PlantConfig, ServoConfig
from poise.sim.disturbances import Block, LinkError, Payload, Push
from poise.sim.log_reader import Log, read_log
from poise.sim.mapping import StateMap
from poise.sim.markers import Marker, force_marker
from poise.sim.opengl import NoOpenGLError, find_opengl
from poise.sim.overlays import run_markers
from poise.sim.plant import Plant
from poise.sim.recorder import Recorder, RecorderConfig
from poise.sim.sensors import SensorConfig
from poise.sim.touches import BlockWatch
from poise.sim.video import VideoConfig, render_video
from poise.sim.viewer import NoDisplayError, Viewer, open_viewer

__all__ = [
    "Actuation",
    "Block",
    "BlockWatch",
    "Camera",
    "CameraConfig",
    "LinkError",
    "Log",
    "Marker",
    "NoDisplayError",
    "NoOpenGLError",
    "Payload",
    "Plant",
    "PlantConfig",
    "Push",
    "Recorder",
    "RecorderConfig",
    "SensorConfig",
    "ServoConfig",
    "StateMap",
    "VideoConfig",
    "Viewer",
    "find_opengl",
    "force_marker",
    "open_viewer",
    "read_log",
    "render_video",
    "run_markers",
]
