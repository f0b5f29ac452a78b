"""`asymmetries`: where a left and a right limb are not mirror images of each other."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import few

_UNEQUAL = 0.03
"""Left and right links may differ by this part of their mass before it is said."""

_ASKEW = 0.01
"""And the sizes of their joints' offsets by this much [m]."""

_OFF = 0.03
"""And their centres of mass may lie this far from each other's mirror image [m]."""

_TIMES = 2.0
"""And their largest principal inertias may be this many times each other."""


def asymmetries(
    model: pin.Model,
    upright: Float64[np.ndarray, "3 3"],
    left: Sequence[int],
    right: Sequence[int],
) -> tuple[str, ...]:
    """Compare two limbs joint by joint, all joints at zero.

    Args:
        model: the model with a free base as its first joint.
        upright: world_R_base, as the document puts the robot.
        left: joints of a limb, from the trunk outwards.
        right: those of the other, as many.

    Returns:
        What differs, as sentences; nothing more of links whose mass differs.
    """
    said: list[str] = []
    off: list[str] = []
    heavier: list[str] = []
    pairs = list(zip(left, right, strict=True))
    for (a, b), apart in zip(pairs, _com_distances(model, upright, pairs), strict=True):
        names = model.names[a], model.names[b]
        one, other = float(model.inertias[a].mass), float(model.inertias[b].mass)
        if abs(one - other) > _UNEQUAL * max(one, other, 0.1):
            said.append(f"behind {names[0]} are {one:.2f} kg, behind {names[1]} {other:.2f} kg")
        else:
            if apart > _OFF:
                off.append(f"{names[0]} by {1e3 * apart:.0f} mm")
            largest = [_largest_inertia(model, j) for j in (a, b)]
            if max(largest) > _TIMES * min(largest):
                heavier.append(f"{names[0]} ({largest[0]:.2g} and {largest[1]:.2g} kg m^2)")
        lengths = [float(np.linalg.norm(model.jointPlacements[j].translation)) for j in (a, b)]
        if abs(lengths[0] - lengths[1]) > _ASKEW:
            said.append(
                f"{names[0]} is {1e3 * lengths[0]:.0f} mm from the joint before it, "
                f"{names[1]} {1e3 * lengths[1]:.0f} mm"
            )
    if off:
        said.append(f"centres of mass are not mirrored behind {few(off)}")
    if heavier:
        said.append(f"largest principal inertias behind {few(heavier)}")
    return tuple(said)


def _com_distances(
    model: pin.Model, upright: Float64[np.ndarray, "3 3"], pairs: Sequence[tuple[int, int]]
) -> list[float]:
    """How far each right link's COM is from the mirror image of the left one's [m].

    Each is seen from its own joint, so that an offset before it does not count again.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    ends = [upright @ data.oMi[j].translation for j in pairs[-1]]
    normal = (ends[0] - ends[1]) * [1.0, 1.0, 0.0]
    normal /= np.linalg.norm(normal)
    found: list[float] = []
    for pair in pairs:
        left, right = (upright @ data.oMi[j].rotation @ model.inertias[j].lever for j in pair)
        found.append(float(np.linalg.norm(left - 2.0 * (left @ normal) * normal - right)))
    return found


def _largest_inertia(model: pin.Model, joint: int) -> float:
    """The largest principal inertia of what a joint moves [kg m^2]."""
    return float(np.linalg.eigvalsh(model.inertias[joint].inertia)[2])
