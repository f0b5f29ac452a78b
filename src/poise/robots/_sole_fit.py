"""`fit_sole`: the flat lower face of a foot, and the rectangle on it that a sole is."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from poise.errors import RobotError
from poise.robots._geometry import Balls

_DEPTH = 0.003
"""Points this little above the lowest plane count as on it [m]: edges of soles are rounded."""

_STEEPEST = np.cos(np.radians(40.0))
"""A face whose normal is further from straight down than 40 degrees is no sole."""

_FLAT_PART = 0.3
"""A flat face covers at least this part of the foot's outline from below; a wheel's does not."""

_SAME_AREA = 0.9
"""Among faces with nearly the largest area the one that points down most is the sole."""

_GRID = 60
"""Places for the rectangle's ends along the foot."""

_TURN = np.radians(8.0)
"""A foot turned less than this against forward counts as straight."""


@dataclass(frozen=True)
class SoleFit:
    """A rectangle on the flat face of a foot, in the axes the points were given in.

    Attributes:
        position: its centre [m].
        rotation: its axes as columns: x forward along the foot, y left, z up, out of the ground.
        length: along x [m].
        width: along y [m].
        outline: corners of the flat face in the rectangle's x and y [m].
        points: how many corners or balls touch the plane.
    """

    position: Float64[np.ndarray, "3"]
    rotation: Float64[np.ndarray, "3 3"]
    length: float
    width: float
    outline: Float64[np.ndarray, "k 2"]
    points: int


def fit_sole(foot: Balls, forward: Float64[np.ndarray, "3"], where: str) -> SoleFit:
    """Find the flat face that a foot stands on, and the largest rectangle in it.

    The face is the plane that touches the foot from below with the largest outline of contact;
    the rectangle lies inside this outline, along the foot.

    Args:
        foot: its shape, z up.
        forward: horizontal direction of the robot.
        where: the foot and the file, for messages.

    Raises:
        RobotError: no face is flat and large enough.
    """
    best: tuple[float, float, Float64[np.ndarray, "3"], Bool[np.ndarray, " n"]] | None = None
    for normal in _candidates(foot.centres):
        height = foot.centres @ normal + foot.radii
        near = height > height.max() - _DEPTH
        area = _area(_flat(foot.centres[near], normal))
        better = best is None or area * _SAME_AREA > best[0]
        as_large = best is not None and area > best[0] * _SAME_AREA
        if better or (as_large and best is not None and -normal[2] > best[1]):
            best = (area, float(-normal[2]), normal, near)
    whole = _area(foot.centres[:, :2])
    if best is None or best[0] <= max(_FLAT_PART * whole, 1e-6):
        raise RobotError(
            f"{where} has no flat face to stand on",
            got=f"at most {0.0 if best is None else 1e4 * best[0]:.1f} cm^2 in one plane, of "
            f"{1e4 * whole:.1f} cm^2 seen from below",
            wanted="a sole under `soles` in a description, measured on the robot",
        )
    _, _, normal, near = best
    return _rectangle(foot, normal, near, forward)


def _candidates(centres: Float64[np.ndarray, "n 3"]) -> list[Float64[np.ndarray, "3"]]:
    """Normals, pointing down, of the faces of the points' hull; straight down is one of them."""
    down = np.array([0.0, 0.0, -1.0])
    normals = [down]
    hull = _hull(centres)
    if hull is not None:
        faces = hull.equations[:, :3]
    else:
        # All in one plane, as contact balls are.
        *_, axes = np.linalg.svd(centres - centres.mean(axis=0), full_matrices=True)
        faces = np.array([axes[2], -axes[2]])
    faces = faces[faces @ down > _STEEPEST]
    _, first = np.unique(np.round(faces / 0.01), axis=0, return_index=True)
    return normals + list(faces[first])


def _flat(
    points: Float64[np.ndarray, "n 3"], normal: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "n 2"]:
    """The points seen along a normal, as two coordinates in its plane [m]."""
    x = np.cross([0.0, 1.0, 0.0], normal)
    x /= np.linalg.norm(x)
    return points @ np.stack([x, np.cross(normal, x)], axis=1)


