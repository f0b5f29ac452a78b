"""Geometry of the support polygon: bounds over time, and the distance of a point to its edges."""

import numpy as np
from jaxtyping import Float64

from poise.report.record import RunRecord


def signed_margin(
    points: Float64[np.ndarray, "n 2"], vertices: Float64[np.ndarray, "k 2"]
) -> Float64[np.ndarray, " n"]:
    """Distance of points to the boundary of a convex polygon, positive inside [m].

    Args:
        points: the points [m].
        vertices: corners in order around the polygon, either way round [m].

    Returns:
        Distances [m]; NaN for a NaN point, and for a polygon without corners. One or two corners
        make a point or a line, of which everything is outside.
    """
    if len(vertices) == 0:
        return np.full(len(points), np.nan)
    edge = np.roll(vertices, -1, axis=0) - vertices  # [m]
    offset = points[:, None, :] - vertices[None, :, :]
    length2 = np.maximum(np.sum(edge**2, axis=1), 1e-18)  # [m^2]
    along = np.clip(np.sum(offset * edge, axis=2) / length2, 0.0, 1.0)
    distance = np.linalg.norm(offset - along[:, :, None] * edge, axis=2).min(axis=1)
    side = edge[:, 0] * offset[:, :, 1] - edge[:, 1] * offset[:, :, 0]  # [m^2]
    inside = (side >= 0.0).all(axis=1) | (side <= 0.0).all(axis=1)
    flat = len(vertices) < 3
    return np.where(inside & (not flat), distance, -distance)


def support_over_time(
    record: RunRecord,
) -> tuple[Float64[np.ndarray, "T 2"], Float64[np.ndarray, "T 2"], Float64[np.ndarray, " T"]]:
    """Least and greatest x, y of the support polygon, and the ZMP's margin in it, tick by tick.

    Returns:
        Lower bounds, upper bounds and margin [m]; NaN where nothing touches the ground.
    """
    low = np.full((len(record.time), 2), np.nan)
    high, margin = low.copy(), np.full(len(record.time), np.nan)
    for phase in record.support:
        if len(phase.vertices) == 0:
            continue
        last = phase is record.support[-1]
        ticks = (record.time >= phase.start) & (
            (record.time <= phase.end) if last else (record.time < phase.end)
        )
        low[ticks], high[ticks] = phase.vertices.min(axis=0), phase.vertices.max(axis=0)
        margin[ticks] = signed_margin(record.zmp[ticks], phase.vertices)
    return low, high, margin
