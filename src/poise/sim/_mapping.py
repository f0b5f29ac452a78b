"""The one place where Pinocchio's order of things and MuJoCo's meet, by joint name.

Pinocchio: base position, base quaternion (x, y, z, w), joints; base linear and angular velocity in
the base frame, joints. MuJoCo: base position, base quaternion (w, x, y, z), joints; base linear
velocity in the world and angular velocity in the frame of the free joint's body, joints.
"""

import mujoco
import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int

from poise.errors import RobotError
from poise.robots import Robot, joint_kind


class StateMap:
    """Index arrays between the vectors of a `Robot` and those of a MuJoCo model that has it."""

    joints: tuple[int, ...]  # the model's index of each joint, in the robot's order
    free_joint: int | None  # the model's index of the base's free joint; None for a fixed base

    def __init__(
        self,
        robot: Robot,
        model: mujoco.MjModel,
        *,
        prefix: str = "",
        body_T_base: pin.SE3 | None = None,
    ) -> None:
        kind = mujoco.mjtObj.mjOBJ_JOINT
        ids = [mujoco.mj_name2id(model, kind, prefix + name) for name in robot.joint_names]
        _check_joints(robot, model, ids)
        self.joints = tuple(ids)
        self.free_joint = _free_joint(robot, model, ids)
        self._offset = body_T_base
        q_mj, v_mj = model.jnt_qposadr[ids].tolist(), model.jnt_dofadr[ids].tolist()
        base_q, base_v = [], []
        if self.free_joint is not None:
            q0, v0 = (int(a[self.free_joint]) for a in (model.jnt_qposadr, model.jnt_dofadr))
            base_q = [q0 + k for k in (0, 1, 2, 4, 5, 6, 3)]
            base_v = [v0 + k for k in range(6)]
        self._qpos_of_q = np.array([*base_q, *q_mj], dtype=np.int64)
        self._qvel_of_v = np.array([*base_v, *v_mj], dtype=np.int64)
        self._quaternion = slice(base_q[6], base_q[6] + 4) if base_q else slice(0)
        self._model, self._first = model, robot.model.njoints - robot.nj
        self._unturn, self._linear = np.empty(4), np.empty(3)

    @property
    def dof_order(self) -> Int[np.ndarray, " nv"]:
        """Index in MuJoCo's velocity of each of Pinocchio's (base frames still differ)."""
        return self._qvel_of_v.copy()

    def movers(self) -> dict[int, int]:
        """Bodies of the world and the robot, with Pinocchio's joint that moves each; 0 for none."""
        model, joint_of = self._model, {j: self._first + k for k, j in enumerate(self.joints)}
        if self.free_joint is not None:
            joint_of[self.free_joint] = self._first - 1
        root, movers = model.body_rootid[model.jnt_bodyid[self.joints[0]]], {0: 0}
        # MuJoCo has a body after its parent.
        for body in np.flatnonzero(model.body_rootid == root).tolist():
            start = int(model.body_jntadr[body])
            own = [j for j in range(start, start + int(model.body_jntnum[body])) if j in joint_of]
            movers[body] = joint_of[own[-1]] if own else movers[int(model.body_parentid[body])]
        return movers

    def q(self, qpos: Float64[np.ndarray, " nqpos"]) -> Float64[np.ndarray, " nq"]:
        """Pinocchio's configuration from MuJoCo's [m, rad]."""
        q = qpos[self._qpos_of_q]
        if self._offset is not None:
            q[:7] = pin.SE3ToXYZQUAT(pin.XYZQUATToSE3(q[:7]) * self._offset)
        return q

    def v(
        self, qpos: Float64[np.ndarray, " nqpos"], qvel: Float64[np.ndarray, " nqvel"]
    ) -> Float64[np.ndarray, " nv"]:
        """Pinocchio's velocity from MuJoCo's, base in the base frame [m/s, rad/s]."""
        v = qvel[self._qvel_of_v]
        if self.free_joint is not None:
            mujoco.mju_negQuat(self._unturn, qpos[self._quaternion])
            mujoco.mju_rotVecQuat(v[:3], v[:3].copy(), self._unturn)
            if self._offset is not None:
                v[:6] = self._offset.actInv(pin.Motion(v[:6])).vector
        return v

    def write(
        self,
        q: Float64[np.ndarray, " nq"],
        v: Float64[np.ndarray, " nv"],
        qpos: Float64[np.ndarray, " nqpos"],
        qvel: Float64[np.ndarray, " nqvel"],
    ) -> None:
        """Write a state of the robot into MuJoCo's vectors; all else stays as it is."""
        base: Float64[np.ndarray, "7"] = q[:7]
        motion: Float64[np.ndarray, "6"] = v[:6]
        if self._offset is not None:
            base = pin.SE3ToXYZQUAT(pin.XYZQUATToSE3(base) * self._offset.inverse())
            motion = self._offset.act(pin.Motion(motion)).vector
        qpos[self._qpos_of_q], qvel[self._qvel_of_v] = q, v
        if self.free_joint is not None:
            mujoco.mju_rotVecQuat(self._linear, motion[:3], base[[6, 3, 4, 5]])
            qpos[self._qpos_of_q[:7]] = base
            qvel[self._qvel_of_v[:6]] = (*self._linear, *motion[3:])

    def qpos(self, q: Float64[np.ndarray, " nq"]) -> Float64[np.ndarray, " nqpos"]:
        """MuJoCo's configuration from Pinocchio's, what is not the robot's as in the model."""
        qpos = self._model.qpos0.copy()
        self.write(q, np.zeros(len(self._qvel_of_v)), qpos, np.zeros(self._model.nv))
        return qpos

    def qvel(
        self, q: Float64[np.ndarray, " nq"], v: Float64[np.ndarray, " nv"]
    ) -> Float64[np.ndarray, " nqvel"]:
        """MuJoCo's velocity from Pinocchio's, base linear in the world, others at rest."""
        qvel = np.zeros(self._model.nv)
        self.write(q, v, self._model.qpos0.copy(), qvel)
        return qvel

    def at(self, q: Float64[np.ndarray, " nq"]) -> mujoco.MjData:
        """New data of the model with the kinematics of a configuration."""
        data = mujoco.MjData(self._model)
        data.qpos[:] = self.qpos(q)
        mujoco.mj_kinematics(self._model, data)
        return data


