"""`write_page`: a proposed description to look at, with the trial's outcome."""

import base64
import io
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import new_figure
from poise.apps.onboarding._trial import Attempt, Tryout
from poise.apps.pages import house_style, inline_svg, render_page, replace_file
from poise.robots import Proposal, Robot
from poise.sim import Camera, Marker, Plant, find_opengl


def write_page(robot: Robot, proposal: Proposal, trial: Tryout | None, path: Path) -> None:
    """Write a page that refers to nothing outside itself.

    Args:
        robot: as the proposal describes it.
        proposal: what was guessed, with reasons.
        trial: how it did in simulation; None where it was not tried.
        path: the file to write.
    """
    data = robot.model.createData()
    com = pin.centerOfMass(robot.model, data, robot.q_home)
    pin.updateFramePlacements(robot.model, data)
    places = {name: data.oMf[robot.frame_id(name)] for name in robot.roles}
    words = "does what was tried" if trial is not None and trial.ok else "see what is wrong"
    drawn = find_opengl() is not None
    with house_style():
        page = render_page(
            "describe.html.j2",
            robot=robot,
            proposal=proposal,
            verdict=None if trial is None else (words, trial.ok),
            facts=(),
            pictures=_pictures(robot, places, com) if drawn else [],
            # Lines where this machine cannot draw the robot.
            lines="" if drawn else inline_svg(robot.show(), "robot", "Joints and frames at home"),
            soles=_soles(robot, proposal, places, com) if robot.soles else "",
            attempts=None if trial is None else [_attempt(tried) for tried in trial.attempts],
            limits=_limits(robot, proposal),
        )
    replace_file(path, page)


def _pictures(
    robot: Robot, places: Mapping[str, pin.SE3], com: Float64[np.ndarray, "3"]
) -> list[tuple[str, str]]:
    """The robot at home with its frames and CoM: words, and a PNG file in base64."""
    from matplotlib.image import imsave

    def triple(point: Float64[np.ndarray, "3"]) -> tuple[float, float, float]:
        return float(point[0]), float(point[1]), float(point[2])

    blue, orange = (0.0, 0.45, 0.7, 1.0), (0.85, 0.35, 0.0, 1.0)
    below = (float(com[0]), float(com[1]), 0.0)
    markers = [Marker(position=below, radius=0.03, colour=orange)]
    for place in places.values():
        arrows = (triple(0.1 * place.rotation[:, axis]) for axis in (0, 2))
        at = triple(place.translation)
        markers += [Marker(position=at, arrow=a, radius=0.012, colour=blue) for a in arrows]
    model = Plant(robot).drawn_model()
    pictures: list[tuple[str, str]] = []
    for label, azimuth in (("from the front left", 145.0), ("from the left", 90.0)):
        file = io.BytesIO()
        config = Camera.Config(width=560, height=520, azimuth=azimuth)
        with Camera(robot, model, config) as camera:
            imsave(file, camera.picture(robot.q_home, markers), format="png")
        pictures.append((label, base64.b64encode(file.getvalue()).decode()))
    return pictures


def _soles(
    robot: Robot, proposal: Proposal, places: Mapping[str, pin.SE3], com: Float64[np.ndarray, "3"]
) -> str:
    """Flat face and rectangle of each sole, and the CoM."""
    figure = new_figure(4.4, 4.2)
    panel = figure.subplots()
    for name, sole in robot.soles.items():
        half = 0.5 * np.array([sole.length, sole.width])
        rectangle = half * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 1]])
        face = proposal.outlines.get(name, rectangle)
        at, turn = places[name].translation[:2], places[name].rotation[:2, :2].T
        panel.fill(*(at + face @ turn).T[::-1], color="#d9e2ec")
        panel.plot(*(at + rectangle @ turn).T[::-1], color="C0")
    panel.plot(com[1], com[0], "o", color="C1")
    panel.set(aspect="equal", xlabel="y, left [m]", ylabel="x, ahead [m]")
    panel.invert_xaxis()
    return inline_svg(figure, "soles", "Soles from above")


def _attempt(tried: Attempt) -> tuple[str, ...]:
    off = f"{1e3 * (tried.figures['com_error_max_m'] or 0.0):.1f} mm"
    torque = f"{100.0 * tried.figures['torque_ratio_max']:.0f} % at {tried.weakest}"
    return tried.name, "; ".join(tried.words) or "well", off, torque


def _limits(robot: Robot, proposal: Proposal) -> list[tuple[str, ...]]:
    """Limits by joint; those that are guessed are marked."""
    facts, nj = proposal.facts, robot.nj
    guessed = {**facts.get("limits", {}), "armature": facts.get("armature", {})}
    columns = {
        "position": [f"{a:.2f} to {b:.2f}" for a, b in zip(robot.q_min, robot.q_max, strict=True)],
        "home": [f"{angle:.3f}" for angle in robot.q_home[-nj:]],
        "velocity": [f"{limit:.3g}" for limit in robot.v_max],
        "torque": [f"{limit:.3g}" for limit in robot.tau_max],
        "armature": [f"{rotor:.2g}" for rotor in robot.model.armature[-nj:]],
    }
    for key, cells in columns.items():
        for i, joint in enumerate(robot.joint_names):
            assumed = any(re.fullmatch(pattern, joint) for pattern in guessed.get(key, ()))
            cells[i] += " (assumed)" if assumed else ""
    return list(zip(robot.joint_names, *columns.values(), strict=True))
