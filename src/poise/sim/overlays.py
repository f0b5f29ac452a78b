"""What is drawn into the video of a recorded run: centre of mass, zero-moment point, forces."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.robots.robot import Robot
from poise.sim.markers import COM_COLOUR, ZMP_COLOUR, Colour, Marker, force_marker
from poise.sim.recorder import Recorder

_BODY_WEIGHT_LENGTH = 0.45
"""Length of the arrow of a force as large as the robot's weight [m]."""

_SMALLEST_FORCE = 0.02
"""Forces below this part of the robot's weight are not drawn."""

_BEFORE_TOES = 0.06
"""How far before the foot its force is drawn [m]."""

_ABOVE_GROUND = 0.005
"""Points on the ground are drawn this high [m], so that half of each ball stands out."""


def run_markers(robot: Robot, recorder: Recorder) -> Callable[[int], tuple[Marker, ...]]:
    """Markers for each sample of a run: COM (orange), ZMP (magenta), sole forces (blue arrows).

    The centre of mass is drawn as its projection on the ground. Forces are drawn before the toes:
    at the sole's centre, where they act, the leg would hide them.

    Args:
        robot: the robot.
        recorder: the run, as `Recorder.record` recorded it.

    Returns:
        The function that `render_video` takes as `markers`.

    Raises:
        UnknownNameError: the run was not recorded with `Recorder.record`.
    """
    qs, coms, zmps = recorder["q"], recorder["com"], recorder["zmp"]
    wrenches = {name: recorder[f"wrench/{name}"] for name in robot.soles}
    data = robot.model.createData()
    weight = robot.mass * 9.81

    def markers(index: int) -> tuple[Marker, ...]:
        pin.framesForwardKinematics(robot.model, data, qs[index])
        found = [_ground_point(coms[index], COM_COLOUR), _ground_point(zmps[index], ZMP_COLOUR)]
        for name, wrench in wrenches.items():
            world_T_sole = data.oMf[robot.frame_id(name)]
            force = world_T_sole.rotation @ wrench[index, :3]
            toes = np.array([0.5 * robot.soles[name].length + _BEFORE_TOES, 0.0, 0.0])
            if np.linalg.norm(force) > _SMALLEST_FORCE * weight:
                scale = _BODY_WEIGHT_LENGTH / weight
                found.append(force_marker(world_T_sole.act(toes), force, scale))
        return tuple(marker for marker in found if marker is not None)

    return markers


def _ground_point(point: Float64[np.ndarray, " n"], colour: Colour) -> Marker | None:
    x, y = float(point[0]), float(point[1])
    if not np.isfinite([x, y]).all():
        return None
    return Marker(position=(x, y, _ABOVE_GROUND), colour=colour)
