"""`mjcf_of`: MJCF text of a compiled MuJoCo model, which MuJoCo itself does not write."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from typing import Any

import numpy as np

from poise.errors import RobotError
from poise.robots._mjcf_compile import mujoco_module

_SOLIDS = {
    "SPHERE": 1,
    "CAPSULE": 2,
    "ELLIPSOID": 3,
    "CYLINDER": 2,
    "BOX": 3,
    "MESH": 0,
    "PLANE": 3,
}
"""Kinds of geoms that are written, and how many sizes they have."""


def mjcf_of(given: Any) -> str:
    """Write bodies, joints, geoms, sites, actuators, equalities and keyframes as MJCF.

    Args:
        given: a `mujoco.MjModel`, or a `mujoco.MjSpec`, which is compiled for it and not changed.

    Raises:
        RobotError: MuJoCo cannot compile the specification.
    """
    mujoco = mujoco_module("a MuJoCo model")
    if isinstance(given, mujoco.MjSpec):
        spec = given.copy()
        # Links stay apart, with what can be seen of them.
        spec.compiler.fusestatic = spec.compiler.discardvisual = False
        try:
            given = spec.compile()
        except ValueError as error:
            said = " ".join(str(error).split())
            raise RobotError(f"MuJoCo cannot compile the specification: {said}") from None
    return ET.tostring(_Writer(mujoco, given).root, encoding="unicode")


class _Writer:
    """The document of a model."""

    def __init__(self, mujoco: Any, model: Any) -> None:
        self._mujoco, self._model = mujoco, model
        self.root = ET.Element("mujoco", model=model.names.split(b"\0", 1)[0].decode())
        ET.SubElement(self.root, "compiler", angle="radian", autolimits="false")
        self._asset = ET.SubElement(self.root, "asset")
        self._bodies = {0: ET.SubElement(self.root, "worldbody")}
        self._joints = [self._name("joint", j) for j in range(model.njnt)]
        for body in range(1, model.nbody):
            self._add_body(body)
        for geom in range(model.ngeom):
            self._add_geom(geom)
        for site in range(model.nsite):
            place = {"pos": _words(model.site_pos[site]), "quat": _words(model.site_quat[site])}
            attributes = {"name": self._name("site", site), **place}
            ET.SubElement(self._bodies[int(model.site_bodyid[site])], "site", attributes)
        self._add_actuators()
        self._add_equalities()
        keys = ET.SubElement(self.root, "keyframe")
        for key in range(model.nkey):
            qpos = _words(model.key_qpos[key])
            ET.SubElement(keys, "key", name=model.key(key).name or f"key{key}", qpos=qpos)

    def _name(self, kind: str, index: int) -> str:
        return getattr(self._model, kind)(index).name or f"{kind}{index}"

    def _add_body(self, body: int) -> None:
        model = self._model
        place = {"pos": _words(model.body_pos[body]), "quat": _words(model.body_quat[body])}
        name = {"name": self._name("body", body)}
        parent = self._bodies[int(model.body_parentid[body])]
        element = self._bodies[body] = ET.SubElement(parent, "body", name | place)
        inertia = {
            "pos": _words(model.body_ipos[body]),
            "quat": _words(model.body_iquat[body]),
            "mass": repr(float(model.body_mass[body])),
            "diaginertia": _words(model.body_inertia[body]),
        }
        ET.SubElement(element, "inertial", inertia)
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            self._add_joint(element, joint)

    def _add_joint(self, body: ET.Element, joint: int) -> None:
        model, kinds = self._model, self._mujoco.mjtJoint
        kind = kinds(model.jnt_type[joint])
        name = self._joints[joint]
        if kind == kinds.mjJNT_FREE:
            ET.SubElement(body, "freejoint", name=name)
            return
        dof, limited = int(model.jnt_dofadr[joint]), bool(model.jnt_limited[joint])
        forced = bool(model.jnt_actfrclimited[joint])
        attributes = {
            "name": name,
            "type": kind.name.removeprefix("mjJNT_").lower(),
            "pos": _words(model.jnt_pos[joint]),
            "axis": _words(model.jnt_axis[joint]),
            "range": _words(model.jnt_range[joint]),
            "limited": str(limited).lower(),
            "actuatorfrcrange": _words(model.jnt_actfrcrange[joint]),
            "actuatorfrclimited": str(forced).lower(),
            "armature": repr(float(model.dof_armature[dof])),
            "damping": repr(float(np.ravel(model.dof_damping[dof])[0])),
            "frictionloss": repr(float(model.dof_frictionloss[dof])),
            "stiffness": repr(float(np.ravel(model.jnt_stiffness[joint])[0])),
        }
        if kind in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE):
            attributes["ref"] = repr(float(model.qpos0[model.jnt_qposadr[joint]]))
        ET.SubElement(body, "joint", attributes)

    def _add_geom(self, geom: int) -> None:
        model = self._model
        kind = self._mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_")
        if kind not in _SOLIDS:
            return
        attributes = {
            "type": kind.lower(),
            "pos": _words(model.geom_pos[geom]),
            "quat": _words(model.geom_quat[geom]),
            "contype": str(int(model.geom_contype[geom])),
            "conaffinity": str(int(model.geom_conaffinity[geom])),
            "group": str(int(model.geom_group[geom])),
            "rgba": _words(model.geom_rgba[geom]),
            # Masses of bodies are written with them.
            "mass": "0",
        }
        if model.geom_matid[geom] >= 0:
            attributes["rgba"] = _words(model.mat_rgba[model.geom_matid[geom]])
        if kind == "MESH":
            attributes["mesh"] = self._mesh(int(model.geom_dataid[geom]))
        else:
            attributes["size"] = _words(model.geom_size[geom][: _SOLIDS[kind]])
        ET.SubElement(self._bodies[int(model.geom_bodyid[geom])], "geom", attributes)

    def _mesh(self, mesh: int) -> str:
        """The name of a mesh, which is written with its vertices."""
        name, model = f"mesh{mesh}", self._model
        if not any(element.get("name") == name for element in self._asset):
            v, n = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            f, m = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
            corners = " ".join(map(str, np.ravel(model.mesh_face[f : f + m]).tolist()))
            points = _words(np.ravel(model.mesh_vert[v : v + n]))
            # A shell has an inertia, whatever its triangles enclose.
            attributes = {"name": name, "vertex": points, "face": corners, "inertia": "shell"}
            ET.SubElement(self._asset, "mesh", attributes)
        return name

    def _add_actuators(self) -> None:
        model, kinds = self._model, self._mujoco.mjtTrn
        actuators = ET.SubElement(self.root, "actuator")
        for motor in range(model.nu):
            if model.actuator_trntype[motor] not in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
                continue
            plain = int(model.actuator_biastype[motor]) == int(self._mujoco.mjtBias.mjBIAS_NONE)
            attributes = {
                "name": self._name("actuator", motor),
                "joint": self._joints[int(model.actuator_trnid[motor, 0])],
                "gear": _words(model.actuator_gear[motor]),
                "biastype": "none" if plain else "affine",
                "gainprm": repr(float(model.actuator_gainprm[motor, 0])),
            }
            for key, limited in (("force", "forcelimited"), ("ctrl", "ctrllimited")):
                is_limited = bool(getattr(model, f"actuator_{limited}")[motor])
                attributes[limited] = str(is_limited).lower()
                attributes[f"{key}range"] = _words(getattr(model, f"actuator_{key}range")[motor])
            ET.SubElement(actuators, "general", attributes)

    def _add_equalities(self) -> None:
        model, kinds = self._model, self._mujoco.mjtEq
        equalities = ET.SubElement(self.root, "equality")
        for index in range(model.neq):
            kind, one, other = (
                kinds(model.eq_type[index]),
                int(model.eq_obj1id[index]),
                int(model.eq_obj2id[index]),
            )
            data = model.eq_data[index]
            attributes = {
                "name": self._name("equality", index),
                "active": str(bool(model.eq_active0[index])).lower(),
            }
            if kind == kinds.mjEQ_JOINT:
                attributes["joint1"] = self._joints[one]
                if other >= 0:
                    attributes["joint2"] = self._joints[other]
                attributes["polycoef"] = _words(data[:5])
                ET.SubElement(equalities, "joint", attributes)
            elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                sites = model.eq_objtype[index] == self._mujoco.mjtObj.mjOBJ_SITE
                if sites:
                    one, other = (int(model.site_bodyid[site]) for site in (one, other))
                attributes["body1"] = self._name("body", one)
                if other > 0:
                    attributes["body2"] = self._name("body", other)
                connect = kind == kinds.mjEQ_CONNECT
                if connect:
                    attributes["anchor"] = _words(np.zeros(3) if sites else data[:3])
                ET.SubElement(equalities, "connect" if connect else "weld", attributes)


def _words(values: Iterable[float]) -> str:
    return " ".join(repr(float(v)) for v in values)