def _hull(points: Float64[np.ndarray, "n d"]) -> Any:
    """The convex hull; None for points that lie in something flatter."""
    # It takes long to import, and only strangers need it.
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except QhullError:
        return None


def _area(points: Float64[np.ndarray, "n 2"]) -> float:
    """Area of the points' hull [m^2]."""
    hull = _hull(points) if len(points) >= 3 else None
    return 0.0 if hull is None else float(hull.volume)


def _rectangle(
    foot: Balls,
    normal: Float64[np.ndarray, "3"],
    near: Bool[np.ndarray, " n"],
    forward: Float64[np.ndarray, "3"],
) -> SoleFit:
    up = -normal
    x = forward - (forward @ up) * up
    rotation = np.stack([x, np.cross(up, x), up], axis=1) / np.linalg.norm(x)
    rotation[:, 2] = up
    touching = foot.centres[near] + foot.radii[near, None] * normal
    flat = touching @ rotation[:, :2]
    turn = _direction(flat)
    if abs(turn) > _TURN:
        c, s = np.cos(turn), np.sin(turn)
        rotation = rotation @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        flat = touching @ rotation[:, :2]
    outline = flat[_hull(flat).vertices]
    low, high = _largest_inside(outline)
    middle = 0.5 * (low + high)
    depth = float((touching @ up).min())
    return SoleFit(
        position=rotation @ np.array([middle[0], middle[1], depth]),
        rotation=rotation,
        length=float(high[0] - low[0]),
        width=float(high[1] - low[1]),
        outline=outline - middle,
        points=int(near.sum()),
    )


def _direction(flat: Float64[np.ndarray, "n 2"]) -> float:
    """How far a long outline is turned to the left [rad]; zero for one nearly as wide as long."""
    outline = flat[_hull(flat).vertices]
    best, angle = np.inf, 0.0
    for edge in np.roll(outline, -1, axis=0) - outline:
        turn = float(np.arctan2(edge[1], edge[0]))
        turn = (turn + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi
        c, s = np.cos(turn), np.sin(turn)
        along, across = outline @ [c, s], outline @ [-s, c]
        size = float(np.ptp(along) * np.ptp(across))
        if size < best * (1.0 - 1e-9) and np.ptp(along) > 1.3 * np.ptp(across):
            best, angle = size, turn
    straight = float(np.ptp(outline[:, 0]) * np.ptp(outline[:, 1]))
    # Only where the turned rectangle is clearly tighter: round toes make it lean a little.
    return angle if best < 0.93 * straight else 0.0


def _largest_inside(
    outline: Float64[np.ndarray, "k 2"],
) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
    """Opposite corners of the largest rectangle along the axes inside a convex outline [m]."""
    places = np.linspace(outline[:, 0].min(), outline[:, 0].max(), _GRID)
    # The bounds of a convex outline: between two places the wider one is never outside.
    lower = np.array([_bound(outline, x, min) for x in places])
    upper = np.array([_bound(outline, x, max) for x in places])
    bottom = np.maximum(lower[:, None], lower[None, :])
    top = np.minimum(upper[:, None], upper[None, :])
    area = (places[None, :] - places[:, None]) * np.maximum(top - bottom, 0.0)
    i, j = np.unravel_index(np.argmax(area), area.shape)
    return np.array([places[i], bottom[i, j]]), np.array([places[j], top[i, j]])


def _bound(
    outline: Float64[np.ndarray, "k 2"], x: float, choose: Callable[[list[float]], float]
) -> float:
    """The lowest or highest y of the outline at a place along it."""
    found: list[float] = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        low, high = (a, b) if a[0] <= b[0] else (b, a)
        if not low[0] - 1e-12 <= x <= high[0] + 1e-12:
            continue
        if high[0] - low[0] < 1e-12:
            found += [float(low[1]), float(high[1])]
        else:
            part = (x - low[0]) / (high[0] - low[0])
            found.append(float(low[1] + part * (high[1] - low[1])))
    return choose(found)
