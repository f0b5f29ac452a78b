"""The one place where Pinocchio's order of things and MuJoCo's meet, by joint name.

Pinocchio: base position, base quaternion (x, y, z, w), joints; base linear and angular velocity in
the base frame, joints. MuJoCo: base position, base quaternion (w, x, y, z), joints; base linear
velocity in the world and angular velocity in the base frame, joints. The base frame has the same
origin and axes in both.
"""

import mujoco
import numpy as np
from jaxtyping import Float64, Int

from poise.errors import RobotError
from poise.robots import Robot


class StateMap:
    """Index arrays between the vectors of a `Robot` and those of its MuJoCo model.

    Args:
        robot: the robot.
        model: the MuJoCo model built from it.

    Raises:
        RobotError: a joint is missing on one side, or is not a single hinge or slide.
    """

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        self._floating = robot.floating_base
        names, q_pin, v_pin = _pinocchio_joints(robot)
        ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in names]
        _check_joints(robot, model, names, ids)
        q_mj, v_mj = model.jnt_qposadr[ids].tolist(), model.jnt_dofadr[ids].tolist()
        base_q = [0, 1, 2, 4, 5, 6, 3] if self._floating else []
        base_v = list(range(6)) if self._floating else []
        self._qpos_of_q = _scatter(robot.nq, [*range(len(base_q)), *q_pin], [*base_q, *q_mj])
        self._qvel_of_v = _scatter(robot.nv, [*base_v, *v_pin], [*base_v, *v_mj])
        self._q_of_qpos = np.argsort(self._qpos_of_q)
        self._v_of_qvel = np.argsort(self._qvel_of_v)
        self._unturn = np.empty(4)
        self._linear = np.empty(3)

    @property
    def dof_order(self) -> Int[np.ndarray, " nv"]:
        """For each of Pinocchio's velocities, its index in MuJoCo's (base frames still differ)."""
        return self._qvel_of_v.copy()

    def q(self, qpos: Float64[np.ndarray, " nq"]) -> Float64[np.ndarray, " nq"]:
        """Pinocchio's configuration from MuJoCo's [m, rad]."""
        return qpos[self._qpos_of_q]

    def v(
        self, qpos: Float64[np.ndarray, " nq"], qvel: Float64[np.ndarray, " nv"]
    ) -> Float64[np.ndarray, " nv"]:
        """Pinocchio's velocity from MuJoCo's, base in the base frame [m/s, rad/s]."""
        v = qvel[self._qvel_of_v]
        if self._floating:
            mujoco.mju_negQuat(self._unturn, qpos[3:7])
            mujoco.mju_rotVecQuat(v[:3], qvel[:3], self._unturn)
        return v

    def qpos(self, q: Float64[np.ndarray, " nq"]) -> Float64[np.ndarray, " nq"]:
        """MuJoCo's configuration from Pinocchio's [m, rad]."""
        return q[self._q_of_qpos]

    def qvel(
        self, q: Float64[np.ndarray, " nq"], v: Float64[np.ndarray, " nv"]
    ) -> Float64[np.ndarray, " nv"]:
        """MuJoCo's velocity from Pinocchio's, base linear in the world [m/s, rad/s]."""
        qvel = v[self._v_of_qvel]
        if self._floating:
            mujoco.mju_rotVecQuat(self._linear, v[:3], q[[6, 3, 4, 5]])
            qvel[:3] = self._linear
        return qvel


def _pinocchio_joints(robot: Robot) -> tuple[list[str], list[int], list[int]]:
    """Names of the hinges and slides, with their places in q and v."""
    joints = list(robot.model.joints)[2 if robot.floating_base else 1 :]
    names = list(robot.model.names)[2 if robot.floating_base else 1 :]
    for name, joint in zip(names, joints, strict=True):
        if (joint.nq, joint.nv) != (1, 1):
            raise RobotError(
                f"joint {name!r} of robot {robot.name!r} cannot be simulated",
                got=joint.shortname(),
                wanted="a hinge or slide with one position variable (give limits to a joint "
                "that turns without end)",
            )
    return names, [j.idx_q for j in joints], [j.idx_v for j in joints]


def _check_joints(robot: Robot, model: mujoco.MjModel, names: list[str], ids: list[int]) -> None:
    missing = [n for n, i in zip(names, ids, strict=True) if i < 0]
    if missing:
        raise RobotError(
            f"joints of robot {robot.name!r} are not in its document",
            got=missing,
            choices=[model.joint(i).name for i in range(model.njnt)],
        )
    if (model.nq, model.nv) != (robot.nq, robot.nv):
        raise RobotError(
            f"the document of robot {robot.name!r} has other degrees of freedom than its model",
            got=f"nq = {model.nq}, nv = {model.nv}",
            wanted=f"nq = {robot.nq}, nv = {robot.nv}",
        )


def _scatter(size: int, places: list[int], values: list[int]) -> Int[np.ndarray, " n"]:
    out = np.empty(size, dtype=np.int64)
    out[places] = values
    return out
