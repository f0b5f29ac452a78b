"""Forces on the soles, from what the simulator knows of its contacts.

Pushes on the plant's bodies while it runs.
"""

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.errors import UnknownNameError
from poise.robots import Robot
from poise.sim._disturbances import Push


class PushSchedule:
    """The pushes of a run, applied each physics step.

    Args:
        robot: the robot.
        model: its MuJoCo model.
    """

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        self._robot = robot
        self._model = model
        self._pushes: list[tuple[Push, int, int]] = []
        self._torque = np.zeros(3)
        self._acting = False

    def add(self, push: Push) -> None:
        """Schedule a push.

        Raises:
            UnknownNameError: no such frame or link.
        """
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


_MIN_LOAD = 1.0
"""Below this vertical force [N] the zero-moment point says nothing and is not given."""


class SoleForces:
    """Wrenches of the ground on the soles.

    MuJoCo gives, for each body, the total external wrench about the centre of mass of the whole
    tree; pushes go in elsewhere, so on a foot this is the ground's reaction alone.

    Args:
        robot: the robot.
        model: its MuJoCo model.
    """

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        self._names = tuple(robot.soles)
        self._bodies = np.array(
            [model.body(robot.roles[n].link).id for n in self._names], dtype=np.int64
        )
        self._sites = np.array([model.site(n).id for n in self._names], dtype=np.int64)
        self._root = int(model.body_rootid[self._bodies[0]]) if self._names else 0

    def in_world(
        self, data: mujoco.MjData
    ) -> tuple[
        Float64[np.ndarray, "ns 3"], Float64[np.ndarray, "ns 3"], Float64[np.ndarray, "ns 3"]
    ]:
        """Forces [N] and moments at the sole centres [N m] in the world, and those centres [m]."""
        wrenches = data.cfrc_ext[self._bodies]
        centers = data.site_xpos[self._sites]
        forces = wrenches[:, 3:]
        arms = centers - data.subtree_com[self._root]
        return forces, wrenches[:, :3] - _cross(arms, forces), centers

    def in_soles(self, data: mujoco.MjData) -> dict[str, Float64[np.ndarray, "6"]]:
        """Wrench [force; moment] on the robot by sole name, in the sole's frame [N, N m]."""
        if not self._names:
            return {}
        forces, moments, _ = self.in_world(data)
        world_R_soles = data.site_xmat[self._sites].reshape(-1, 3, 3)
        stacked = np.stack([forces, moments], axis=1) @ world_R_soles
        return dict(zip(self._names, stacked.reshape(-1, 6), strict=True))

    def zmp(self, data: mujoco.MjData, height: float) -> Float64[np.ndarray, "2"]:
        """Zero-moment point of all soles together on the plane z = height, in the world [m].

        With the total force f and total moment n about (0, 0, height), all in the world:
        x = -n_y / f_z, y = n_x / f_z.

        Returns:
            (x, y), NaN where the soles carry no load.
        """
        if not self._names:
            return np.full(2, np.nan)
        forces, moments, centers = self.in_world(data)
        vertical = float(forces[:, 2].sum())
        if not vertical > _MIN_LOAD:
            return np.full(2, np.nan)
        arms = centers - np.array([0.0, 0.0, height])
        total = (moments + _cross(arms, forces)).sum(axis=0)
        return np.array([-total[1], total[0]]) / vertical


def _cross(
    a: Float64[np.ndarray, "n 3"], b: Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n 3"]:
    """Row-wise cross product; `numpy.cross` takes four times as long on two rows."""
    out = np.empty_like(a)
    out[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    out[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    out[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return out
