"""Which degrees of freedom equalities, tendons and actuators of a MuJoCo model act on."""

from collections.abc import Collection
from copy import copy
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Bool, Int

from poise.errors import RobotError, UnknownNameError
from poise.robots import Robot

_ROUNDING = 1e-9  # entries of Jacobians below this are rounding


class Couplings(NamedTuple):
    """Degrees of freedom in which the Jacobian has entries: active equalities, tendons, outputs."""

    equalities: Bool[np.ndarray, "neq nv"]
    tendons: Bool[np.ndarray, "ntendon nv"]
    outputs: Bool[np.ndarray, "noutput nv"]  # of actuators


def find_couplings(model: mujoco.MjModel, own: Int[np.ndarray, " n"]) -> Couplings:
    """Evaluate the Jacobians in some random postures of the robot, whose degrees are `own`."""
    model = copy(model)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data, nv = mujoco.MjData(model), model.nv
    counts = model.neq, model.ntendon, len(data.moment_rownnz)
    found = Couplings(*(np.zeros((count, nv), dtype=np.bool_) for count in counts))
    lengths, moments = np.zeros(found.tendons.shape), np.zeros(found.outputs.shape)
    pattern = model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
    random = np.random.default_rng(0)
    for _ in range(3):  # In one alone an entry may vanish by chance.
        # All else stays where it is, so that a loop within what one link carries stays closed.
        motion = np.zeros(nv)
        motion[own] = random.normal(size=len(own))
        mujoco.mj_integratePos(model, data.qpos, motion, 1.0)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_flex(model, data)
        mujoco.mj_tendon(model, data)
        mujoco.mj_transmission(model, data)
        mujoco.mj_makeConstraint(model, data)
        if model.ntendon:
            mujoco.mju_sparse2dense(lengths, data.ten_J, *pattern)
        moment = data.moment_rownnz, data.moment_rowadr, data.moment_colind
        mujoco.mju_sparse2dense(moments, data.actuator_moment, *moment)
        for row in np.flatnonzero(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY):
            entries = data.efc_J[row * nv : (row + 1) * nv]
            found.equalities[data.efc_id[row]] |= np.abs(entries) > _ROUNDING
        found.tendons[:] |= np.abs(lengths) > _ROUNDING
        found.outputs[:] |= np.abs(moments) > _ROUNDING
    return found


def check_equalities(
    robot: Robot,
    model: mujoco.MjModel,
    acting: Int[np.ndarray, " k"],
    accepted: Collection[str],
) -> list[str]:
    """Refuse equalities that act on the robot, but for those accepted by name; describe these."""
    names = [model.equality(k).name or f"equality {k}" for k in range(model.neq)]
    for name in accepted:
        if name not in names:
            raise UnknownNameError("unknown equality of the model", got=name, choices=names)
    found = {names[k]: _describe(model, k, names[k]) for k in acting.tolist()}
    refused = [text for name, text in found.items() if name not in accepted]
    if refused:
        raise RobotError(
            f"equalities of the MuJoCo model act on robot {robot.name!r}, whose joints move "
            "independently to the controller",
            got=refused,
            wanted='each deactivated (active="false"), its joints locked in the description that '
            "the robot is loaded with, or its name in accept_equalities",
        )
    return [text for name, text in found.items() if name in accepted]


def pulling_tendons(model: mujoco.MjModel, acting: Int[np.ndarray, " k"]) -> list[str]:
    """Names of those tendons that pull without an actuator."""
    kinds = ("limited", "stiffness", "damping", "frictionloss", "armature")
    pulls = np.any([getattr(model, f"tendon_{kind}") for kind in kinds], axis=0)
    return [model.tendon(k).name or f"tendon {k}" for k in acting if pulls[k]]


def _describe(model: mujoco.MjModel, k: int, name: str) -> str:
    kind = mujoco.mjtEq(int(model.eq_type[k])).name.removeprefix("mjEQ_")
    # MJCF text says of bodies and sites only that it ties such.
    told = next((n for n in ("JOINT", "TENDON", "FLEX") if kind.startswith(n)), None)
    said = mujoco.mjtObj(int(model.eq_objtype[k]))
    what = getattr(mujoco.mjtObj, f"mjOBJ_{told}") if told else said
    ids = (int(i) for i in (model.eq_obj1id[k], model.eq_obj2id[k]) if i >= 0)
    other = what.name.removeprefix("mjOBJ_").lower()
    things = (mujoco.mj_id2name(model, what, i) or f"{other} {i}" for i in ids)
    return f"{name} ({kind.lower()}): {', '.join(things)}"
