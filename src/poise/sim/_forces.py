"""Forces of the ground on the soles, and the pushes on a plant while it runs."""

from collections.abc import Mapping

import mujoco
import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import UnknownNameError
from poise.robots import Robot
from poise.sim._config import Push

_FORCE_FIRST = np.array([3, 4, 5, 0, 1, 2])  # order of a wrench, in that of MuJoCo
LOADED = 1.0  # a sole with less force on it carries nothing [N]


class PushSchedule:
    """The pushes of a run, applied each physics step."""

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        self._robot, self._model = robot, model
        self._pushes: list[tuple[Push, int, int]] = []
        self._torque = np.zeros(3)
        self._acting = False

    def add(self, push: Push) -> None:
        """Schedule a push."""
        role = self._robot.roles.get(push.body)
        link = role.link if role else push.body
        body = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, link)
        if body <= 0:
            links = (self._model.body(i).name for i in range(1, self._model.nbody))
            raise UnknownNameError(
                f"unknown frame or link of robot {self._robot.name!r}",
                got=push.body,
                choices=(*self._robot.roles, *(name for name in links if name)),
            )
        site = self._model.site(push.body).id if role else -1
        self._pushes.append((push, body, site))

    def clear(self, data: mujoco.MjData) -> None:
        """Forget all pushes."""
        self._pushes.clear()
        data.qfrc_applied[:] = 0.0
        self._acting = False

    def __len__(self) -> int:
        return len(self._pushes)

    def apply(self, data: mujoco.MjData, begin: float, end: float) -> None:
        """Set the generalized forces for the physics step from `begin` to `end` [s]."""
        if self._acting:
            data.qfrc_applied[:] = 0.0
            self._acting = False
        for push, body, site in self._pushes:
            fraction = push.fraction(begin, end)
            if fraction > 0.0:
                point = data.site_xpos[site] if site >= 0 else data.xipos[body]
                force = fraction * np.array(push.force, dtype=np.float64)
                mujoco.mj_applyFT(
                    self._model, data, force, self._torque, point, body, data.qfrc_applied
                )
                self._acting = True
        if self._pushes and min(push.end for push, *_ in self._pushes) <= begin:
            # A pull that a user adds in every tick would slow down a long run.
            self._pushes = [p for p in self._pushes if p[0].end > begin]


class SoleForces:
    """Wrenches of the ground on the soles at the last physics step."""

    # MuJoCo has for each body the external wrench [moment; force] about the centre of mass of the
    # whole tree; pushes go in elsewhere, so on a foot this is the ground's reaction alone.

    def __init__(self, model: mujoco.MjModel, soles: Mapping[str, tuple[int, pin.SE3]]) -> None:
        self._soles = [
            (
                name,
                body,
                _touching_beside(model, body),
                place.translation,
                None if np.array_equal(place.rotation, np.eye(3)) else place.rotation,
            )
            for name, (body, place) in soles.items()
        ]
        self._root = int(model.body_rootid[self._soles[0][1]]) if self._soles else 0
        self._total: Float64[np.ndarray, "6"] = np.zeros(6)
        self._origin: Float64[np.ndarray, "3"] = np.zeros(3)
        self._center, self._turned = np.empty(3), np.empty(6)

    def update(self, data: mujoco.MjData) -> dict[str, Float64[np.ndarray, "6"]]:
        """Wrench [force; moment] by sole in its frame [N, N m], from an up-to-date `cfrc_ext`."""
        in_soles: dict[str, Float64[np.ndarray, "6"]] = {}
        center, turned, wrenches = self._center, self._turned, data.cfrc_ext
        self._total[:] = 0.0
        self._origin[:] = data.subtree_com[self._root]
        for name, body, others, offset, body_R_sole in self._soles:
            wrench = wrenches[body]
            for other in others:
                wrench = wrench + wrenches[other]
            self._total += wrench
            world_R_body = data.xmat[body]
            mujoco.mju_mulMatVec3(center, world_R_body, offset)
            center += data.xpos[body]
            world_R_sole = world_R_body
            if body_R_sole is not None:
                world_R_sole = (world_R_body.reshape(3, 3) @ body_R_sole).ravel()
            mujoco.mju_transformSpatial(turned, wrench, 1, center, self._origin, world_R_sole)
            in_soles[name] = turned.take(_FORCE_FIRST)
        return in_soles

    def zmp(self, height: float) -> Float64[np.ndarray, "2"]:
        """Zero-moment point of all soles on the plane z = height, in the world [m]."""
        n_x, n_y, _, f_x, f_y, f_z = self._total.tolist()
        if not f_z > LOADED:
            return np.full(2, np.nan)
        x, y, z = self._origin.tolist()
        n_x += y * f_z - (z - height) * f_y
        n_y += (z - height) * f_x - x * f_z
        return np.array([-n_y / f_z, n_x / f_z])


def _touching_beside(model: mujoco.MjModel, body: int) -> list[int]:
    """Other bodies, rigidly one with a body, whose geometry can touch anything."""
    solid = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    bodies = np.unique(model.geom_bodyid[solid])
    one = bodies[model.body_weldid[bodies] == model.body_weldid[body]]
    return [b for b in one.tolist() if b != body]