_KINDS = {"revolute": mujoco.mjtJoint.mjJNT_HINGE, "prismatic": mujoco.mjtJoint.mjJNT_SLIDE}
_FREE = mujoco.mjtJoint.mjJNT_FREE


def _check_joints(robot: Robot, model: mujoco.MjModel, ids: list[int]) -> None:
    """Refuse joints that are not in the model, are of another kind there, or turn without end."""
    missing, other = list[str](), list[str]()
    joints = list(robot.model.joints)[-robot.nj :]
    for name, joint, i in zip(robot.joint_names, joints, ids, strict=True):
        if (joint.nq, joint.nv) != (1, 1):
            raise RobotError(
                f"joint {name!r} of robot {robot.name!r} cannot be simulated",
                got=joint.shortname(),
                wanted="a hinge or slide with one position variable (give limits to a joint "
                "that turns without end)",
            )
        if i < 0:
            missing.append(name)
        elif model.jnt_type[i] != _KINDS[joint_kind(joint)]:
            other.append(name)
    if missing:
        raise RobotError(
            f"joints of robot {robot.name!r} are not in the MuJoCo model",
            got=missing,
            choices=[model.joint(i).name for i in range(model.njnt)],
        )
    if other:
        raise RobotError(
            f"joints of robot {robot.name!r} are of another kind in the MuJoCo model",
            got=other,
            wanted="a hinge or a slide each, as in the robot",
        )


def _free_joint(robot: Robot, model: mujoco.MjModel, ids: list[int]) -> int | None:
    """The free joint that carries all of the robot's joints; None for a fixed base."""
    bodies = [model.body(i).name for i in range(model.nbody)]
    root, *others = np.unique(model.body_rootid[model.jnt_bodyid[ids]]).tolist()
    if others:
        raise RobotError(
            f"the joints of robot {robot.name!r} hang on several bodies in the MuJoCo model",
            got=[bodies[i] for i in (root, *others)],
            wanted="one tree of bodies",
        )
    first = int(model.body_jntadr[root])
    free = first >= 0 and model.jnt_type[first] == _FREE
    if free == robot.floating_base:
        return first if free else None
    joints = np.flatnonzero(model.jnt_type == _FREE).tolist()
    raise RobotError(
        f"robot {robot.name!r} has a {'floating' if robot.floating_base else 'fixed'} base, but "
        f"in the MuJoCo model body {bodies[root]!r}, which carries it, has "
        f"{'a' if free else 'no'} free joint",
        got=[f"{model.joint(j).name!r} of body {bodies[model.jnt_bodyid[j]]!r}" for j in joints],
        wanted="a <freejoint/> in that body"
        if robot.floating_base
        else "no free joint in that body, or a description with base: floating",
    )
