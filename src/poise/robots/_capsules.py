"""`LinkCapsules`: a robot's links as capsules, and which pairs of them can come near each other.

Capsules have a distance in closed form that is smooth wherever they are apart.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise.robots._geometry import Balls, link_shapes, union
from poise.robots._once import once_a_robot
from poise.robots._robot import Robot

_MOST_STRIPS = 3
"""Capsules side by side that stand for a flat link at most."""

_SMALLEST = 0.01
"""Links of no greater extent than this have no capsule [m]: screws, sensors, frames."""

_STICK = 0.12
"""Radius of a link without any geometry, as a part of its length."""

_NEIGHBOURS, _COMPOUND = 2, 0.1
"""Links with so many joints between them or fewer, or joints no further apart than this [m], are
kept apart by their joints' limits."""

_POSTURES, _REACH, _MOST = 100, 0.5, 0.5
"""Random postures, half way at most from home to the joints' limits, in the larger part of which
capsules that overlap are taken to be drawn into each other."""

_RANGE, _FAR = 300, 0.15
"""Random postures within the joints' limits in all of which capsules that stay farther apart than
this never come near each other [m]."""

_FEW, _SHALLOW = 5, 0.04
"""Joints between two links that so many random postures try out well; if their capsules, which are
larger than the links, never overlap by more than this then [m], joint limits keep them apart."""

