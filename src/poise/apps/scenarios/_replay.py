"""Motion of a run for the 3D replay of its report."""

from collections.abc import Sequence
from typing import Any, Literal

import mujoco
import numpy as np
from jaxtyping import Float64, Int

from poise.apps.report import ForceTrack, Geometry, Replay, RunSignals
from poise.sim import Plant, Push

_Primitive = Literal["box", "sphere", "ellipsoid", "cylinder", "capsule"]

_PRIMITIVES: dict[int, tuple[_Primitive, int]] = {
    int(mujoco.mjtGeom.mjGEOM_BOX): ("box", 3),
    int(mujoco.mjtGeom.mjGEOM_SPHERE): ("sphere", 1),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): ("ellipsoid", 3),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): ("cylinder", 2),
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): ("capsule", 2),
}
"""Names of shapes and how many sizes they have."""


def make_replay(plant: Plant, run: RunSignals, pushes: Sequence[Push] = ()) -> Replay:
    """Body poses at 30 frames a second, with shapes, contact forces, pushes and targets."""
    model, data, last = plant.model, mujoco.MjData(plant.model), len(run.time) - 1
    period = 1.0 / 30.0
    moments = np.arange(run.time[0], run.time[-1] + 0.5 * period, period)
    rows = np.unique(np.minimum(np.searchsorted(run.time, moments), last))
    time, count = run.time[rows], len(rows)
    position, quaternion = np.empty((count, model.nbody, 3)), np.empty((count, model.nbody, 4))
    contacts = [_force_track(name, "contact", count) for name in run.soles]
    acting = [_force_track(f"push {push.body}", "push", count) for push in pushes]
    for i, row in enumerate(rows):
        data.qpos[:] = plant.map.qpos(run.q[row])
        mujoco.mj_kinematics(model, data)
        position[i] = data.xpos
        quaternion[i] = data.xquat[:, [1, 2, 3, 0]]
        for track in contacts:
            site = data.site(track.name)
            track.point[i] = site.xpos
            track.force[i] = site.xmat.reshape(3, 3) @ run.soles[track.name].wrench[row, :3]
        for push, track in zip(pushes, acting, strict=True):
            if push.start <= time[i] < push.start + push.duration:
                # A frame with a part to play is a site, where the plant lets the push act.
                role = push.body in plant.robot.roles
                track.point[i] = data.site(push.body).xpos if role else data.body(push.body).xipos
                track.force[i] = push.force
    return Replay(
        time=time,
        position=position,
        quaternion=quaternion,
        geometries=tuple(drawn_shapes(plant.drawn_model())),
        forces=(*contacts, *acting),
        markers={name: target[rows] for name, target in run.targets.items()},
    )


def _force_track(name: str, kind: Literal["contact", "push"], count: int) -> ForceTrack:
    """A force that never acts, to be filled."""
    points, forces = np.full((count, 3), np.nan), np.zeros((count, 3))
    return ForceTrack(name=name, kind=kind, point=points, force=forces)


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
            shape, count = _PRIMITIVES[kind]
            size = tuple(float(s) for s in model.geom_size[geom][:count])
            shapes.append(Geometry(shape=shape, size=size, **common))
        elif kind == int(mujoco.mjtGeom.mjGEOM_MESH):
            vertices, faces = _mesh(model, int(model.geom_dataid[geom]))
            shapes.append(Geometry(shape="mesh", vertices=vertices, faces=faces, **common))
    return shapes


def _colour(model: mujoco.MjModel, geom: int) -> Float64[np.ndarray, "4"]:
    material = int(model.geom_matid[geom])
    return (model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]).astype(np.float64)


def _mesh(
    model: mujoco.MjModel, mesh: int, cell_size: float = 0.004
) -> tuple[Float64[np.ndarray, "nvert 3"], Int[np.ndarray, "nface 3"]]:
    """A mesh with its vertices merged cell by cell; faces that collapse are left out."""
    # A hand still looks like a hand, and a robot of 30 meshes fits into a page.
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(np.float64)
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    faces = model.mesh_face[first : first + count].astype(np.int64)
    cells = np.round(vertices / cell_size).astype(np.int64)
    cell = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
    size = np.bincount(cell).astype(np.float64)
    merged = np.column_stack([np.bincount(cell, vertices[:, k]) / size for k in range(3)])
    faces = cell[faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return merged, np.unique(faces[whole], axis=0)
