"""`LinkCapsules`: a robot's links as capsules, and which pairs of them can come near each other."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise.robots._geometry import Balls, link_shapes, union
from poise.robots._robot import Robot, once_a_robot

_NEIGHBOURS, _COMPOUND = 2, 0.1
"""Links with so many joints between them or fewer, or joints no further apart than this [m], are
kept apart by their joints' limits."""

_FAR = 0.15
"""Capsules that stay farther apart in all random postures never come near each other [m]."""

_FEW, _SHALLOW = 5, 0.04
"""Joints between two links that the random postures try out well; if their capsules, which are
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
        return self._distances(robot, robot.model.createData(), self._geometry.createData(), q)

    def at_random(self, robot: Robot, count: int = 300) -> Float64[np.ndarray, "count pairs"]:
        """Distances in random postures within the joints' limits [m]."""
        data, shapes = robot.model.createData(), self._geometry.createData()
        return np.array(
            [self._distances(robot, data, shapes, q) for q in random_postures(robot, count)]
        )

    def _distances(
        self, robot: Robot, data: pin.Data, shapes: pin.GeometryData, q: Float64[np.ndarray, " nq"]
    ) -> Float64[np.ndarray, " pairs"]:
        pin.computeDistances(robot.model, data, self._geometry, shapes, q)
        return np.array([found.min_distance for found in shapes.distanceResults])

    @cached_property
    def _geometry(self) -> pin.GeometryModel:
        """The capsules and pairs for Pinocchio."""
        geometry = pin.GeometryModel()
        for k, (joint, start, end) in enumerate(
            zip(self.joints, self.starts, self.ends, strict=True)
        ):
            axis, up = end - start, np.array([0.0, 0.0, 1.0])
            turn = pin.Quaternion.FromTwoVectors(up, axis if axis.any() else up)
            solid = coal.Capsule(float(self.radii[k]), float(np.linalg.norm(axis)))
            place = pin.SE3(turn, 0.5 * (start + end))
            geometry.addGeometryObject(pin.GeometryObject(str(k), int(joint), place, solid))
        for i, j in self.pairs.tolist():
            geometry.addCollisionPair(pin.CollisionPair(i, j))
        return geometry


def random_postures(robot: Robot, count: int) -> Float64[np.ndarray, "count nq"]:
    """The home posture with joints anywhere within their limits, the same at each call."""
    q = np.tile(robot.q_home, (count, 1))
    joints = np.random.default_rng(0).uniform(robot.q_min, robot.q_max, (count, robot.nj))
    q[:, robot.nq - robot.nj :] = joints
    return q


@once_a_robot
def capsules_of(robot: Robot) -> LinkCapsules:
    """The capsules of a robot; a mesh that cannot be read is a `RobotError`.

    They hold the corners of a link's collision shapes, or where it has none, of its visual ones.
    Left out are pairs with few joints between them or joints close together, those that overlap at
    home or in three of four postures, and those that joint limits keep apart.
    """
    fitted = [
        (joint, name, *capsule)
        for joint, (name, parts) in _solids(robot).items()
        if (balls := union(parts)) is not None
        for capsule in _fit(balls)
    ]
    joints, names, starts, ends, radii = zip(*fitted, strict=True) if fitted else ((),) * 5
    pairs = [
        (i, j)
        for i, j in combinations(range(len(joints)), 2)
        if not are_neighbours(robot, joints[i], joints[j])
    ]
    whole = LinkCapsules(
        joints=np.array(joints, dtype=np.int64),
        names=names,
        starts=np.array(starts).reshape(-1, 3),
        ends=np.array(ends).reshape(-1, 3),
        radii=np.array(radii),
        pairs=np.array(pairs, dtype=np.int64).reshape(-1, 2),
        at_home=np.zeros(len(pairs)),
    )
    at_home, postures = whole.distances(robot, robot.q_home), whole.at_random(robot)
    nearest, overlapping = postures.min(axis=0), (postures < 0.0).mean(axis=0)
    apart = np.array(
        [sum(map(len, _joints_between(robot, joints[i], joints[j]))) for i, j in pairs]
    )
    kept = (at_home >= _LEAST_AT_HOME) & (nearest < _FAR) & (overlapping <= 0.75)
    kept &= (apart > _FEW) | (nearest < -_SHALLOW)
    return replace(whole, pairs=whole.pairs[kept], at_home=at_home[kept])


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
    return found or _sticks(robot.model)