_LEAST_AT_HOME = -0.01
"""Capsules that overlap by more than this at home say nothing about their links [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkCapsules:
    """Capsules that hold a robot's links, fixed to its joints.

    Attributes:
        joints: Pinocchio's index of the joint that carries each capsule.
        names: of the link that each one stands for, as the document has it.
        starts: one end of each capsule's axis in its joint [m].
        ends: the other one [m].
        radii: of the capsules [m].
        pairs: pairs of capsules that can come near each other.
        at_home: distance of each pair in the home posture [m].
    """

    joints: Int64[np.ndarray, " k"]
    names: tuple[str, ...]
    starts: Float64[np.ndarray, "k 3"]
    ends: Float64[np.ndarray, "k 3"]
    radii: Float64[np.ndarray, " k"]
    pairs: Int64[np.ndarray, "pairs 2"]
    at_home: Float64[np.ndarray, " pairs"]

    def distances(
        self, robot: Robot, q: Float64[np.ndarray, " nq"]
    ) -> Float64[np.ndarray, " pairs"]:
        """Distance of each pair in a posture, negative where they overlap [m].

        Args:
            robot: the robot.
            q: the posture [m, rad].
        """
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, q)
        return self.distances_at(data)

    def distances_at(self, data: pin.Data) -> Float64[np.ndarray, " pairs"]:
        """The same where the joints are known already.

        Args:
            data: in which they are.
        """
        starts, ends = self._placed(data)
        i, j = self.pairs.T
        axes = segment_distances(starts[i], ends[i], starts[j], ends[j])
        return axes - self.radii[i] - self.radii[j]

    def _placed(
        self, data: pin.Data
    ) -> tuple[Float64[np.ndarray, "k 3"], Float64[np.ndarray, "k 3"]]:
        R = np.array([data.oMi[int(j)].rotation for j in self.joints]).reshape(-1, 3, 3)
        p = np.array([data.oMi[int(j)].translation for j in self.joints]).reshape(-1, 3)
        return tuple(p + np.einsum("kij,kj->ki", R, ends) for ends in (self.starts, self.ends))


@once_a_robot
def capsules_of(robot: Robot) -> LinkCapsules:
    """The capsules of a robot, made once: meshes are read for it.

    A link's capsules hold the corners of its collision shapes, or where it has none, of what it
    looks like; a flat link has up to three side by side. A robot without any geometry has sticks
    from joint to joint. Pairs are left out whose links have few joints between them or joints close
    together, those whose capsules overlap at home or in most postures, and those that joint limits
    keep apart.

    Args:
        robot: the robot.

    Raises:
        RobotError: a mesh cannot be read.
    """
    return _make(robot)


def segment_distances(
    a: Float64[np.ndarray, "n 3"],
    b: Float64[np.ndarray, "n 3"],
    c: Float64[np.ndarray, "n 3"],
    d: Float64[np.ndarray, "n 3"],
) -> Float64[np.ndarray, " n"]:
    """Distances of the segments from a to b from those from c to d [m].

    The least of the distances of each end from the other segment, and of the lines where their
    nearest points are on both segments.
    """
    u, v = b - a, d - c
    ends = [_from_segment(a, c, v), _from_segment(b, c, v), _from_segment(c, a, u)]
    least = np.min([*ends, _from_segment(d, a, u)], axis=0)
    w, uu, uv, vv = a - c, _dot(u, u), _dot(u, v), _dot(v, v)
    den = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (uv * _dot(v, w) - vv * _dot(u, w)) / den
        t = (uu * _dot(v, w) - uv * _dot(u, w)) / den
        inner = np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1)
        on = (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0) & (den > 1e-9 * uu * vv)
    return np.where(on, np.minimum(inner, least), least)


def _from_segment(
    p: Float64[np.ndarray, "n 3"], a: Float64[np.ndarray, "n 3"], u: Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, " n"]:
    s = np.clip(_dot(p - a, u) / np.maximum(_dot(u, u), 1e-18), 0.0, 1.0)
    return np.linalg.norm(p - a - s[:, None] * u, axis=1)


def _dot(a: Float64[np.ndarray, "n 3"], b: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
    return np.einsum("ni,ni->n", a, b)


def _make(robot: Robot) -> LinkCapsules:
    joints: list[int] = []
    names: list[str] = []
    capsules: list[_Capsule] = []
    for joint, (name, balls) in _solids(robot).items():
        for capsule in _fit(balls):
            joints.append(joint)
            names.append(name)
            capsules.append(capsule)
    all_pairs = [
        (i, j)
        for i, j in combinations(range(len(joints)), 2)
        if not _are_neighbours(*_joints_between(robot, joints[i], joints[j]), robot)
    ]
    whole = LinkCapsules(
        joints=np.array(joints, dtype=np.int64),
        names=tuple(names),
        starts=np.array([c.start for c in capsules]).reshape(-1, 3),
        ends=np.array([c.end for c in capsules]).reshape(-1, 3),
        radii=np.array([c.radius for c in capsules]),
        pairs=np.array(all_pairs, dtype=np.int64).reshape(-1, 2),
        at_home=np.zeros(len(all_pairs)),
    )
    at_home = whole.distances(robot, robot.q_home)
    overlapping = sum(d < 0.0 for d in _at_random(robot, whole, _POSTURES, _REACH))
    nearest = np.min([*_at_random(robot, whole, _RANGE, 1.0)], axis=0)
    kept = (at_home >= _LEAST_AT_HOME) & (nearest < _FAR)
    kept &= overlapping <= _MOST * _POSTURES
    apart = [sum(map(len, _joints_between(robot, joints[i], joints[j]))) for i, j in all_pairs]
    kept &= (np.array(apart) > _FEW) | (nearest < -_SHALLOW)
    return replace(whole, pairs=whole.pairs[kept], at_home=at_home[kept])


def _at_random(
    robot: Robot, capsules: LinkCapsules, count: int, reach: float
) -> Iterator[Float64[np.ndarray, " pairs"]]:
    """Distances of the pairs in random postures, so far from home to the joints' limits at most."""
    q, joints = robot.q_home.copy(), slice(robot.nq - robot.nj, None)
    lower, upper = robot.q_min - q[joints], robot.q_max - q[joints]
    data = robot.model.createData()
    for part in np.random.default_rng(0).uniform(0.0, 1.0, (count, robot.nj)):
        q[joints] = robot.q_home[joints] + reach * (lower + part * (upper - lower))
        pin.forwardKinematics(robot.model, data, q)
        yield capsules.distances_at(data)


def _solids(robot: Robot) -> dict[int, tuple[str, Balls]]:
    """What each joint carries as points in the joint, under the name of its first link."""
    bodies = [f for f in robot.model.frames if f.type == pin.FrameType.BODY]
    # A link whose name is that of a frame with a part to play has another one in the model.
    links = {f.name.removesuffix("_link") if _renamed(f, robot) else f.name: f for f in bodies}
    shapes = link_shapes(robot.source, links, robot.name, outlines=True)
    found: dict[int, tuple[str, list[Balls]]] = {}
    for link, frame in links.items():
        balls = union(shapes[link].collision or shapes[link].visual)
        if balls is not None:
            own = found.setdefault(int(frame.parentJoint), (link, []))
            own[1].append(balls.moved(frame.placement))
    if not found:
        return _sticks(robot)
    merged = {joint: (name, union(balls)) for joint, (name, balls) in found.items()}
    return {joint: (name, balls) for joint, (name, balls) in merged.items() if balls is not None}


