"""Meshes in a format that MuJoCo reads."""

from pathlib import Path

import coal
import numpy as np

from poise.errors import RobotError

_BINARY_STL_HEADER = 84
"""Bytes before the first triangle: a text of 80, and the number of triangles."""

_STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def mesh_bytes(path: Path) -> tuple[bytes, str]:
    """Read a mesh, converting what MuJoCo cannot read (COLLADA, text STL) to binary STL.

    Args:
        path: the mesh file.

    Returns:
        The file's bytes, and the suffix that says their format.

    Raises:
        RobotError: the file holds no mesh that can be read.
    """
    suffix = path.suffix.lower()
    data = path.read_bytes()
    if suffix == ".obj" or (suffix == ".stl" and _is_binary_stl(data)):
        return data, suffix
    return _convert(path), ".stl"


def _is_binary_stl(data: bytes) -> bool:
    if len(data) < _BINARY_STL_HEADER:
        return False
    triangles = int.from_bytes(data[80:84], "little")
    return len(data) == _BINARY_STL_HEADER + triangles * _STL_TRIANGLE.itemsize


def _convert(path: Path) -> bytes:
    # Pinocchio's collision library reads whatever Assimp reads.
    try:
        model = coal.MeshLoader().load(str(path), np.ones(3))
    except (RuntimeError, ValueError) as error:
        raise RobotError(f"a mesh of the robot cannot be read: {error}", got=str(path)) from error
    vertices = np.asarray(model.vertices())
    if path.suffix.lower() == ".dae" and b"Y_UP" in path.read_bytes():
        # The library turns such a mesh for readers whose y points up; a URDF's z does.
        vertices = vertices[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
    corners = np.array(
        [[t[0], t[1], t[2]] for t in (model.tri_indices(i) for i in range(model.num_tris))]
    )
    faces = vertices[corners]
    volume = np.einsum("ti,ti->", faces[:, 0], np.cross(faces[:, 1], faces[:, 2]))
    if volume < 0.0:
        # Inside out, as a mirrored part is: it would be drawn unlit.
        faces = faces[:, ::-1]
    triangles = np.zeros(len(corners), dtype=_STL_TRIANGLE)
    triangles["corners"] = faces
    count = len(corners).to_bytes(4, "little")
    return b"\0" * 80 + count + triangles.tobytes()
