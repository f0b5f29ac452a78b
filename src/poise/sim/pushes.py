"""Pushes on the plant's bodies while it runs."""

import mujoco
import numpy as np

from poise.errors import UnknownNameError
from poise.robots.robot import Robot
from poise.sim.disturbances import Push


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
            share = push.share(begin, end)
            if share > 0.0:
                point = data.site_xpos[site] if site >= 0 else data.xipos[body]
                force = share * np.array(push.force, dtype=np.float64)
                mujoco.mj_applyFT(
                    self._model, data, force, self._torque, point, body, data.qfrc_applied
                )
                self._acting = True
