"""From a run to the motion that the report's 3D replay shows."""

from collections.abc import Sequence
from typing import Any, Literal

import mujoco
import numpy as np
from jaxtyping import Float64, Int

from poise.apps.report import ForceTrack, Geometry, MarkerTrack, Replay
from poise.apps.scenarios._signals import RunSignals
from poise.sim import Plant, Push

FRAMES_PER_SECOND = 30.0

CELL = 0.004
"""Meshes are drawn with their vertices merged on a grid of this size [m]: a hand still looks like
a hand, and a robot of 30 meshes fits into a page."""

_Primitive = Literal["box", "sphere", "ellipsoid", "cylinder", "capsule"]

_PRIMITIVES: dict[int, _Primitive] = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
}
_SIZES: dict[_Primitive, int] = {"box": 3, "sphere": 1, "ellipsoid": 3, "cylinder": 2, "capsule": 2}


def make_replay(plant: Plant, run: RunSignals, pushes: Sequence[Push] = ()) -> Replay:
    """Body poses at 30 frames a second, with shapes, contact forces, pushes and targets."""
    rows = _frame_rows(run.time)
    model, data = plant.model, mujoco.MjData(plant.model)
    position = np.empty((len(rows), model.nbody, 3))
    quaternion = np.empty((len(rows), model.nbody, 4))
    for i, row in enumerate(rows):
        data.qpos[:] = plant.map.qpos(run.q[row])
        mujoco.mj_kinematics(model, data)
        position[i] = data.xpos
        quaternion[i] = data.xquat[:, [1, 2, 3, 0]]
    return Replay(
        time=run.time[rows],
        body_names=tuple(model.body(i).name for i in range(model.nbody)),
        position=position,
        quaternion=quaternion,
        geometries=tuple(drawn_shapes(plant.drawn_model())),
        forces=(
            *_contact_forces(plant, run, rows),
            *(_push_force(plant, run, rows, push) for push in pushes),
        ),
        markers=tuple(
            MarkerTrack(name=name, position=target[rows]) for name, target in run.targets.items()
        ),
    )


def _frame_rows(time: Float64[np.ndarray, " T"]) -> Int[np.ndarray, " F"]:
    moments = np.arange(time[0], time[-1] + 0.5 / FRAMES_PER_SECOND, 1.0 / FRAMES_PER_SECOND)
    return np.unique(np.clip(np.searchsorted(time, moments), 0, len(time) - 1))


def _contact_forces(plant: Plant, run: RunSignals, rows: Int[np.ndarray, " F"]) -> list[ForceTrack]:
    data = mujoco.MjData(plant.model)
    tracks = {name: (np.empty((len(rows), 3)), np.empty((len(rows), 3))) for name in run.wrenches}
    for i, row in enumerate(rows):
        data.qpos[:] = plant.map.qpos(run.q[row])
        mujoco.mj_kinematics(plant.model, data)
        for name, (points, forces) in tracks.items():
            site = data.site(name)
            points[i] = site.xpos
            forces[i] = site.xmat.reshape(3, 3) @ run.wrenches[name][row, :3]
    return [
        ForceTrack(name=name, point=points, force=forces)
        for name, (points, forces) in tracks.items()
    ]


def _push_force(
    plant: Plant, run: RunSignals, rows: Int[np.ndarray, " F"], push: Push
) -> ForceTrack:
    """A push while it acts, at the point where the plant lets it act."""
    data = mujoco.MjData(plant.model)
    points, forces = np.full((len(rows), 3), np.nan), np.zeros((len(rows), 3))
    time = run.time[rows]
    for i in np.flatnonzero((time >= push.start) & (time < push.start + push.duration)):
        data.qpos[:] = plant.map.qpos(run.q[rows[i]])
        mujoco.mj_kinematics(plant.model, data)
        role = push.body in plant.robot.roles
        points[i] = data.site(push.body).xpos if role else data.body(push.body).xipos
        forces[i] = push.force
    return ForceTrack(name=f"push {push.body}", kind="push", point=points, force=forces)


def drawn_shapes(model: mujoco.MjModel) -> list[Geometry]:
    """Return the drawing of robot and blocks; the floor has its own grid."""
    shapes: list[Geometry] = []
    for geom in range(model.ngeom):
        kind = int(model.geom_type[geom])
        red, green, blue, alpha = (float(c) for c in _colour(model, geom))
        if alpha == 0.0 or kind == int(mujoco.mjtGeom.mjGEOM_PLANE):
            continue
        common: dict[str, Any] = {
            "body": int(model.geom_bodyid[geom]),
            "position": model.geom_pos[geom].copy(),
            "quaternion": model.geom_quat[geom][[1, 2, 3, 0]].copy(),
            "rgba": (red, green, blue, alpha),
        }
        if kind in _PRIMITIVES:
            shape = _PRIMITIVES[kind]
            size = tuple(float(s) for s in model.geom_size[geom][: _SIZES[shape]])
            shapes.append(Geometry(shape=shape, size=size, **common))
        elif kind == int(mujoco.mjtGeom.mjGEOM_MESH):
            vertices, faces = _mesh(model, int(model.geom_dataid[geom]))
            shapes.append(Geometry(shape="mesh", vertices=vertices, faces=faces, **common))
    return shapes


def _colour(model: mujoco.MjModel, geom: int) -> Float64[np.ndarray, "4"]:
    material = int(model.geom_matid[geom])
    return (model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]).astype(np.float64)


def _mesh(
    model: mujoco.MjModel, mesh: int
) -> tuple[Float64[np.ndarray, "nvert 3"], Int[np.ndarray, "nface 3"]]:
    """A mesh with its vertices merged cell by cell; faces that collapse are left out."""
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(np.float64)
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    faces = model.mesh_face[first : first + count].astype(np.int64)
    _, cell = np.unique(np.round(vertices / CELL).astype(np.int64), axis=0, return_inverse=True)
    cell = cell.ravel()
    size = np.bincount(cell).astype(np.float64)
    merged = np.column_stack([np.bincount(cell, vertices[:, k]) / size for k in range(3)])
    faces = cell[faces]
    whole = (
        (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    )
    return merged, np.unique(faces[whole], axis=0)
