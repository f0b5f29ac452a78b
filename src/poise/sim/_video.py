"""A video of a run, drawn after it from its recorded configurations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._schema import Positive, checked
from poise.errors import ConfigurationError, TargetError, import_extra
from poise.robots import Robot
from poise.sim._camera import Camera, CameraConfig, Marker
from poise.sim._plant import Plant
from poise.sim._record import RunRecord


def run_markers(robot: Robot, record: RunRecord) -> Callable[[int], tuple[Marker, ...]]:
    """Markers by sample of a run: CoM on the ground (orange), ZMP (magenta), sole forces (blue)."""
    orange, magenta, blue = (
        (0.95, 0.55, 0.05, 1.0),
        (0.80, 0.10, 0.55, 1.0),
        (0.05, 0.45, 0.85, 1.0),
    )
    points = ((record["com"], orange), (record["zmp"], magenta))
    wrenches = {name: record[f"wrench/{name}"] for name in robot.soles}
    data = robot.model.createData()

    def markers(index: int) -> tuple[Marker, ...]:
        pin.framesForwardKinematics(robot.model, data, record["q"][index])
        found: list[Marker] = []
        for point, colour in points:
            x, y = (float(value) for value in point[index][:2])
            if np.isfinite([x, y]).all():
                # Half of each ball is seen.
                found.append(Marker(position=(x, y, 0.005), colour=colour))
        for name, wrench in wrenches.items():
            world_T_sole = data.oMf[robot.frame_id(name)]
            force = world_T_sole.rotation @ wrench[index, :3] / robot.weight
            if np.linalg.norm(force) > 0.02:
                # No leg hides what is before the foot; a force of the weight is 0.45 m long.
                toes = np.array([0.5 * robot.soles[name].length + 0.06, 0.0, 0.0])
                px, py, pz = (float(value) for value in world_T_sole.act(toes))
                x, y, z = (0.45 * float(value) for value in force)
                arrow = Marker(position=(px, py, pz), arrow=(x, y, z), colour=blue)
                found.append(arrow)
        return tuple(found)

    return markers


@checked()
@dataclass(frozen=True, kw_only=True)
class VideoConfig:
    """View and speed of a video."""

    camera: CameraConfig = field(default_factory=CameraConfig)  # of even width and height
    fps: Positive = 30.0  # pictures a second of the video
    speed: Positive = 1.0  # seconds of the run a second of the video; slow motion below one

    def __post_init__(self) -> None:
        if self.camera.width % 2 or self.camera.height % 2:
            raise ConfigurationError(
                "a video's width and height must be even",
                got=(self.camera.width, self.camera.height),
            )


def render_video(
    plant: Plant,
    times: Float64[np.ndarray, " n"],
    qs: Float64[np.ndarray, "m nq"],
    path: str | Path,
    *,
    config: VideoConfig | None = None,
    markers: Callable[[int], Sequence[Marker]] | None = None,
    poster: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Draw a recorded run into an mp4 file.

    Args:
        plant: the plant, for its model; its state is not touched.
        times: times of the recorded configurations, rising [s].
        qs: the configurations [m, rad].
        path: the video file, overwritten.
        config: size, view and speed.
        markers: what to draw with the sample of a given index.
        poster: a JPEG file for the picture half way, which a page shows until the video is played;
            none when None.
        progress: called with the pictures done and the pictures in all.

    Returns:
        The path of the video.

    Raises:
        MissingExtraError: this machine cannot draw without a screen, or the package imageio-ffmpeg
            is not installed; the message names the package.
        TargetError: times and configurations do not belong together.
    """
    config, path = config if config is not None else VideoConfig(), Path(path)
    _check(plant, times, qs)
    imageio = import_extra("imageio.v2", "sim", "Making a video")
    import_extra("imageio_ffmpeg", "sim", "Making a video", package="imageio-ffmpeg")
    indices = frame_indices(times, config)
    # Small and quick; the moov atom first, so that a browser can start before the end.
    coded = ["-crf", "23", "-preset", "veryfast", "-movflags", "+faststart"]
    form = {"codec": "libx264", "macro_block_size": 2, "quality": None, "output_params": coded}
    with (
        Camera(plant.robot, plant.drawn_model(), config.camera) as camera,
        imageio.get_writer(path, format="FFMPEG", fps=config.fps, **form) as writer,
    ):
        for done, index in enumerate(indices):
            drawn = markers(index) if markers is not None else ()
            frame = camera.picture(qs[index], drawn, dt=config.speed / config.fps)
            writer.append_data(frame)
            if poster is not None and done == len(indices) // 2:
                imageio.imwrite(poster, frame, format="JPEG")
            if progress is not None:
                progress(done + 1, len(indices))
    return path


def frame_indices(times: Float64[np.ndarray, " n"], config: VideoConfig) -> list[int]:
    """Which sample each picture shows: the last one at or before its time."""
    step = config.speed / config.fps
    stamps = np.arange(times[0], times[-1] + 1e-9, step)
    found = np.searchsorted(times, stamps + 1e-9, side="right") - 1
    return [int(i) for i in found]


def _check(plant: Plant, times: Float64[np.ndarray, " n"], qs: Float64[np.ndarray, "m nq"]) -> None:
    if qs.shape != (len(times), plant.robot.nq) or len(times) == 0:
        raise TargetError(
            "the recorded configurations have the wrong shape",
            got=qs.shape,
            wanted=f"(n, {plant.robot.nq}) with n = {len(times)} > 0",
        )
    if np.any(np.diff(times) < 0.0):
        raise TargetError("the recorded times go back", wanted="rising times")
