"""The shapes of a robot's links as points, to find soles and hands."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int

from poise.errors import RobotError
from poise.robots._mesh_files import mesh_path
from poise.robots._mjcf_compile import compile_mjcf, mujoco_module, pose_of
from poise.robots._robot import ModelSource


@dataclass(frozen=True)
class Balls:
    """A convex shape as the hull of balls: corners have radius zero, a capsule is two balls."""

    centres: Float64[np.ndarray, "n 3"]  # in the link [m]
    radii: Float64[np.ndarray, " n"]  # of each ball [m]

    def moved(self, placement: pin.SE3) -> "Balls":
        """The same shape elsewhere: placement times its points."""
        return Balls(self.centres @ placement.rotation.T + placement.translation, self.radii.copy())


@dataclass
class LinkShape:
    """Shapes of a link for pictures and for contact, each as balls in the link."""

    collision: list[Balls] = field(default_factory=list[Balls])
    visual: list[Balls] = field(default_factory=list[Balls])


def union(shapes: Sequence[Balls]) -> Balls | None:
    """Several shapes as one; None where there are none."""
    if not shapes:
        return None
    return Balls(
        np.concatenate([s.centres for s in shapes]), np.concatenate([s.radii for s in shapes])
    )


def link_shapes(
    source: ModelSource, links: Iterable[str], where: str, *, outlines: bool = False
) -> dict[str, LinkShape]:
    """The shapes of some links of a document whose missing meshes have been taken out."""
    wanted = set(links)
    if source.kind == "urdf":
        return _urdf_shapes(source, wanted, outlines)
    return _mjcf_shapes(source, wanted, where)


def load_mesh(path: Path) -> tuple[Float64[np.ndarray, "n 3"], Int[np.ndarray, "t 3"]]:
    """Vertices [m] and triangles of a mesh in any format that Assimp reads."""
    if is_binary_stl(path):
        # In a fraction of the library's time.
        triangles = np.fromfile(path, _STL_TRIANGLE, offset=_STL_HEADER)
        vertices = triangles["corners"].reshape(-1, 3).astype(np.float64)
        if not (len(vertices) and np.isfinite(vertices).all()):
            raise RobotError("a mesh of the robot has no triangles, or NaN in them", got=str(path))
        return vertices, np.arange(len(vertices)).reshape(-1, 3)
    # Pinocchio's collision library reads whatever Assimp reads.
    try:
        model = coal.MeshLoader().load(str(path), np.ones(3))
    except (RuntimeError, ValueError) as error:
        raise RobotError(f"a mesh of the robot cannot be read: {error}", got=str(path)) from error
    vertices = np.array(model.vertices(), dtype=np.float64)
    if path.suffix.lower() == ".dae" and b"Y_UP" in path.read_bytes():
        # The library turns such a mesh for readers whose y points up; a URDF's z does.
        vertices = vertices[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
    corners = [[t[0], t[1], t[2]] for t in (model.tri_indices(i) for i in range(model.num_tris))]
    return vertices, np.array(corners, dtype=np.int64).reshape(-1, 3)


def is_binary_stl(path: Path) -> bool:
    """True for a binary STL file, whose size follows from its number of triangles."""
    if path.suffix.lower() != ".stl":
        return False
    with path.open("rb") as file:
        count = int.from_bytes(file.read(_STL_HEADER)[80:], "little")
    return path.stat().st_size == _STL_HEADER + count * _STL_TRIANGLE.itemsize


_STL_HEADER = 84  # Bytes before the first triangle: a text of 80, and the number of triangles
_STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def _urdf_shapes(source: ModelSource, wanted: set[str], outlines: bool) -> dict[str, LinkShape]:
    shapes = {name: LinkShape() for name in wanted}
    for link in ET.fromstring(source.text).findall("link"):
        shape = shapes.get(link.get("name", ""))
        if shape is None:
            continue
        for kind, found in (("collision", shape.collision), ("visual", shape.visual)):
            if kind == "visual" and shape.collision and outlines:
                continue
            for element in link.findall(kind):
                balls = _urdf_shape(element, source)
                if balls is not None:
                    found.append(balls)
    return shapes


def _urdf_shape(element: ET.Element, source: ModelSource) -> Balls | None:
    geometry, origin = element.find("geometry"), element.find("origin")
    if geometry is None or not len(geometry):
        return None
    solid = geometry[0]
    placement = pin.SE3.Identity()
    if origin is not None:
        rpy = _numbers(origin.get("rpy", "0 0 0"))
        position = np.array(_numbers(origin.get("xyz", "0 0 0")))
        placement = pin.SE3(pin.rpy.rpyToMatrix(*rpy), position)
    if solid.tag == "mesh":
        scale = np.array(_numbers(solid.get("scale", "1 1 1")))
        vertices, _ = load_mesh(mesh_path(solid.get("filename", ""), source))
        balls = Balls(vertices * scale, np.zeros(len(vertices)))
    elif solid.tag == "box":
        balls = _box(0.5 * np.array(_numbers(solid.get("size", "0 0 0"))))
    elif solid.tag == "sphere":
        balls = Balls(np.zeros((1, 3)), np.array([float(solid.get("radius", "0"))]))
    elif solid.tag in ("cylinder", "capsule"):
        half = 0.5 * float(solid.get("length", "0"))
        radius = float(solid.get("radius", "0"))
        balls = _cylinder(radius, half) if solid.tag == "cylinder" else _capsule(radius, half)
    else:
        return None
    return balls.moved(placement)


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def _box(half: Float64[np.ndarray, "3"]) -> Balls:
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T * half
    return Balls(corners, np.zeros(len(corners)))


def _cylinder(radius: float, half: float, corners: int = 24) -> Balls:
    angles = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(corners)], axis=1) * radius
    rims = np.concatenate([ring + [0.0, 0.0, half], ring - [0.0, 0.0, half]])
    return Balls(rims, np.zeros(len(rims)))


def _capsule(radius: float, half: float) -> Balls:
    return Balls(np.array([[0.0, 0.0, half], [0.0, 0.0, -half]]), np.full(2, radius))


def _mjcf_shapes(source: ModelSource, wanted: set[str], where: str) -> dict[str, LinkShape]:
    model = compile_mjcf(source, where, wanted)
    shapes = {name: LinkShape() for name in wanted}
    for geom in range(model.ngeom):
        shape = shapes.get(model.body(model.geom_bodyid[geom]).name)
        balls = _mjcf_shape(model, geom, where) if shape is not None else None
        if shape is not None and balls is not None:
            touches = model.geom_contype[geom] or model.geom_conaffinity[geom]
            (shape.collision if touches else shape.visual).append(balls)
    return shapes


def _mjcf_shape(model: Any, geom: int, where: str) -> Balls | None:
    kinds = mujoco_module(where).mjtGeom
    kind, size = model.geom_type[geom], np.array(model.geom_size[geom], dtype=np.float64)
    placement = pose_of(model.geom_pos[geom], model.geom_quat[geom])
    if kind == kinds.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first = int(model.mesh_vertadr[mesh])
        vertices = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])]
        balls = Balls(np.array(vertices, dtype=np.float64), np.zeros(len(vertices)))
    elif kind == kinds.mjGEOM_BOX:
        balls = _box(size)
    elif kind == kinds.mjGEOM_SPHERE:
        balls = Balls(np.zeros((1, 3)), size[:1])
    elif kind == kinds.mjGEOM_CAPSULE:
        balls = _capsule(float(size[0]), float(size[1]))
    elif kind == kinds.mjGEOM_CYLINDER:
        balls = _cylinder(float(size[0]), float(size[1]))
    else:
        return None
    return balls.moved(placement)
