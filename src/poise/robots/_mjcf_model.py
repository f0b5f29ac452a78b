"""`build_mjcf_model`: Pinocchio's model of the bodies, joints and sites that MuJoCo compiles."""

from typing import Any

import numpy as np
import pinocchio as pin

from poise.errors import RobotError
from poise.robots._document import WORLD, free_name
from poise.robots._mjcf_compile import mujoco_module, pose_of


def build_mjcf_model(compiled: Any, *, floating: bool, where: str) -> pin.Model:
    """Build the Pinocchio model of a compiled MJCF document, with its armature and friction.

    Joints are in MuJoCo's order. A hinge turns its body about `pos` by q - `ref`; several joints of
    one body follow each other, as MuJoCo has them.
    """
    names = {compiled.joint(j).name for j in range(compiled.njnt)}
    names |= {compiled.body(b).name for b in range(compiled.nbody)}
    return _Builder(compiled, free_name("root_joint", names) if floating else None, where).model


class _Builder:
    """Pinocchio's model, body by body in MuJoCo's order."""

    def __init__(self, compiled: Any, base: str | None, where: str) -> None:
        self._mujoco, self._compiled, self._where = mujoco_module(where), compiled, where
        self.model = pin.Model()
        self._joint_of = {0: 0}
        """Pinocchio's joint that moves each body."""
        self._placement = {0: pin.SE3.Identity()}
        """Of each body in that joint."""
        self._frame_of = {0: 0}
        if base is None:
            self._frame_of[0] = int(self.model.addBodyFrame(WORLD, 0, pin.SE3.Identity(), 0))
        else:
            self._joint_of[0] = self._add(base, 0, pin.JointModelFreeFlyer(), None)
        for body in range(1, compiled.nbody):
            self._add_body(body)
        # Once all joints are there: adding one reallocates these vectors.
        for joint in range(compiled.njnt):
            name, dof = compiled.joint(joint).name, int(compiled.jnt_dofadr[joint])
            v = self.model.joints[self.model.getJointId(name)].idx_v
            friction = float(compiled.dof_frictionloss[dof])
            self.model.armature[v] = float(compiled.dof_armature[dof])
            self.model.damping[v] = float(np.ravel(compiled.dof_damping[dof])[0])
            self.model.upperDryFrictionLimit[v] = friction
            self.model.lowerDryFrictionLimit[v] = -friction
        for site in range(compiled.nsite):
            self._add_site(site)

    def _add(self, name: str, parent: int, joint: Any, placement: pin.SE3 | None) -> int:
        start = pin.SE3.Identity() if placement is None else placement
        index = self.model.addJoint(parent, joint, start, name)
        self.model.addJointFrame(index, -1)
        return int(index)

    def _add_body(self, body: int) -> None:
        compiled = self._compiled
        above = int(compiled.body_parentid[body])
        moved_by = self._joint_of[above]
        here = self._placement[above] * pose_of(compiled.body_pos[body], compiled.body_quat[body])
        first = int(compiled.body_jntadr[body])
        for joint in range(first, first + int(compiled.body_jntnum[body])):
            moved_by, here = self._add_joint(joint, moved_by, here)
        self._joint_of[body], self._placement[body] = moved_by, here
        inertia = pin.Inertia(
            float(compiled.body_mass[body]), np.zeros(3), np.diag(compiled.body_inertia[body])
        )
        principal = pose_of(compiled.body_ipos[body], compiled.body_iquat[body])
        self.model.appendBodyToJoint(moved_by, inertia, here * principal)
        name = compiled.body(body).name
        self._frame_of[body] = int(
            self.model.addBodyFrame(name, moved_by, here, self._frame_of[above])
        )

    def _add_joint(self, joint: int, parent: int, here: pin.SE3) -> tuple[int, pin.SE3]:
        compiled, kinds = self._compiled, self._mujoco.mjtJoint
        name, kind = compiled.joint(joint).name, compiled.jnt_type[joint]
        axis = np.array(compiled.jnt_axis[joint], dtype=np.float64)
        anchor = pin.SE3(np.eye(3), np.array(compiled.jnt_pos[joint], dtype=np.float64))
        reference = -float(compiled.qpos0[compiled.jnt_qposadr[joint]])
        if kind == kinds.mjJNT_HINGE:
            model = pin.JointModelRevoluteUnaligned(axis)
            zero = pin.SE3(pin.exp3(reference * axis), np.zeros(3))
        elif kind == kinds.mjJNT_SLIDE:
            model = pin.JointModelPrismaticUnaligned(axis)
            zero = pin.SE3(np.eye(3), reference * axis)
        else:
            raise RobotError(
                f"joint {name!r} of {self._where} has several degrees of freedom",
                got=kinds(kind).name,
                wanted="hinges and slides in its place, one for each",
            )
        index = self._add(name, parent, model, here * anchor * zero)
        low, high = compiled.jnt_range[joint]
        limited, place = bool(compiled.jnt_limited[joint]), self.model.joints[index].idx_q
        self.model.lowerPositionLimit[place] = low if limited else -np.inf
        self.model.upperPositionLimit[place] = high if limited else np.inf
        dof = self.model.joints[index].idx_v
        self.model.velocityLimit[dof] = np.inf
        forced = bool(compiled.jnt_actfrclimited[joint])
        force = float(np.abs(compiled.jnt_actfrcrange[joint]).max()) if forced else np.inf
        self.model.effortLimit[dof] = force
        return index, anchor.inverse()

    def _add_site(self, site: int) -> None:
        compiled = self._compiled
        body = int(compiled.site_bodyid[site])
        name = compiled.site(site).name
        if not name or self.model.existFrame(name):
            return
        place = self._placement[body] * pose_of(compiled.site_pos[site], compiled.site_quat[site])
        kind = pin.FrameType.OP_FRAME
        self.model.addFrame(
            pin.Frame(name, self._joint_of[body], self._frame_of[body], place, kind), False
        )
