"""Support polygons: where the soles that carry load stand, and how far inside the ZMP is."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull

from poise.report import SupportPhase
from poise.robots.robot import Robot, Sole


def sole_corners(
    sole: Sole, position: Float64[np.ndarray, "3"], rotation: Float64[np.ndarray, "3 3"]
) -> Float64[np.ndarray, "4 2"]:
    """Corners of a sole on the ground plane.

    Args:
        sole: the sole.
        position: its centre in the world [m].
        rotation: world_R_sole.

    Returns:
        Corners in the world, x and y [m].
    """
    half = 0.5 * np.array([sole.length, sole.width, 0.0])
    signs = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
    return (position + (signs * half) @ rotation.T)[:, :2]


def support_phases(
    robot: Robot,
    time: Float64[np.ndarray, " T"],
    planned: Mapping[str, Float64[np.ndarray, " T"]],
    poses: Mapping[str, tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, "T 3 3"]]],
) -> tuple[SupportPhase, ...]:
    """One polygon for each interval with the same soles on the ground.

    Args:
        robot: whose soles.
        time: time of each tick [s].
        planned: whether each sole counts as standing, 0 or 1 a tick.
        poses: position [m] and rotation of each sole in the world, a tick.

    Returns:
        Phases in order of time; a polygon is taken at the middle of its interval.
    """
    if not planned:
        return ()
    names = list(planned)
    pattern = np.stack([planned[name] > 0.5 for name in names], axis=1)
    changes = 1 + np.flatnonzero((pattern[1:] != pattern[:-1]).any(axis=1))
    starts: Sequence[int] = [0, *changes.tolist(), len(time)]
    phases: list[SupportPhase] = []
    for a, b in pairwise(starts):
        standing = [name for name, on in zip(names, pattern[a], strict=True) if on]
        middle = (a + b) // 2
        corners = [
            sole_corners(robot.soles[n], poses[n][0][middle], poses[n][1][middle]) for n in standing
        ]
        phases.append(
            SupportPhase(
                start=float(time[a]),
                end=float(time[b]) if b < len(time) else float(time[-1]) + 1e-9,
                vertices=_hull(np.concatenate(corners)) if corners else np.zeros((0, 2)),
                label=" + ".join(standing) or "flight",
            )
        )
    return tuple(phases)


def zmp_margins(
    time: Float64[np.ndarray, " T"],
    zmp: Float64[np.ndarray, "T 2"],
    phases: Sequence[SupportPhase],
) -> Float64[np.ndarray, " T"]:
    """Distance of the ZMP from the nearest edge of its phase's polygon, negative outside [m]."""
    margins = np.full(len(time), np.nan)
    for phase in phases:
        rows = (time >= phase.start) & (time < phase.end)
        if len(phase.vertices) < 3 or not rows.any():
            continue
        a = phase.vertices
        edge = np.roll(a, -1, axis=0) - a
        # Vertices go around counter-clockwise, so the inward normal is the edge turned left.
        normal = np.stack((-edge[:, 1], edge[:, 0]), axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        distance = np.einsum("tej,ej->te", zmp[rows][:, None, :] - a[None], normal)
        margins[rows] = distance.min(axis=1)
    return margins


def _hull(points: Float64[np.ndarray, "k 2"]) -> Float64[np.ndarray, "h 2"]:
    return points[ConvexHull(points).vertices]