def _renamed(frame: pin.Frame, robot: Robot) -> bool:
    return frame.name.endswith("_link") and frame.name.removesuffix("_link") in {
        role.link for role in robot.roles.values()
    }


def _sticks(model: pin.Model, slenderness: float = 0.12) -> dict[int, tuple[str, list[Balls]]]:
    """From each joint to those that it carries, of a radius in proportion to their length."""
    found: dict[int, tuple[str, list[Balls]]] = {}
    for joint in range(1, model.njoints):
        ends = (model.jointPlacements[child].translation for child in model.children[joint])
        points = np.array([np.zeros(3), *ends])
        length = float(np.linalg.norm(points, axis=1).max())
        if length > 0.0:
            radii = np.full(len(points), slenderness * length)
            found[joint] = model.names[joint], [Balls(points, radii)]
    return found


_Capsule = tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"], float]
"""Both ends of the axis and the radius [m]."""


def _fit(balls: Balls, most: int = 3) -> list[_Capsule]:
    """Capsules side by side along a shape's longest side that hold all of its points."""
    axes, low, high = _box(balls)
    points, (_, width, height) = balls.centres @ axes, high - low
    count = int(np.clip(round(width / max(height, 1e-6)), 1, most))
    strip = np.clip((points[:, 1] - low[1]) * count // max(width, 1e-6), 0, count - 1)
    capsules: list[_Capsule] = []
    for k in np.unique(strip):
        own, radii = points[strip == k], balls.radii[strip == k]
        middle = 0.5 * (low + high)
        middle[1] = low[1] + (k + 0.5) * width / count
        aside = np.linalg.norm((own - middle)[:, 1:], axis=1)
        radius = float((aside + radii).max())
        # As far along the axis as each ball lets the capsule's round end come short of it.
        short = np.sqrt(np.maximum((radius - radii) ** 2 - aside**2, 0.0))
        ends = np.array([(own[:, 0] - short).max(), (own[:, 0] + short).min()])
        ends = ends if ends[0] >= ends[1] else np.full(2, ends.mean())
        start, end = (axes @ [end, *middle[1:]] for end in ends)
        capsules.append((start, end, radius))
    return capsules


def _box(
    balls: Balls,
) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Axes, longest first, and ends of the smaller box along the link's or its main axes."""
    points, radii = balls.centres, balls.radii[:, None]
    boxes: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for axes in (np.eye(3), np.linalg.eigh(np.cov(points.T, bias=True))[1]):
        low, high = (points @ axes - radii).min(axis=0), (points @ axes + radii).max(axis=0)
        order = np.argsort(low - high)
        boxes.append((axes[:, order], low[order], high[order]))
    volumes = [float((high - low).prod()) for _, low, high in boxes]
    # The link's own axes unless others are clearly better: mirrored links then have mirrored boxes.
    return boxes[int(1.1 * volumes[1] < volumes[0])]


def _joints_between(robot: Robot, one: int, other: int) -> tuple[list[int], list[int]]:
    """The joints that move one link and not the other, and the other way round."""
    chains = [[int(j) for j in robot.model.supports[k]] for k in (one, other)]
    first, second = ([j for j in c if j not in chains[1 - i]] for i, c in enumerate(chains))
    return first, second


def are_neighbours(robot: Robot, one: int, other: int) -> bool:
    """True where joint limits keep what two joints move apart: of one compound joint, or near."""
    first, second = _joints_between(robot, one, other)
    if len(first) + len(second) <= _NEIGHBOURS:
        return True
    places = robot.model.jointPlacements
    way = sum(float(np.linalg.norm(places[j].translation)) for j in (*first[1:], *second[1:]))
    if first and second:
        way += float(np.linalg.norm(places[first[0]].translation - places[second[0]].translation))
    return way <= _COMPOUND
