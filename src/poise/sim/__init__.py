"""The simulated robot: a MuJoCo plant with actuators, sensors, disturbances, recorder and video.

The only package that imports MuJoCo.
"""

from importlib.util import find_spec

from poise.errors import MissingExtraError

if find_spec("mujoco") is None:
    raise MissingExtraError("mujoco", "sim", "Simulation")

from poise.sim._blocks import BlockWatch
from poise.sim._camera import Camera, CameraConfig, Marker, NoOpenGLError, find_opengl, force_marker
from poise.sim._config import Actuation, PlantConfig, ServoConfig
from poise.sim._disturbances import Block, LinkError, Payload, Push
from poise.sim._log import read_log
from poise.sim._mapping import StateMap
from poise.sim._plant import Plant
from poise.sim._record import RunRecord, Value
from poise.sim._recorder import HasSignals, Recorder, RecorderConfig
from poise.sim._rollout import (
    AnyController,
    Body,
    Estimator,
    LeadFunction,
    Observer,
    Tick,
    rollout,
)
from poise.sim._sensors import SensorConfig
from poise.sim._video import VideoConfig, render_video, run_markers
from poise.sim._viewer import NoDisplayError, Viewer, open_viewer

__all__ = [
    "Actuation",
    "AnyController",
    "Block",
    "BlockWatch",
    "Body",
    "Camera",
    "CameraConfig",
    "Estimator",
    "HasSignals",
    "LeadFunction",
    "LinkError",
    "Marker",
    "NoDisplayError",
    "NoOpenGLError",
    "Observer",
    "Payload",
    "Plant",
    "PlantConfig",
    "Push",
    "Recorder",
    "RecorderConfig",
    "RunRecord",
    "SensorConfig",
    "ServoConfig",
    "StateMap",
    "Tick",
    "Value",
    "VideoConfig",
    "Viewer",
    "find_opengl",
    "force_marker",
    "open_viewer",
    "read_log",
    "render_video",
    "rollout",
    "run_markers",
]
