"""`draw_robot`: a robot as lines, from the front and from the right."""

from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import new_figure
from poise.robots._robot import Robot


def draw_robot(robot: Robot, q: Float64[np.ndarray, " nq"]) -> Any:
    """A matplotlib figure: links as lines between joints, soles, hands, pelvis, torso and CoM."""
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    com = pin.centerOfMass(model, data, q)
    figure = new_figure(7.0, 5.0)
    figure.suptitle(repr(robot), fontsize=9)
    views = ("from the front", 1, "y [m]"), ("from the right", 0, "x [m]")
    for axes, (title, across, label) in zip(figure.subplots(1, 2), views, strict=True):
        for joint in range(2 if robot.floating_base else 1, model.njoints):
            ends = np.array(
                [data.oMi[model.parents[joint]].translation, data.oMi[joint].translation]
            )
            axes.plot(ends[:, across], ends[:, 2], color="0.3", marker="o", markersize=3)
        _draw_frames(axes, robot, data, across)
        axes.plot(com[across], com[2], "o", color="tab:orange", label="CoM")
        axes.margins(x=0.3)
        _widen(axes)
        axes.set(title=title, xlabel=label, ylabel="z [m]", aspect="equal")
    figure.axes[0].legend(fontsize=7, loc="upper right")
    return figure


def _widen(axes: Any, share: float = 0.4) -> None:
    """Widen the view of a slender robot to a share of its height: three labels fit below it."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    half = max(0.5 * (right - left), share * 0.5 * (high - low))
    axes.set_xlim(0.5 * (left + right) - half, 0.5 * (left + right) + half)
    axes.locator_params(axis="x", nbins=3)


def _draw_frames(axes: Any, robot: Robot, data: pin.Data, across: int) -> None:
    """Lines from the last joint to each sole, hand, pelvis and torso, and the soles' lengths."""
    for name in (*robot.soles, *robot.hands, robot.pelvis, robot.torso):
        index = robot.frame_id(name)
        place = data.oMf[index]
        joint = data.oMi[robot.model.frames[index].parentJoint].translation
        ends = np.array([joint, place.translation])
        axes.plot(ends[:, across], ends[:, 2], color="0.6", linestyle=":")
        sole = robot.soles.get(name)
        if sole is None:
            axes.plot(*place.translation[[across, 2]], "s", color="tab:green", markersize=4)
            continue
        signs = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
        half = 0.5 * signs * [sole.length, sole.width]
        corners = np.array([place.act(np.array([x, y, 0.0])) for x, y in half])
        axes.plot(corners[:, across], corners[:, 2], color="tab:blue", linewidth=3)
