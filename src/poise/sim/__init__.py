"""The simulated robot: a MuJoCo plant with actuators, sensors, disturbances, recorder and video.

The only package that imports MuJoCo.
"""

from poise.sim._mujoco import missing_library as missing_library, refusal, silence as silence

if (_refusal := refusal()) is not None:
    raise _refusal

from poise.sim._bridge import MujocoBridge
from poise.sim._camera import Camera, Marker, find_opengl as find_opengl
from poise.sim._config import (
    Actuation as Actuation,
    Block,
    PlantConfig,
    Push as Push,
    SensorConfig,
)
from poise.sim._hoisted_plant import HoistedPlant
from poise.sim._log import finish_log as finish_log, read_log, write_log as write_log
from poise.sim._mapping import StateMap as StateMap
from poise.sim._motor_config import (
    Linkage as Linkage,
    Motor as Motor,
    MotorConfig,
)
from poise.sim._motors import SetPoints as SetPoints
from poise.sim._plant import Plant
from poise.sim._record import RunRecord, Value as Value
from poise.sim._recorder import (
    BlockWatch as BlockWatch,
    HasSignals as HasSignals,
    Recorder,
    RecorderConfig as RecorderConfig,
)
from poise.sim._rollout import (
    AnyController as AnyController,
    Body,
    Estimator as Estimator,
    LeadFunction as LeadFunction,
    Observer,
    Tick,
    check_period as check_period,
    garbage_frozen as garbage_frozen,
    rollout,
)
from poise.sim._video import VideoConfig as VideoConfig, render_video, run_markers as run_markers
from poise.sim._viewer import (
    NoDisplayError as NoDisplayError,
    Viewer as Viewer,
    open_viewer as open_viewer,
)

__all__ = [
    "Block",
    "Body",
    "Camera",
    "HoistedPlant",
    "Marker",
    "MotorConfig",
    "MujocoBridge",
    "Observer",
    "Plant",
    "PlantConfig",
    "Recorder",
    "RunRecord",
    "SensorConfig",
    "Tick",
    "read_log",
    "render_video",
    "rollout",
]
