"""`Snapshot`: how the robot stands, as the page shows it, some 25 times a second."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.scenarios.support import sole_corners
from poise.teleop import DeviceStatus, Mode, StepTeleoperator, TeleopStatus


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """One moment of a live run; positions in the drawn world, which is the simulator's.

    Attributes:
        time: of the robot [s].
        mode: which feet carry the robot.
        device: what became of the operator's last sample.
        zmp: measured, x and y [m].
        zmp_reference: of it [m].
        com: estimated [m].
        soles: left and right [m].
        hands: likewise [m].
        target: where the foot in the air is sent [m].
        polygon: the support polygon's corners, counter-clockwise [m].
        margin: of the ZMP to the polygon's nearest edge, negative outside [m].
        loads: on the soles, left and right [N].
        tilt: of the torso [rad].
        bodies: where each body of the simulator is [m].
        turns: and how it is turned, (w, x, y, z).
        fallen: whether the robot fell.
        paused: whether time stands still.
        speed: robot time over wall-clock time that is asked for.
        real_time_factor: what the last second reached of that speed.
        take: name of the recording.
    """

    time: float
    mode: Mode
    device: DeviceStatus
    zmp: Float64[np.ndarray, "2"]
    zmp_reference: Float64[np.ndarray, "2"]
    com: Float64[np.ndarray, "3"]
    soles: Float64[np.ndarray, "2 3"]
    hands: Float64[np.ndarray, "2 3"]
    target: Float64[np.ndarray, "3"] | None
    polygon: Float64[np.ndarray, "h 2"]
    margin: float
    loads: Float64[np.ndarray, "2"]
    tilt: float
    bodies: Float64[np.ndarray, "B 3"]
    turns: Float64[np.ndarray, "B 4"]
    fallen: bool
    paused: bool
    speed: float
    real_time_factor: float
    take: str


def support_polygon(
    controller: StepTeleoperator, status: TeleopStatus
) -> Float64[np.ndarray, "h 2"]:
    """The corners of what the robot stands on, in the controller's world.

    Args:
        controller: knows where the soles are and how they are turned.
        status: of the last tick.

    Returns:
        x and y, counter-clockwise [m].
    """
    robot, dynamics = controller.robot, controller.estimator.dynamics
    feet = [status.mode.support] if status.mode.single else [0, 1]
    corners: list[np.ndarray] = []
    for foot in feet:
        assert foot is not None
        name = controller.soles[foot]
        frame = dynamics.frame(robot.frame_id(name))
        corners.append(sole_corners(robot.soles[name], frame.position, frame.rotation))
    return _hull(np.concatenate(corners))


def distance_inside(polygon: Float64[np.ndarray, "h 2"], point: Float64[np.ndarray, "2"]) -> float:
    """Distance of a point to the nearest edge of a convex polygon, negative outside [m].

    Args:
        polygon: its corners, counter-clockwise [m].
        point: [m].
    """
    edges = np.roll(polygon, -1, axis=0) - polygon
    inward = np.column_stack((-edges[:, 1], edges[:, 0]))
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    return float(np.min(np.sum((point - polygon) * inward, axis=1)))


def _hull(points: Float64[np.ndarray, "k 2"]) -> Float64[np.ndarray, "h 2"]:
    """The convex hull, counter-clockwise; for eight points this is quicker than to call qhull."""
    ordered = sorted(points.tolist())

    def chain(way: Iterable[list[float]]) -> list[list[float]]:
        found: list[list[float]] = []
        for x, y in way:
            while len(found) > 1:
                (a, b), (c, d) = found[-2:]
                if (c - a) * (y - b) - (d - b) * (x - a) > 0.0:
                    break
                found.pop()
            found.append([x, y])
        return found[:-1]

    return np.array(chain(ordered) + chain(reversed(ordered)))
