"""Draw the looping clips of the gallery: scenarios that come with Poise, as animated WebP files.

    python docs/images/gallery.py [NAME ...]

Needs the extras `sim` and `robots`, and OpenGL without a screen.
"""

import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

import poise

HERE = Path(__file__).parent
RATE = 12.0
"""Pictures a second: smooth enough for a walk, and a clip stays below 300 kB."""


class Clip(NamedTuple):
    """A part of a scenario's run, from `begin` to `end` [s], seen from `azimuth` [deg]."""

    scenario: str
    robot: str
    begin: float
    end: float
    azimuth: float = 145.0
    controller: str = "whole_body"


CLIPS = {
    "walk": Clip("walk", "g1", 3.0, 8.6, 120.0, "reduced"),
    "obstacle": Clip("over_an_obstacle", "biped20", 2.0, 8.4),
    "push": Clip("push", "g1", 3.6, 6.6, 150.0),
    "reach": Clip("reach", "humanoid33", 0.0, 8.0),
    "squat": Clip("squat", "humanoid33", 0.0, 6.0),
    "one_leg": Clip("balance_one_leg", "humanoid33", 1.0, 9.0),
}


def draw(name: str, clip: Clip) -> None:
    """Run a scenario up to the end of its clip, and write the clip."""
    scenario = replace(poise.load_scenario(clip.scenario), robot=clip.robot)
    if scenario.devices is None:
        plan = replace(scenario.controller, name=clip.controller)
        scenario = replace(scenario, controller=plan)
    run = poise.run_scenario(scenario)
    times, qs = run.record.signal("q")
    shown = np.searchsorted(times, np.arange(clip.begin, clip.end, 1.0 / RATE))
    config = poise.sim.Camera.Config(
        width=320, height=320, azimuth=clip.azimuth, elevation=-10.0, distance=1.5, antialiasing=4
    )
    with poise.sim.Camera(run.robot, run.plant.drawn_model(), config) as camera:
        frames = [Image.fromarray(camera.picture(qs[i], dt=1.0 / RATE)) for i in shown]
    file = HERE / f"clip_{name}.webp"
    frames[0].save(
        file,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000.0 / RATE),
        loop=0,
        quality=45,
        method=4,
    )
    print(file.name, len(frames), "pictures,", file.stat().st_size, "bytes", flush=True)


if __name__ == "__main__":
    for chosen in sys.argv[1:] or CLIPS:
        draw(chosen, CLIPS[chosen])
