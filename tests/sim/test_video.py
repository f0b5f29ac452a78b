import re
import subprocess

import numpy as np
import pytest

from poise.errors import ConfigurationError, MissingExtraError, TargetError
from poise.sim import (
    Camera,
    Marker,
    NoDisplayError,
    Plant,
    PlantConfig,
    Recorder,
    VideoConfig,
    find_opengl,
    open_viewer,
    render_video,
    run_markers,
)

SMALL = Camera.Config(width=320, height=180)


@pytest.fixture(scope="module")
def plant(biped):
    return Plant(biped, PlantConfig(actuation="position"))


@pytest.fixture
def opengl_here():
    if find_opengl() is None:
        pytest.skip("no OpenGL without a screen")


def test_the_robot_is_in_the_middle_of_the_picture(plant, biped, opengl_here):
    away = biped.q_home.copy()
    away[:2] += 50.0
    with Camera(biped, plant.model, SMALL) as camera:
        here = camera.picture(biped.q_home).astype(int)
    with Camera(biped, plant.model, SMALL) as camera:
        camera.picture(biped.q_home)
        empty = camera.picture(away, dt=1e-9).astype(int)
    assert here.shape == (180, 320, 3)
    robot = np.abs(here - empty).sum(axis=2) > 30
    rows, columns = np.nonzero(robot)
    assert robot.mean() > 0.02
    assert abs(columns.mean() - 160) < 25
    assert rows.min() > 2
    assert rows.max() < 178
    assert rows.max() - rows.min() > 0.5 * 180
    # Readable: neither black nor burnt out.
    assert 60 < here.mean() < 235


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("arms", ["down", "up", "ahead"])
@pytest.mark.parametrize("name", ["humanoid33", "g1", "talos"])
def test_the_whole_robot_is_seen_with_its_feet_and_hands(get_robot, name, arms, opengl_here):
    robot = get_robot(name)
    q, away = robot.q_home.copy(), robot.q_home.copy()
    away[:2] += 50.0
    for i, joint in enumerate(robot.joint_names):
        if re.search(r"shoulder_pitch|arm_(left|right)_2|arm_(left|right)_1", joint):
            reach = {"down": 0.0, "up": -2.8, "ahead": -1.5}[arms]
            q[robot.nq - robot.nj + i] += np.clip(reach, robot.q_min[i], robot.q_max[i])
    with Camera(robot, Plant(robot).drawn_model(), SMALL) as camera:
        here = camera.picture(q).astype(int)
        empty = camera.picture(away, dt=1e-9).astype(int)
    seen = np.nonzero(np.abs(here - empty).sum(axis=2) > 30)
    for pixels, size in zip(seen, (180, 320), strict=True):
        assert pixels.min() >= 0.015 * size
        assert pixels.max() < 0.985 * size
    assert np.ptp(seen[0]) > 0.5 * 180


def test_markers_are_drawn(plant, biped, opengl_here):
    with Camera(biped, plant.model, SMALL) as camera:
        plain = camera.picture(biped.q_home).astype(int)
        markers = (
            Marker(position=(0.3, 0.0, 0.5), radius=0.1, colour=(1.0, 0.0, 0.0, 1.0)),
            Marker(position=(0.3, 0.0, 0.0), arrow=(0.0, 0.0, 0.4)),
        )
        marked = camera.picture(biped.q_home, markers).astype(int)
    assert (np.abs(marked - plain).sum(axis=2) > 60).sum() > 100


def test_an_arrow_is_as_long_as_it_says(plant, biped, opengl_here):
    def rows(*markers):
        changed = np.abs(camera.picture(biped.q_home, markers).astype(int) - plain) > 20
        return np.ptp(np.nonzero(changed.any(axis=(1, 2)))[0])

    with Camera(biped, plant.model, Camera.Config()) as camera:
        plain = camera.picture(biped.q_home).astype(int)
        arrow = rows(Marker(position=(0.0, 0.6, 0.0), arrow=(0.0, 0.0, 0.6)))
        ball = rows(Marker(position=(0.0, 0.6, 0.3), radius=0.3))
    assert arrow == pytest.approx(ball, rel=0.1)


