"""`write_page`: a proposed description to look at, with the trial's outcome."""

import base64
import io
import re
from html import escape
from pathlib import Path

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import html_table, new_figure
from poise.apps.onboarding._trial import Trial
from poise.apps.report import house_style, html_document, inline_svg
from poise.robots import Proposal, Robot
from poise.sim import Camera, Marker, Plant, find_opengl

_VIEWS = (("from the front left", 145.0), ("from the left", 90.0))  # [deg]
_BLUE, _ORANGE = (0.0, 0.45, 0.7, 1.0), (0.85, 0.35, 0.0, 1.0)


def write_page(robot: Robot, proposal: Proposal, trial: Trial | None, path: Path) -> None:
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
    verdict = ""
    if trial is not None:
        kind, words = ("good", "does what was tried") if trial.ok else ("bad", "see what is wrong")
        verdict = f'<span class="verdict {kind}">{words}</span>'
    body = [
        f'<header><div class="wide"><div class="title"><h1>{escape(robot.name)} '
        f"<span>{robot.nj} joints, {robot.mass:.1f} kg</span></h1>{verdict}</div>"
        f'<p class="description">{escape(proposal.summary)}</p></div></header><main class="wide">'
    ]
    if notes := "".join(f"<li>{escape(remark)}</li>" for remark in proposal.remarks):
        notes = f"<h2>Odd about this file</h2><ul>{notes}</ul>"
        body.append(f'<section class="notes">{notes}</section>')
    sections = {"Home posture": _pictures(robot, places, com)}
    if robot.soles:
        sections["Soles from above"] = _soles(robot, proposal, places, com)
    if trial is not None:
        sections["In simulation"] = _attempts(trial)
    sections["Limits"] = _limits(robot, proposal)
    sections["Description"] = f"<pre>{escape(proposal.text)}</pre>"
    body += [f"<section><h2>{name}</h2>{what}</section>" for name, what in sections.items()]
    path.write_text(html_document(f"{robot.name}, described", [*body, "</main>"]), encoding="utf-8")


def _pictures(robot: Robot, places: dict[str, pin.SE3], com: Float64[np.ndarray, "3"]) -> str:
    """The robot at home with its frames and COM; as lines where this machine cannot draw it."""
    if find_opengl() is None:
        with house_style():
            return inline_svg(robot.show(), "robot", "Joints, frames and COM at home")
    from matplotlib.image import imsave

    def triple(point: Float64[np.ndarray, "3"]) -> tuple[float, float, float]:
        return float(point[0]), float(point[1]), float(point[2])

    markers = [Marker(position=triple(com), radius=0.03, colour=_ORANGE)]
    for place in places.values():
        arrows = (triple(0.1 * place.rotation[:, axis]) for axis in (0, 2))
        at = triple(place.translation)
        markers += [Marker(position=at, arrow=a, radius=0.012, colour=_BLUE) for a in arrows]
    model = Plant(robot).drawn_model()
    shown = '<p class="how">Orange: the COM. Blue: x and z of soles, hands, pelvis and torso.</p>'
    for label, azimuth in _VIEWS:
        file = io.BytesIO()
        config = Camera.Config(width=560, height=520, azimuth=azimuth)
        with Camera(robot, model, config) as camera:
            imsave(file, camera.picture(robot.q_home, markers), format="png")
        data = base64.b64encode(file.getvalue()).decode()
        shown += f'<img alt="{escape(robot.name)} {label}" src="data:image/png;base64,{data}">'
    return shown


def _soles(
    robot: Robot, proposal: Proposal, places: dict[str, pin.SE3], com: Float64[np.ndarray, "3"]
) -> str:
    """Flat face and rectangle of each sole, and the COM."""
    with house_style():
        figure = new_figure(7.0, 4.0)
        panel = figure.subplots()
        for name, sole in robot.soles.items():
            half = 0.5 * np.array([sole.length, sole.width])
            rectangle = half * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 1]])
            face = proposal.outlines.get(name, rectangle)
            at, turn = places[name].translation[:2], places[name].rotation[:2, :2].T
            panel.fill(*(at + face @ turn).T[::-1], color="#d9e2ec")
            y, x = (at + rectangle @ turn).T[::-1]
            panel.plot(y, x, color="#0072b2")
        panel.plot(com[1], com[0], "o", color="#d55e00")
        panel.set(aspect="equal", xlabel="y, left [m]", ylabel="x, ahead [m]")
        panel.invert_xaxis()
        how = '<p class="how">Orange: the COM. Blue: soles. Grey: flat faces of the feet.</p>'
        return how + inline_svg(figure, "soles", "Soles from above")


def _attempts(trial: Trial) -> str:
    rows: list[tuple[str, ...]] = []
    for tried in trial.attempts:
        off = f"{1e3 * (tried.figures['com_error_max_m'] or 0.0):.1f} mm"
        torque = f"{100.0 * tried.figures['torque_ratio_max']:.0f} % at {tried.weakest}"
        rows.append((tried.name, "; ".join(tried.words) or "well", off, torque))
    return html_table("", ("tried", "how it went", "COM off", "largest torque"), rows)


def _limits(robot: Robot, proposal: Proposal) -> str:
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
    head = ("joint", "range [rad]", "home [rad]", "speed [rad/s]", "torque [N m]", "rotor [kg m^2]")
    return html_table("", head, list(zip(robot.joint_names, *columns.values(), strict=True)))
