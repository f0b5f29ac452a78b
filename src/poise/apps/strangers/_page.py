"""`write_page`: what was guessed about a robot, to look at, with how it did in simulation."""

import base64
import io
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.apps.report import house_style, html_document, inline_svg
from poise.apps.strangers._trial import Trial
from poise.robots import Proposal, Robot
from poise.sim import Camera, Marker, Plant, find_opengl

_VIEWS = (("from the front left", 145.0), ("from the left", 90.0))
"""Directions of the pictures [deg]."""

_FRAME_COLOUR, _COM_COLOUR = (0.0, 0.45, 0.7, 1.0), (0.85, 0.35, 0.0, 1.0)


def write_page(robot: Robot, proposal: Proposal, trial: Trial | None, path: Path) -> None:
    """Write a page that refers to nothing outside itself.

    Args:
        robot: as the proposal describes it.
        proposal: what was guessed, with reasons.
        trial: how it did in simulation; None where it was not tried.
        path: the file to write.
    """
    body = [
        _head(robot, proposal, trial),
        '<main class="wide">',
        _notes(proposal.remarks),
        _section("Home posture", _pictures(robot), _frames_svg(robot)),
        _section("Soles", _soles_svg(robot, proposal)) if robot.soles else "",
        _section("In simulation", _trial_table(trial)) if trial is not None else "",
        _section("Limits", _limits_table(robot, proposal)),
        _section("Description", f"<pre>{escape(proposal.text)}</pre>"),
        "</main>",
    ]
    path.write_text(html_document(f"{robot.name}, described", body), encoding="utf-8")


def _head(robot: Robot, proposal: Proposal, trial: Trial | None) -> str:
    verdict = ""
    if trial is not None:
        kind, words = ("good", "does what was tried") if trial.ok else ("bad", "see what is wrong")
        verdict = f'<span class="verdict {kind}">{words}</span>'
    return (
        f'<header><div class="wide"><div class="title"><h1>{escape(robot.name)} '
        f"<span>{robot.nj} joints, {robot.mass:.1f} kg</span></h1>{verdict}</div>"
        f'<p class="description">{escape(proposal.summary)}</p></div></header>'
    )


def _notes(remarks: Sequence[str]) -> str:
    if not remarks:
        return ""
    items = "".join(f"<li>{escape(remark)}</li>" for remark in remarks)
    return f'<section class="notes"><h2>Odd about this file</h2><ul>{items}</ul></section>'