def _renamed(frame: pin.Frame, robot: Robot) -> bool:
    return frame.name.endswith("_link") and frame.name.removesuffix("_link") in {
        role.link for role in robot.roles.values()
    }


def _sticks(robot: Robot) -> dict[int, tuple[str, Balls]]:
    """From each joint to those that it carries."""
    found: dict[int, tuple[str, Balls]] = {}
    model = robot.model
    for joint in range(1, model.njoints):
        children = [model.jointPlacements[c].translation for c in model.children[joint]]
        points = np.array([np.zeros(3), *children])
        length = float(np.linalg.norm(points, axis=1).max())
        if length > _SMALLEST:
            radii = np.full(len(points), _STICK * length)
            found[joint] = (model.names[joint], Balls(points, radii))
    return found


@dataclass(frozen=True)
class _Capsule:
    start: Float64[np.ndarray, "3"]
    end: Float64[np.ndarray, "3"]
    radius: float


def _fit(balls: Balls) -> list[_Capsule]:
    """Capsules side by side along a shape's longest side that hold all of its points."""
    axes, centre, size = _box(balls)
    if size[0] <= _SMALLEST:
        return []
    local = (balls.centres - centre) @ axes
    count = int(np.clip(round(size[1] / max(size[2], 1e-6)), 1, _MOST_STRIPS))
    width = size[1] / count
    capsules: list[_Capsule] = []
    for k in range(count):
        middle = -0.5 * size[1] + (k + 0.5) * width
        nearest = np.abs(local[:, 1] - middle) <= 0.5 * width + 1e-9
        if not nearest.any():
            continue
        own, radii = local[nearest] - [0.0, middle, 0.0], balls.radii[nearest]
        capsules.append(_around(own, radii, axes, centre + middle * axes[:, 1]))
    return capsules


def _around(
    points: Float64[np.ndarray, "n 3"],
    radii: Float64[np.ndarray, " n"],
    axes: Float64[np.ndarray, "3 3"],
    origin: Float64[np.ndarray, "3"],
) -> _Capsule:
    """The shortest capsule about the first axis of as little a radius as holds balls."""
    aside = np.hypot(points[:, 1], points[:, 2])
    radius = float((aside + radii).max())
    # As far along the axis as each ball lets the capsule's round end come short of it.
    short = np.sqrt(np.maximum((radius - radii) ** 2 - aside**2, 0.0))
    high, low = float((points[:, 0] - short).max()), float((points[:, 0] + short).min())
    if high < low:
        high = low = 0.5 * (high + low)
    return _Capsule(origin + high * axes[:, 0], origin + low * axes[:, 0], radius)


def _box(
    balls: Balls,
) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """The smaller one of the boxes along the link's axes and along the points' principal ones.

    Returns:
        Axes in columns, the longest side first; centre; lengths of the sides.
    """
    points, radii = balls.centres, balls.radii[:, None]
    choices: list[Float64[np.ndarray, "3 3"]] = [np.eye(3)]
    if len(points) > 3:
        choices.append(np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T)
    boxes: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []
    for axes in choices:
        local = points @ axes
        low, high = (local - radii).min(axis=0), (local + radii).max(axis=0)
        order = np.argsort(low - high)
        size = (high - low)[order]
        boxes.append((float(size.prod()), axes[:, order], axes @ (0.5 * (low + high)), size))
    # The link's own axes unless others are clearly better: mirrored links then have mirrored boxes.
    best = min(boxes, key=lambda box: box[0] * (1.0 if box is boxes[0] else 1.1))
    return best[1], best[2], best[3]


def _joints_between(robot: Robot, one: int, other: int) -> tuple[list[int], list[int]]:
    """The joints that move one link and not the other, and the other way round."""
    chains = [[int(j) for j in robot.model.supports[k]] for k in (one, other)]
    first, second = ([j for j in c if j not in chains[1 - i]] for i, c in enumerate(chains))
    return first, second


def _are_neighbours(first: list[int], second: list[int], robot: Robot) -> bool:
    """Whether links are of one compound joint, or the same, or next ones but one."""
    if len(first) + len(second) <= _NEIGHBOURS:
        return True
    places = robot.model.jointPlacements
    way = sum(float(np.linalg.norm(places[j].translation)) for j in (*first[1:], *second[1:]))
    if first and second:
        way += float(np.linalg.norm(places[first[0]].translation - places[second[0]].translation))
    return way <= _COMPOUND
