"""`LinkCapsules`: a robot's links as capsules, and which pairs of them can come near each other."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise.robots._geometry import Balls, link_shapes, union
from poise.robots._robot import Robot, once_a_robot

_MOST_STRIPS = 3  # Capsules side by side that stand for a flat link at most
_STICK = 0.12  # Radius of a link without any geometry, as a part of its length

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
"""Distance of two capsules at home below which they are too coarse for their links [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkCapsules:
    """Capsules that hold a robot's links, fixed to its joints [m]."""

    joints: Int64[np.ndarray, " k"]  # Pinocchio's index of the joint that carries each capsule
    names: tuple[str, ...]  # of the link that each one stands for, as the document has it
    starts: Float64[np.ndarray, "k 3"]  # one end of each capsule's axis in its joint
    ends: Float64[np.ndarray, "k 3"]
    radii: Float64[np.ndarray, " k"]
    pairs: Int64[np.ndarray, "pairs 2"]  # those that can come near each other
    at_home: Float64[np.ndarray, " pairs"]  # distance of each pair in the home posture

    def distances(
        self, robot: Robot, q: Float64[np.ndarray, " nq"]
    ) -> Float64[np.ndarray, " pairs"]:
        """Distance of each pair in a posture [m], negative where they overlap."""
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, q)
        return self.distances_at(data)

    def distances_at(self, data: pin.Data) -> Float64[np.ndarray, " pairs"]:
        """The same after `pin.forwardKinematics`."""
        R = np.array([data.oMi[int(j)].rotation for j in self.joints]).reshape(-1, 3, 3)
        p = np.array([data.oMi[int(j)].translation for j in self.joints]).reshape(-1, 3)
        starts, ends = (p + np.einsum("kij,kj->ki", R, x) for x in (self.starts, self.ends))
        i, j = self.pairs.T
        axes = segment_distances(starts[i], ends[i], starts[j], ends[j])
        return axes - self.radii[i] - self.radii[j]


def segment_distances(
    a: Float64[np.ndarray, "n 3"],
    b: Float64[np.ndarray, "n 3"],
    c: Float64[np.ndarray, "n 3"],
    d: Float64[np.ndarray, "n 3"],
) -> Float64[np.ndarray, " n"]:
    """Distances of the segments from a to b from those from c to d (Ericson 2005, 5.1.9) [m]."""
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = (_dot(x, y) for x, y in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    tiny, eps = np.finfo(np.float64).tiny, np.finfo(np.float64).eps
    # Of parallel segments any point of one will do to begin with.
    apart = uu * vv - uv**2
    parallel = apart <= eps * uu * vv
    s = np.where(parallel, 0.0, (uv * vw - vv * uw) / np.where(parallel, 1.0, apart))
    t = np.clip((uv * np.clip(s, 0.0, 1.0) + vw) / np.maximum(vv, tiny), 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, tiny), 0.0, 1.0)
    return np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1)


def _dot(a: Float64[np.ndarray, "n 3"], b: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
    return np.einsum("ni,ni->n", a, b)


@once_a_robot
def capsules_of(robot: Robot) -> LinkCapsules:
    """The capsules of a robot; a mesh that cannot be read is a `RobotError`.

    They hold the corners of a link's collision shapes, or where it has none, of its visual ones.
    Left out are pairs with few joints between them or joints close together, those that overlap at
    home or in most postures, and those that joint limits keep apart.
    """
    fitted = [
        (joint, name, capsule)
        for joint, (name, parts) in _solids(robot).items()
        if (balls := union(parts)) is not None
        for capsule in _fit(balls)
    ]
    joints = [joint for joint, _, _ in fitted]
    all_pairs = [
        (i, j)
        for i, j in combinations(range(len(joints)), 2)
        if not _are_neighbours(*_joints_between(robot, joints[i], joints[j]), robot)
    ]
    whole = LinkCapsules(
        joints=np.array(joints, dtype=np.int64),
        names=tuple(name for _, name, _ in fitted),
        starts=np.array([start for _, _, (start, _, _) in fitted]).reshape(-1, 3),
        ends=np.array([end for _, _, (_, end, _) in fitted]).reshape(-1, 3),
        radii=np.array([radius for _, _, (_, _, radius) in fitted]),
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


def _solids(robot: Robot) -> dict[int, tuple[str, list[Balls]]]:
    """Collect the points fixed to each joint, with the name of its first link."""
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
    return found or _sticks(robot)


def _renamed(frame: pin.Frame, robot: Robot) -> bool:
    return frame.name.endswith("_link") and frame.name.removesuffix("_link") in {
        role.link for role in robot.roles.values()
    }


def _sticks(robot: Robot) -> dict[int, tuple[str, list[Balls]]]:
    """From each joint to those that it carries."""
    found: dict[int, tuple[str, list[Balls]]] = {}
    model = robot.model
    for joint in range(1, model.njoints):
        ends = (model.jointPlacements[child].translation for child in model.children[joint])
        points = np.array([np.zeros(3), *ends])
        length = float(np.linalg.norm(points, axis=1).max())
        if length > 0.0:
            radii = np.full(len(points), _STICK * length)
            found[joint] = model.names[joint], [Balls(points, radii)]
    return found


_Capsule = tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"], float]
"""Both ends of the axis and the radius [m]."""


def _fit(balls: Balls) -> list[_Capsule]:
    """Capsules side by side along a shape's longest side that hold all of its points."""
    axes, centre, size = _box(balls)
    local = (balls.centres - centre) @ axes
    count = int(np.clip(round(size[1] / max(size[2], 1e-6)), 1, _MOST_STRIPS))
    width = size[1] / count
    capsules: list[_Capsule] = []
    for middle in width * (np.arange(count) + 0.5) - 0.5 * size[1]:
        nearest = np.abs(local[:, 1] - middle) <= 0.5 * width + 1e-9
        if nearest.any():
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
    high, low = (high, low) if high >= low else (0.5 * (high + low),) * 2
    return origin + high * axes[:, 0], origin + low * axes[:, 0], radius


def _box(
    balls: Balls,
) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Axes, longest first, centre and sides of the smaller box along the link's or main axes."""
    points, radii = balls.centres, balls.radii[:, None]
    choices: list[Float64[np.ndarray, "3 3"]] = [np.eye(3)]
    if len(points) > 3:
        choices.append(np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T)
    boxes: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for axes in choices:
        local = points @ axes
        low, high = (local - radii).min(axis=0), (local + radii).max(axis=0)
        order = np.argsort(low - high)
        boxes.append((axes[:, order], axes @ (0.5 * (low + high)), (high - low)[order]))
    # The link's own axes unless others are clearly better: mirrored links then have mirrored boxes.
    return min(boxes, key=lambda box: box[2].prod() * (1.0 if box is boxes[0] else 1.1))


def _joints_between(robot: Robot, one: int, other: int) -> tuple[list[int], list[int]]:
    """The joints that move one link and not the other, and the other way round."""
    chains = [[int(j) for j in robot.model.supports[k]] for k in (one, other)]
    first, second = ([j for j in c if j not in chains[1 - i]] for i, c in enumerate(chains))
    return first, second


def _are_neighbours(first: list[int], second: list[int], robot: Robot) -> bool:
    """True for links of one compound joint, or the same, or next ones but one."""
    if len(first) + len(second) <= _NEIGHBOURS:
        return True
    places = robot.model.jointPlacements
    way = sum(float(np.linalg.norm(places[j].translation)) for j in (*first[1:], *second[1:]))
    if first and second:
        way += float(np.linalg.norm(places[first[0]].translation - places[second[0]].translation))
    return way <= _COMPOUND