def _section(title: str, *content: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{''.join(content)}</section>"


def _places(robot: Robot) -> tuple[dict[str, pin.SE3], Float64[np.ndarray, "3"]]:
    """Frames with a part to play, and the COM, at home."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_home)
    com = pin.centerOfMass(robot.model, data, robot.q_home)
    return {name: data.oMf[robot.frame_id(name)].copy() for name in robot.roles}, np.array(com)


def _pictures(robot: Robot) -> str:
    """The robot at home with its frames and COM, where this machine can draw it."""
    if find_opengl() is None:
        return '<p class="how">No pictures: this machine cannot draw without a screen.</p>'
    places, com = _places(robot)
    markers = [Marker(position=_triple(com), radius=0.03, colour=_COM_COLOUR)]
    for place in places.values():
        markers += [
            Marker(
                position=_triple(place.translation),
                arrow=_triple(0.1 * place.rotation[:, axis]),
                radius=0.012,
                colour=_FRAME_COLOUR,
            )
            for axis in (0, 2)
        ]
    shown: list[str] = []
    plant = Plant(robot)
    for label, azimuth in _VIEWS:
        config = Camera.Config(width=560, height=520, azimuth=azimuth)
        with Camera(robot, plant.model, config) as camera:
            picture = _png(camera.picture(robot.q_home, markers))
        shown.append(f'<img alt="{escape(robot.name)} {label}" src="{picture}">')
    return (
        '<p class="how">Orange: the COM. Blue: frames with a part to play, x and z.</p>'
        f'<div style="display:flex;flex-wrap:wrap;gap:1rem">{"".join(shown)}</div>'
    )


def _triple(point: Float64[np.ndarray, "3"]) -> tuple[float, float, float]:
    return float(point[0]), float(point[1]), float(point[2])


def _png(picture: Any) -> str:
    from matplotlib.image import imsave

    file = io.BytesIO()
    imsave(file, picture, format="png")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def _frames_svg(robot: Robot) -> str:
    """Joints as a stick figure, frames and COM, from the front and from the side."""
    places, com = _places(robot)
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, robot.q_home)

    def paint(canvas: Any) -> None:
        panels = canvas.subplots(1, 2)
        for panel, axis, label in zip(panels, (1, 0), ("y, left [m]", "x, ahead [m]"), strict=True):
            for joint in range(2, model.njoints):
                ends = np.array(
                    [data.oMi[j].translation for j in (int(model.parents[joint]), joint)]
                )
                panel.plot(ends[:, axis], ends[:, 2], color="#9aa5b1", linewidth=2.0)
            for name, place in places.items():
                point = place.translation
                panel.plot(point[axis], point[2], "o", color="#0072b2", markersize=4)
                panel.annotate(name, (point[axis], point[2]), fontsize=7, xytext=(4, 2),
                               textcoords="offset points")  # fmt: skip
            panel.plot(com[axis], com[2], "o", color="#d55e00")
            panel.plot([com[axis]] * 2, [0.0, com[2]], color="#d55e00", linewidth=0.8)
            panel.set_aspect("equal")
            panel.set_xlabel(label)
            panel.set_ylabel("z [m]")
        panels[0].invert_xaxis()

    return _drawn("frames", "Joints, frames and COM at home", paint, (9.0, 5.0))


def _soles_svg(robot: Robot, proposal: Proposal) -> str:
    """Both soles from above: flat face, rectangle, COM."""
    places, com = _places(robot)

    def paint(canvas: Any) -> None:
        panel = canvas.subplots()
        for name, sole in robot.soles.items():
            place = places[name]
            outline = proposal.outlines.get(name)
            if outline is not None:
                points = _on_ground(place, outline)
                panel.fill(points[:, 1], points[:, 0], color="#d9e2ec", label="flat face")
            half = 0.5 * np.array([sole.length, sole.width])
            corners = half * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 1]])
            points = _on_ground(place, corners)
            panel.plot(points[:, 1], points[:, 0], color="#0072b2", label="sole")
        panel.plot(com[1], com[0], "o", color="#d55e00", label="COM")
        panel.set_aspect("equal")
        panel.set_xlabel("y, left [m]")
        panel.set_ylabel("x, ahead [m]")
        panel.invert_xaxis()
        handles, labels = panel.get_legend_handles_labels()
        single = dict(zip(labels, handles, strict=True))
        panel.legend(single.values(), single.keys(), loc="center")

    return _drawn("soles", "Soles from above", paint, (7.0, 4.0))


def _on_ground(place: pin.SE3, points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, "n 2"]:
    return (place.translation + points @ place.rotation[:, :2].T)[:, :2]


def _drawn(name: str, label: str, paint: Any, size: tuple[float, float]) -> str:
    with house_style():
        from matplotlib.figure import Figure

        canvas = Figure(figsize=size, layout="constrained")
        paint(canvas)
        return inline_svg(canvas, name, label)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    lines = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows)
    return f"<table><tr>{top}</tr>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _trial_table(trial: Trial) -> str:
    rows = [
        (
            attempt.name,
            "well" if attempt.ok else "; ".join(attempt.words),
            f"{1e3 * attempt.com_error:.1f} mm",
            f"{100.0 * attempt.torque_ratio:.0f} % at {attempt.weakest}",
        )
        for attempt in trial.attempts
    ]
    return _table(("tried", "how it went", "COM off, level", "largest torque"), rows)


def _limits_table(robot: Robot, proposal: Proposal) -> str:
    limits = proposal.facts.get("limits", {})
    rotor = proposal.facts.get("armature", {})
    offset = robot.nv - robot.nj

    def marked(text: str, guessed: bool) -> str:
        return f"{text} (assumed)" if guessed else text

    rows = [
        (
            name,
            marked(
                f"{robot.q_min[i]:.2f} to {robot.q_max[i]:.2f}", name in limits.get("position", {})
            ),
            f"{robot.q_home[robot.nq - robot.nj + i]:.3f}",
            marked(f"{robot.v_max[i]:.3g}", name in limits.get("velocity", {})),
            marked(f"{robot.tau_max[i]:.3g}", name in limits.get("torque", {})),
            marked(f"{robot.model.armature[offset + i]:.2g}", name in rotor),
        )
        for i, name in enumerate(robot.joint_names)
    ]
    head = ("joint", "range [rad]", "home [rad]", "speed [rad/s]", "torque [N m]",
            "rotor [kg m^2]")  # fmt: skip
    return _table(head, rows)