def test_the_viewer_shows_the_plant_and_pulls_it(plant, monkeypatch):
    viewer = pytest.importorskip("mujoco.viewer")
    shown = []

    class Window:
        def is_running(self):
            return True

        def sync(self):
            shown[0].xfrc_applied[1, 0] = 5.0

        def close(self):
            pass

    def launch(model, data, **_):
        shown.append(data)
        return Window()

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(viewer, "launch_passive", launch)
    plant.reset()
    with open_viewer(plant) as window:
        np.testing.assert_array_equal(shown[0].qpos, plant.data.qpos)
        plant.step(None)
        window.sync()
        np.testing.assert_array_equal(shown[0].qpos, plant.data.qpos)
        np.testing.assert_allclose(shown[0].xipos, plant.data.xipos, atol=1e-9)
        assert plant.data.xfrc_applied[1, 0] == 5.0
    plant.reset()


def test_drawing_leaves_the_plant_alone(plant, biped, opengl_here):
    before = plant.data.qpos.copy(), plant.model.vis.global_.offwidth
    with Camera(biped, plant.model, SMALL) as camera:
        camera.picture(biped.q_home + 0.01)
    np.testing.assert_array_equal(plant.data.qpos, before[0])
    assert plant.model.vis.global_.offwidth == before[1]


def test_a_video_has_the_length_and_size_of_the_run(plant, biped, opengl_here, tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    image = pytest.importorskip("matplotlib.image")
    times = np.arange(0.0, 1.0, 1e-3)
    qs = np.tile(biped.q_home, (len(times), 1))
    qs[:, 0] += 0.2 * times
    seen = []
    path = render_video(
        plant,
        times,
        qs,
        tmp_path / "run.mp4",
        config=VideoConfig(camera=SMALL),
        markers=lambda i: (Marker(position=(0.2 * times[i], 0.0, 0.0)),),
        poster=str(tmp_path / "run.jpg"),
        progress=lambda done, total: seen.append((done, total)),
    )
    assert image.imread(tmp_path / "run.jpg").shape == (180, 320, 3)
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == 30
    assert seconds == pytest.approx(1.0, abs=0.05)
    assert seen[-1] == (30, 30)
    reader = imageio_ffmpeg.read_frames(str(path))
    assert next(reader)["size"] == (320, 180)
    reader.close()


def test_a_recorded_run_is_drawn_with_its_forces(plant, biped):
    plant.reset()
    recorder = Recorder()
    recorder.begin(plant)
    for _ in range(300):
        plant.step(None)
        recorder.look()
    markers = run_markers(biped, recorder.record)(299)
    arrows = [m for m in markers if m.arrow is not None]
    balls = [m for m in markers if m.arrow is None]
    np.testing.assert_allclose(sum(m.arrow[2] for m in arrows), 0.45, rtol=0.05)
    np.testing.assert_allclose(balls[0].position[:2], recorder.record["com"][299, :2])
    np.testing.assert_allclose(balls[1].position[:2], recorder.record["zmp"][299])


def test_a_variable_that_names_a_platform_is_named_where_it_does_not_draw(
    plant, biped, monkeypatch, tmp_path
):
    find_opengl.cache_clear()
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    tried = []

    def fails(command, env, **_):
        tried.append(env["MUJOCO_GL"])
        return subprocess.CompletedProcess([], returncode=1)

    monkeypatch.setattr(subprocess, "run", fails)
    try:
        with pytest.raises(MissingExtraError, match="MUJOCO_GL=osmesa.*libosmesa6"):
            render_video(plant, np.zeros(1), biped.q_home[None], tmp_path / "x.mp4")
        assert tried == ["osmesa"]
    finally:
        find_opengl.cache_clear()


def test_without_a_screen_the_viewer_says_so(plant, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(NoDisplayError, match="--view"), open_viewer(plant):
        pass


def test_recordings_that_do_not_fit_are_refused(plant, biped, tmp_path):
    q = biped.q_home
    with pytest.raises(TargetError, match="wrong shape"):
        render_video(plant, np.zeros(2), q[None], tmp_path / "x.mp4")
    with pytest.raises(TargetError, match="go back"):
        render_video(plant, np.array([1.0, 0.0]), np.stack([q, q]), tmp_path / "x.mp4")


@pytest.mark.parametrize(
    "make",
    [
        lambda: VideoConfig(fps=0.0),
        lambda: VideoConfig(speed=-1.0),
        lambda: VideoConfig(camera=Camera.Config(width=321)),
        lambda: Camera.Config(height=0),
        lambda: Camera.Config(azimuth=float("nan")),
        lambda: Marker(position=(0.0, float("nan"), 0.0)),
    ],
)
def test_pictures_that_cannot_be_are_refused(make):
    with pytest.raises(ConfigurationError):
        make()
