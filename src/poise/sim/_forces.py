"""Forces on the soles, from what the simulator knows of its contacts.

Pushes on the plant's bodies while it runs.
"""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import UnknownNameError
from poise.robots import Robot
from poise.sim._disturbances import Push


class PushSchedule:
    """The pushes of a run, applied each physics step."""

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        self._robot = robot
        self._model = model
        self._pushes: list[tuple[Push, int, int]] = []
        self._torque = np.zeros(3)
        self._acting = False

    def add(self, push: Push) -> None:
        """Schedule a push."""
        role = self._robot.roles.get(push.body)
        link = role.link if role else push.body
        body = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, link)
        if body <= 0:
            links = [self._model.body(i).name for i in range(1, self._model.nbody)]
            raise UnknownNameError(
                f"unknown frame or link of robot {self._robot.name!r}",
                got=push.body,
                choices=(*self._robot.roles, *(n for n in links if n)),
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
        if self._pushes and min(push.start + push.duration for push, *_ in self._pushes) <= begin:
            # A pull that a user adds in every tick would slow down a long run.
            self._pushes = [p for p in self._pushes if p[0].start + p[0].duration > begin]


_MIN_LOAD = 1.0
"""Below this vertical force [N] the zero-moment point says nothing and is not given."""


Vector3 = Sequence[float]
"""Three plain numbers."""


class SoleForces:
    """Wrenches of the ground on the soles, looked at once and asked for as often as wanted.

    MuJoCo gives, for each body, the total external wrench about the centre of mass of the whole
    tree; pushes go in elsewhere, so on a foot this is the ground's reaction alone. Two soles are so
    few numbers that plain ones are three times as fast as arrays.

    Attributes:
        in_soles: wrench [force; moment] on the robot by sole name, in the sole's frame [N, N m].
    """

    def __init__(self, model: mujoco.MjModel, soles: Mapping[str, tuple[int, pin.SE3]]) -> None:
        self._soles: list[tuple[str, int, list[int], Vector3, Sequence[float] | None]] = [
            (
                name,
                body,
                _touching_beside(model, body),
                body_T_sole.translation.tolist(),
                _rows(body_T_sole.rotation),
            )
            for name, (body, body_T_sole) in soles.items()
        ]
        self._root = int(model.body_rootid[self._soles[0][1]]) if self._soles else 0
        self.in_soles: dict[str, Float64[np.ndarray, "6"]] = {}
        # Of each sole: force, moment about its centre, and that centre.
        self._in_world: list[tuple[Vector3, Vector3, Vector3]] = []

    def update(self, data: mujoco.MjData) -> None:
        """Looks at the forces of the last physics step, which `cfrc_ext` has to be up to date for.

        MuJoCo fills that in by itself only where the model has a sensor that needs it.
        """
        self._in_world, self.in_soles = [], {}
        origin: Vector3 = data.subtree_com[self._root].tolist()
        for name, body, others, offset, body_R_sole in self._soles:
            wrench: list[float] = data.cfrc_ext[body].tolist()
            for other in others:
                wrench = [a + b for a, b in zip(wrench, data.cfrc_ext[other].tolist(), strict=True)]
            world_R_body: Sequence[float] = data.xmat[body].tolist()
            center = _sum(data.xpos[body].tolist(), _turned(world_R_body, offset))
            force = wrench[3:]
            moment = _difference(wrench[:3], _cross(_difference(center, origin), force))
            self._in_world.append((force, moment, center))
            world_R_sole = (
                world_R_body if body_R_sole is None else _product(world_R_body, body_R_sole)
            )
            turned = (*_turned_back(world_R_sole, force), *_turned_back(world_R_sole, moment))
            self.in_soles[name] = np.array(turned)

    def zmp(self, height: float) -> Float64[np.ndarray, "2"]:
        """Zero-moment point of all soles together on the plane z = height, in the world [m].

        With the total force f and total moment n about (0, 0, height), all in the world:
        x = -n_y / f_z, y = n_x / f_z.
        """
        vertical = sum(force[2] for force, _, _ in self._in_world)
        if not vertical > _MIN_LOAD:
            return np.full(2, np.nan)
        about_x = about_y = 0.0
        for (fx, fy, fz), moment, (x, y, z) in self._in_world:
            about_x += moment[0] + (y * fz - (z - height) * fy)
            about_y += moment[1] + ((z - height) * fx - x * fz)
        return np.array([-about_y / vertical, about_x / vertical])


def _touching_beside(model: mujoco.MjModel, body: int) -> list[int]:
    """Other bodies, rigidly one with a body, whose geometry can touch anything."""
    solid = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    bodies = {int(b) for b in model.geom_bodyid[solid]}
    one = [b for b in bodies if model.body_weldid[b] == model.body_weldid[body]]
    return sorted(b for b in one if b != body)


def _rows(R: Float64[np.ndarray, "3 3"]) -> Sequence[float] | None:
    """The rows of a rotation one after another, None where it turns nothing."""
    return None if np.array_equal(R, np.eye(3)) else R.ravel().tolist()


def _product(R: Sequence[float], S: Sequence[float] | None) -> Sequence[float]:
    """R S, all with their rows one after another; R where S turns nothing."""
    if S is None:
        return R
    columns = [_turned(R, (S[k], S[k + 3], S[k + 6])) for k in range(3)]
    return [column[row] for row in range(3) for column in columns]


def _sum(a: Vector3, b: Vector3) -> tuple[float, float, float]:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _difference(a: Vector3, b: Vector3) -> tuple[float, float, float]:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Vector3, b: Vector3) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _turned(R: Sequence[float], a: Vector3) -> tuple[float, float, float]:
    """R a, with the rows of R one after another."""
    x, y, z = a
    return (
        R[0] * x + R[1] * y + R[2] * z,
        R[3] * x + R[4] * y + R[5] * z,
        R[6] * x + R[7] * y + R[8] * z,
    )


def _turned_back(R: Sequence[float], a: Vector3) -> tuple[float, float, float]:
    """R^T a, with the rows of R one after another."""
    x, y, z = a
    return (
        R[0] * x + R[3] * y + R[6] * z,
        R[1] * x + R[4] * y + R[7] * z,
        R[2] * x + R[5] * y + R[8] * z,
    )
