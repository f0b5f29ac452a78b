"""Soles: found on the shapes of feet, checked against them and by side, and what legs control."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError
from poise.robots._geometry import Balls, link_shapes, union
from poise.robots._limbs import FEWEST, Chain, Pair, Point
from poise.robots._robot import ModelSource, Robot

_DEPTH = 0.003  # [m] above the lowest plane that counts as on it: edges of soles are rounded
_FLAT_PART = 0.3  # of a foot's outline from below; a wheel touches with less
_STEEPEST = float(np.cos(np.radians(40.0)))  # from a steeper face rubber of friction 0.8 slides
_CLEARLY = 1.1  # ratio of areas from which one face or rectangle is larger: meshes are uneven
_SAME_FOOT = 0.02  # [m] of height within which faces are of one foot, as sole and toes are
_LARGER = 1.5  # ratio of areas: the smaller face leaves out too much, as contact points may
_OFF = 0.005  # [m] error of a described sole's height to remark on: contacts give less
_BESIDE = 0.01  # [m] that is certainly to one side, or over the edge: offsets are rounded finer
_SLOW = 0.02  # leg lengths a second, at unit speed of all joints: a motion that cannot be made
_LEG = 2  # soles with fewer joints in common below the pelvis may be of two legs, one locked

Points = Float64[np.ndarray, "n 2"]
Corner = Float64[np.ndarray, "2"]


@dataclass(frozen=True)
class Foot:
    """The largest rectangle on the flat lower face of what a joint moves, x along the foot."""

    joint: int
    kind: str
    place: pin.SE3
    size: Corner
    outline: Points
    points: int


def find_foot(
    model: pin.Model, data: pin.Data, source: ModelSource, leg: Chain, forward: Point, where: str
) -> Foot:
    """The flat face that a leg stands on: that of its last joint, or of the one before toes."""
    found: Foot | None = None
    problems: list[RobotError] = []
    # Joints of two or three axes carry links with their last axis alone.
    for joint in [j for j in reversed(leg) if body_frames(model, j)][:2]:
        names = [model.frames[i].name for i in body_frames(model, joint)]
        foot = f"foot {names[0]!r} of {where}"
        for kind, balls in (shapes := shapes_of(model, source, joint, where)).items():
            fit = _fit(balls.moved(data.oMi[joint]), joint, kind, forward)
            if isinstance(fit, str):
                sole = "a sole under `soles` in a description, measured on the robot"
                what = f"{foot} has no flat face to stand on"
                problems.append(RobotError(what, got=fit, wanted=sole))
            elif found is None or (
                abs(fit.place.translation[2] - found.place.translation[2]) < _SAME_FOOT
                and fit.size.prod() > _LARGER * found.size.prod()
            ):
                found = fit
        if not shapes:
            wanted = "the meshes beside the file, or a sole under `soles` in a description"
            got = f"links {names} with neither collision nor visual geometry that is there"
            what = f"{foot} has no shape to read a sole from"
            problems.append(RobotError(what, got=got, wanted=wanted))
    if found is None:
        raise problems[0]
    return found


def soles_off_their_feet(robot: Robot) -> list[str]:
    """Soles that are not at the lowest point of what their joint moves, or reach over its edge."""
    said: list[str] = []
    for name, sole in robot.soles.items():
        frame = robot.model.frames[robot.frame_id(name)]
        joint = frame.parentJoint
        try:
            shapes = shapes_of(robot.model, robot.source, joint, robot.name, robot.roles)
        except RobotError:
            continue
        for foot in [foot.moved(frame.placement.inverse()) for foot in shapes.values()][:1]:
            low = (foot.centres - foot.radii[:, None]).min(axis=0)
            high = (foot.centres + foot.radii[:, None]).max(axis=0)
            half = 0.5 * np.array([sole.length, sole.width])
            over = float(np.max([half - high[:2], half + low[:2]]))
            if abs(low[2]) > _OFF:
                side = f"{1e3 * abs(low[2]):.0f} mm {'above' if low[2] < 0.0 else 'below'}"
                said.append(f"{name!r} lies {side} the lowest point")
            elif over > _BESIDE:
                said.append(f"{name!r} reaches {1e3 * over:.0f} mm over the edge")
    return [f"sole {words} of its foot (`poise describe` shows both)" for words in said]


def with_controlled_soles(robot: Robot) -> Robot:
    """The robot with `Sole.controlled` of each sole as its leg has it in the home posture."""
    soles = {n: replace(sole, controlled=_controlled(robot, n)) for n, sole in robot.soles.items()}
    return replace(robot, soles=MappingProxyType(soles))


def body_frames(model: pin.Model, joint: int) -> list[int]:
    """Links that a joint moves as one."""
    kind = pin.FrameType.BODY
    return [i for i, f in enumerate(model.frames) if f.type == kind and f.parentJoint == joint]


def shapes_of(
    model: pin.Model, source: ModelSource, joint: int, where: str, roles: Collection[str] = ()
) -> dict[str, Balls]:
    """Shapes that a joint moves, in its frame, by kind; collision first."""
    frames = [model.frames[i] for i in body_frames(model, joint)]
    # A link that has the name of a role goes by another one in the model.
    names = [f.name.removesuffix("_link") for f in frames]
    names = [n if n in roles else f.name for n, f in zip(names, frames, strict=True)]
    shapes = link_shapes(source, names, where)
    found: dict[str, Balls] = {}
    for kind in ("collision", "visual"):
        of_links = zip(frames, (getattr(shapes[name], kind) for name in names), strict=True)
        whole = union([balls.moved(f.placement) for f, parts in of_links for balls in parts])
        if whole is not None:
            found[kind] = whole
    return found


def _fit(foot: Balls, joint: int, kind: str, forward: Float64[np.ndarray, "3"]) -> Foot | str:
    """The rectangle on the plane that touches a foot from below with the largest face."""
    down, centres = np.array([0.0, 0.0, -1.0]), foot.centres
    normals = _hull(centres).equations[:, :3] if len(centres) > 3 else down[None]
    normals = normals[np.unique(np.round(normals, 2), axis=0, return_index=True)[1]]
    normals = np.array([down, *normals[normals @ down > _STEEPEST]])
    heights = centres @ normals.T + foot.radii[:, None]
    near = heights > heights.max(axis=0) - _DEPTH
    planes = [_axes(normal, forward) for normal in normals]
    areas = np.array([_area(centres[near[:, k]] @ p) for k, p in enumerate(planes)])
    whole = _area(centres[:, :2])
    if areas.max() <= max(_FLAT_PART * whole, 1e-6):
        flat, seen = 1e4 * areas.max(), 1e4 * whole
        return f"at most {flat:.1f} cm^2 in one plane, of {seen:.1f} cm^2 seen from below"
    best = max(np.flatnonzero(_CLEARLY * areas >= areas.max()), key=lambda k: -normals[k, 2])
    up, axes = -normals[best], planes[best]
    points = centres[near[:, best]] - foot.radii[near[:, best], None] * up
    corners = (points @ axes)[_hull(points @ axes).vertices]
    turn, middle, size = _largest_inside(corners)
    axes = axes @ turn
    centre = axes @ middle + float((points @ up).min()) * up
    place = pin.SE3(np.column_stack([axes, up]), centre)
    return Foot(joint, kind, place, size, corners @ turn - middle, len(points))


def _axes(normal: Point, forward: Point) -> Float64[np.ndarray, "3 2"]:
    """Forward and left in the plane of a face, by the normal that points out of it."""
    x = forward - (forward @ normal) * normal
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(x, normal)], axis=1)


def _hull(points: Float64[np.ndarray, "n d"]) -> Any:
    """The convex hull, of points that may lie in something flatter, as contact balls do."""
    # It takes long to import, and only robots without a description need it.
    from scipy.spatial import ConvexHull

    return ConvexHull(points, qhull_options="QJ")


def _area(points: Points) -> float:
    return float(_hull(points).volume) if len(points) > 2 else 0.0


def _largest_inside(corners: Points) -> tuple[Float64[np.ndarray, "2 2"], Corner, Corner]:
    """Axes, middle and size of the largest rectangle inside, straight ahead or along an edge."""
    best = (np.eye(2), *_inside(corners))
    for x, y in np.roll(corners, -1, axis=0) - corners:
        # Turned by less than 45 degrees, an edge lies along x or y.
        turn = (np.arctan2(y, x) + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi
        R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        middle, size = _inside(corners @ R)
        if size.prod() > _CLEARLY * best[2].prod():
            best = R, middle, size
    return best


def _inside(corners: Points, places: int = 100) -> tuple[Corner, Corner]:
    """Middle and size of the largest rectangle along the axes inside a convex outline."""
    ends = corners[:, 0]
    x = np.union1d(ends, np.linspace(ends.min(), ends.max(), places))
    a, b, c = (column[:, None] for column in _hull(corners).equations.T)
    y = -(a * x + c) / np.where(b == 0.0, np.nan, b)
    top = np.where(b > 1e-9, y, np.inf).min(axis=0)
    bottom = np.where(b < -1e-9, y, -np.inf).max(axis=0)
    # Between two places of a convex outline the wider one is never outside.
    high, low = np.minimum.outer(top, top), np.maximum.outer(bottom, bottom)
    area = np.subtract.outer(x, x) * np.maximum(high - low, 0.0)
    i, j = np.unravel_index(int(np.argmax(area)), area.shape)
    middle = np.array([x[i] + x[j], high[i, j] + low[i, j]]) / 2.0
    return middle, np.array([x[i] - x[j], high[i, j] - low[i, j]])


def _controlled(robot: Robot, sole: str) -> tuple[int, ...]:
    """Components of a sole's motion that its leg can control.

    A leg cannot make the motion w with w^T J = 0, a left singular vector of its Jacobian J. Of the
    turns in w the largest is given up. A leg whose ankle does not roll lacks a shift to the side,
    relative to its hip, and leaves out roll; one whose hip does not yaw leaves out yaw.
    """
    model, data, joints = robot.model, robot.model.createData(), robot.leg_joints(sole)
    pin.computeJointJacobians(model, data, robot.q_home)
    J = pin.getFrameJacobian(model, data, robot.frame_id(sole), pin.ReferenceFrame.LOCAL)
    J = J[:, [model.joints[j].idx_v for j in joints]]
    place = pin.updateFramePlacement(model, data, robot.frame_id(sole)).translation
    length = sum(float(np.linalg.norm(data.oMi[j].translation - place)) for j in joints[:1])
    # At the origin of a slide there is no length to measure its motion by.
    J[:3] /= length if length > 1e-9 else 1.0
    kept = list(range(6))
    while turns := [i for i, k in enumerate(kept) if k >= 3]:
        squares, motions = np.linalg.eigh(J[kept] @ J[kept].T)
        if squares[0] > _SLOW**2:
            return tuple(kept)
        del kept[max(turns, key=lambda i: abs(motions[i, 0]))]
    # It lacks no turn: a straight knee, or hips that cannot spread.
    return (0, 1, 2, 3, 4, 5)


def check_roles(robot: Robot) -> None:
    """Refuse soles and hands that are certainly not where walkers take them to be.

    Limbs may cross, and a fixed base has no known direction.
    """
    if not robot.floating_base:
        return
    data = robot.model.createData()
    com = pin.centerOfMass(robot.model, data, robot.q_home)
    pin.updateFramePlacements(robot.model, data)
    soles, by_name = list(robot.soles), "their names say left and right"
    if com[2] <= 0.0:
        pelvis = float(data.oMf[robot.frame_id(robot.pelvis)].translation[2])
        what = f"robot {robot.name!r} is upside down on its soles ({', '.join(soles)})"
        got = f"CoM {com[2]:.3g} m and pelvis {pelvis:.3g} m above them in the home posture"
        wanted = "soles whose z points up into the foot; mind their `rpy`"
        raise RobotError(what, got=got, wanted=wanted)
    if len(soles) == 2:
        _check_soles(robot, data, soles[0], soles[1])
        why = f"{soles[0]!r} is listed first, where the left one is"
        _check_side(robot, data, soles[0], soles[1], why)
    for left, right in _named_pairs(soles):
        _check_side(robot, data, left, right, by_name)
    for left, right in _named_pairs(robot.hands):
        # Hands with fewer joints of their own may be fingers that turn over.
        if min(len(own) for own in _own(robot, left, right)) >= FEWEST:
            _check_side(robot, data, left, right, by_name)


def _check_soles(robot: Robot, data: pin.Data, first: str, second: str) -> None:
    """Refuse two soles of one foot or leg, and feet that point apart."""
    pair = f"soles {first!r} and {second!r} of robot {robot.name!r}"
    alone = "or one sole alone, where that link is all the robot stands on"
    legs = f"the links at the ends of two legs; {alone}"
    # Soles on two links may still share all joints: their legs may be locked.
    above, below = sorted((first, second), key=lambda sole: len(robot.joints_above(sole)))
    links = [robot.roles[sole].link for sole in (above, below)]
    shared = set(robot.joints_above(above))
    moving = sorted(shared - set(robot.joints_above(robot.pelvis)))
    cosine = float(np.dot(*(data.oMf[robot.frame_id(s)].rotation[:, 0] for s in (first, second))))
    if links[0] == links[1]:
        raise RobotError(f"{pair} are on one link", got=links[0], wanted=legs)
    if len(moving) >= _LEG and shared < set(robot.joints_above(below)):
        said = f"sole {below!r} of robot {robot.name!r} is on the leg of {above!r}, further down"
        joints = ", ".join(robot.model.names[j] for j in moving)
        raise RobotError(said, got=f"{' and '.join(links)}, below {joints}", wanted=legs)
    # Feet 120 degrees apart cannot point ahead both.
    if cosine < -0.5:
        angle = f"{np.degrees(np.arccos(max(cosine, -1.0))):.0f} degrees"
        got = f"{angle} between their x axes in the home posture"
        toes = "x of both soles towards the toes; mind their `rpy`"
        raise RobotError(f"{pair} point against each other", got=got, wanted=toes)


def _own(robot: Robot, one: str, other: str) -> Pair:
    """The joints that move one frame and not another, for each of two frames."""
    above, beside = robot.joints_above(one), robot.joints_above(other)
    return tuple(j for j in above if j not in beside), tuple(j for j in beside if j not in above)


def _named_pairs(names: Iterable[str]) -> list[tuple[str, str]]:
    """Left and right names that are alike but for these words."""
    there = {name.lower(): name for name in names}
    swapped = ((name, low.replace("left", "right")) for low, name in there.items() if "left" in low)
    return [(name, there[other]) for name, other in swapped if other in there]


def _check_side(robot: Robot, data: pin.Data, left: str, right: str, why: str) -> None:
    """Refuse what is on the wrong side with its limb: a limb that crosses over ends there alone."""
    places = [data.oMf[robot.frame_id(name)].translation for name in (left, right)]
    apart = float(places[0][1] - places[1][1])
    roots = [float(data.oMi[own[0]].translation[1]) for own in _own(robot, left, right) if own]
    crossed = len(roots) == 2 and roots[0] - roots[1] > _BESIDE
    if apart < -_BESIDE and not crossed:
        links = [repr(robot.roles[name].link) for name in (left, right)]
        where = f"{left!r} on {links[0]}, {-apart:.3g} m to the right of {right!r} on {links[1]}"
        raise RobotError(
            f"{left!r} and {right!r} of robot {robot.name!r} are on the wrong sides ({why})",
            got=f"{where} in the home posture, seen along the soles' mean x",
            wanted="left on the left, the left sole listed first, x of the soles towards the toes",
        )
