"""What a model file lacks of its joints' limits and rotors, proposed: `propose_limits`, ..."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.robots._document import JointLimits
from poise.robots._kinematics import hinges
from poise.robots._limits import apply_limits, assume_limits
from poise.robots._proposal import Draft

_RUN_UP = 0.004
"""A motor alone reaches its top speed within about this time [s]: published rotor inertias of G1
and T1 are 0.003 to 0.006 s times torque limit over speed limit."""

_LEAST_ROTOR = 0.02
"""No rotor is assumed smaller than this part of the inertia that its joint moves."""

_MOST_ROTOR = 0.01
"""None is assumed larger than that inertia, or than this where the joint moves less [kg m^2]."""


def propose_positions(
    draft: Draft,
    model: pin.Model,
    endless: Mapping[str, tuple[float, float]],
    locked: Sequence[str],
) -> None:
    """Gives a range to hinges without one, which Poise needs.

    Args:
        draft: is told.
        model: is changed.
        endless: ranges of those that are known to have none.
        locked: joints that have no need of one.
    """
    unlimited = dict(endless)
    for name, joint in hinges(model):
        low = float(model.lowerPositionLimit[joint.idx_q])
        high = float(model.upperPositionLimit[joint.idx_q])
        if not (math.isfinite(low) and math.isfinite(high) and abs(high - low) < 1e300):
            unlimited[name] = (-math.pi, math.pi)
    apply_limits(model, JointLimits(position=unlimited))
    free = [n for n in unlimited if n not in locked]
    if free:
        draft.facts["limits"] = {"position": {n: [-3.1416, 3.1416] for n in free}}
        draft.reasons["limits.position"] = (
            "assumed: one turn for joints that the file lets turn without end [rad]"
        )


def propose_limits(draft: Draft, model: pin.Model, soles: Sequence[int]) -> None:
    """Limits of velocity and torque where the file has none.

    Args:
        draft: is told.
        model: is changed.
        soles: frames of the soles.
    """
    before = model.velocityLimit.copy(), model.effortLimit.copy()
    names = [model.frames[i].name for i in soles]
    said = assume_limits(model, names)
    limits = draft.facts.setdefault("limits", {})
    for key, now, old in (
        ("velocity", model.velocityLimit, before[0]),
        ("torque", model.effortLimit, before[1]),
    ):
        changed = {
            name: float(f"{now[j.idx_v]:.3g}")
            for name, j in hinges(model)
            if now[j.idx_v] != old[j.idx_v]
        }
        if changed:
            limits[key] = changed
            why = next(s for s in said if s.startswith(key))
            draft.reasons[f"limits.{key}"] = f"assumed, as the file has none: {why}"
    if not limits:
        del draft.facts["limits"]


def propose_armature(draft: Draft, model: pin.Model, q: Float64[np.ndarray, " nq"]) -> None:
    """Rotor inertias where the file has none: _RUN_UP times torque over speed limit.

    Args:
        draft: is told.
        model: with limits.
        q: at which the moved inertia is taken.
    """
    data = model.createData()
    pin.crba(model, data, q)
    found: dict[str, float] = {}
    for name, joint in hinges(model):
        dof = joint.idx_v
        if model.armature[dof] > 0.0:
            continue
        moved = float(data.M[dof, dof])
        rotor = _RUN_UP * float(model.effortLimit[dof] / model.velocityLimit[dof])
        rotor = min(max(rotor, _LEAST_ROTOR * moved), max(moved, _MOST_ROTOR))
        found[name] = float(f"{rotor:.2g}")
    if found:
        draft.facts["armature"] = found
        draft.reasons["armature"] = (
            "estimated, as the file has none: 4 ms times torque limit over speed limit, and "
            "at least 2 % of the inertia that the joint moves [kg m^2]"
        )
