"""Draws the documentation's pictures: moments of the main job, its report, and the live page.

    poise run && python docs/images/draw.py

The moments need OpenGL, the report and the live page a chromium on the path.
"""

import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

import poise
from poise.apps.live import LiveSession
from poise.apps.teleoperation import SCRIPTS, TORQUE_TELEOP_PLANT, terrain_blocks

HERE = Path(__file__).parent
RUNS = Path("runs")
MAIN = "over_an_obstacle-biped20"
STEPS = (0.5, 2.6, 4.2, 6.5, 9.3, 11.0, 13.9)
"""Moments of the main job [s]."""


def draw_obstacle() -> None:
    """The main job, moment by moment."""
    robot = poise.load_robot("biped20")
    log = poise.sim.read_log(RUNS / MAIN / "log.mcap")
    plant = poise.Plant(
        robot, poise.sim.PlantConfig(blocks=SCRIPTS["over_an_obstacle"](robot).blocks)
    )
    config = poise.sim.Camera.Config(
        width=270, height=420, azimuth=140.0, elevation=-12.0, distance=1.75, antialiasing=4
    )
    with poise.sim.Camera(robot, plant.drawn_model(), config) as camera:
        frames = [camera.picture(_at(log, "q", t)) for t in STEPS]
    _save(Image.fromarray(np.concatenate(frames, axis=1)), "obstacle.jpg")


def draw_report() -> None:
    """The main job's page, as a browser shows it."""
    folder = RUNS / MAIN
    browser = _browser()
    with tempfile.TemporaryDirectory() as place:
        shot = Path(place) / "page.png"
        page = (folder / "report.html").resolve().as_uri()
        options = ["--headless", "--no-sandbox", "--use-gl=swiftshader", "--hide-scrollbars"]
        options += ["--enable-unsafe-swiftshader", "--window-size=1200,1500"]
        options += ["--virtual-time-budget=5000", f"--screenshot={shot}"]
        subprocess.run([browser, *options, page], check=True, capture_output=True, timeout=120)
        _save(Image.open(shot).convert("RGB"), "report.jpg")


def draw_teleop() -> None:
    """The page of `poise teleop`, with a foot held up."""
    browser = _browser()
    robot = poise.load_robot("biped20")
    plant = replace(TORQUE_TELEOP_PLANT, blocks=terrain_blocks("obstacle", robot))
    options = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]
    with (
        tempfile.TemporaryDirectory() as folder,
        LiveSession(robot, folder, plant=plant) as session,
        sync_playwright() as play,
    ):
        page = play.chromium.launch(executable_path=browser, args=options).new_page(
            viewport={"width": 1280, "height": 800}, bypass_csp=True
        )
        page.goto(session.front.drive_url)
        page.wait_for_function("newest !== null && 'mode' in newest")
        for _ in range(10):
            # A machine that draws without a graphics card may lose the page in mid-step.
            page.keyboard.up("q")
            page.wait_for_timeout(1000)
            page.keyboard.down("q")
            page.wait_for_timeout(6000)
            if page.evaluate("newest.mode === 'SR' && newest.soles[0][2] > 0.05"):
                break
        else:
            sys.exit("no foot was lifted: the machine is too busy to draw the live page")
        # The plots are some seconds long.
        page.wait_for_timeout(4000)
        shot = Path(folder) / "page.png"
        page.screenshot(path=shot)
        page.keyboard.up("q")
        _save(Image.open(shot).convert("RGB"), "teleop.jpg")


def _browser() -> str:
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        sys.exit("no chromium on the path")
    return browser


def _at(log: poise.sim.RunRecord, name: str, time: float) -> np.ndarray:
    times, values = log.signal(name)
    return values[np.searchsorted(times, time)]


def _save(image: Image.Image, name: str) -> None:
    image.save(HERE / name, quality=85, optimize=True, progressive=True)
    print(name, image.size, (HERE / name).stat().st_size, "bytes")


if __name__ == "__main__":
    draw_obstacle()
    draw_report()
    draw_teleop()
