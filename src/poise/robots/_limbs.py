"""`find_limbs`: which joints of a stranger are legs and arms, from the tree of joints alone."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError

_FEWEST = 3
"""A leg or an arm has at least so many joints."""

_HAND_PART = 0.1
"""What a chain parts into is a hand or toes below this part of the robot's mass; arms are more."""

_MIRRORED = 0.08
"""Ends of a left and a right limb are mirror images within this part of the robot's height."""


@dataclass(frozen=True)
class Limbs:
    """Joints of a robot's limbs by index, each limb from the trunk outwards; left first.

    Attributes:
        legs: two legs.
        arms: two arms, or none; the last joint carries the hand.
        trunk: the joint that carries both arms.
        fingers: joints beyond the hands.
        forward: horizontal direction of the robot at zero, in the root link's axes turned upright.
        asymmetries: where left and right are not mirror images, as sentences.
    """

    legs: tuple[tuple[int, ...], tuple[int, ...]]
    arms: tuple[tuple[int, ...], ...]
    trunk: int
    fingers: tuple[int, ...]
    forward: Float64[np.ndarray, "3"]
    asymmetries: tuple[str, ...]


def find_limbs(model: pin.Model, upright: Float64[np.ndarray, "3 3"], where: str) -> Limbs:
    """Find the limbs: the two mirrored chains that reach lowest are legs, the next pair arms.

    Args:
        model: the model with a free base as its first joint.
        upright: world_R_base, as the document puts the robot.
        where: the file, for messages.

    Raises:
        RobotError: no two mirrored chains of three joints or more that reach below the root.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    places = np.array([upright @ data.oMi[j].translation for j in range(model.njoints)])
    branches = _branches(model)
    height = float(np.ptp(places[1:, 2])) if model.njoints > 2 else 0.0
    pairs = _mirrored_pairs(places, branches, _MIRRORED * max(height, 0.1))
    legs = min(pairs, key=lambda p: places[p[0][-1], 2], default=None)
    if legs is None or places[legs[0][-1], 2] > places[legs[0][0], 2] - 0.15 * height:
        raise RobotError(
            f"no feet are found in {where}",
            got=f"{len(branches)} chains of joints, none of them a mirrored pair of legs",
            wanted="two chains of at least three joints that reach down from the root; or a "
            "description, which for a robot that stands on a fixed base is the line `base: fixed` "
            "(poise.robots.description_template gives one to fill in)",
            choices=list(model.names)[2:],
        )
    legs = _left_first(model, legs, places)
    across = places[legs[0][-1]] - places[legs[1][-1]]
    forward = np.cross(np.array([across[0], across[1], 0.0]), [0.0, 0.0, 1.0])
    forward = _straightened(forward / np.linalg.norm(forward))
    arms = [p for p in pairs if not {*p[0], *p[1]} & {*legs[0], *legs[1]}]
    arms.sort(key=lambda p: -len(p[0]))
    pair = _left_first(model, arms[0], places) if arms else ()
    hands = tuple(_without_fingers(model, arm) for arm in pair)
    return Limbs(
        legs=legs,
        arms=hands,
        trunk=int(model.parents[hands[0][0]]) if hands else 1,
        fingers=tuple(j for h in hands for j in _beyond(model, h[-1])),
        forward=forward,
        asymmetries=(*_asymmetries(model, *legs), *(_asymmetries(model, *hands) if hands else ())),
    )


def _branches(model: pin.Model) -> list[tuple[int, ...]]:
    """Chains from where left and right part to their deepest ends: one for each limb."""
    depth = {j: len(model.supports[j]) for j in range(model.njoints)}
    children = _children(model)
    chains: list[tuple[int, ...]] = []
    trunks = [1]
    for joint in trunks:
        for child in children[joint]:
            end = max(_subtree(model, child), key=lambda j: depth[j])
            chain = tuple(int(j) for j in model.supports[end] if j >= child)
            # A waist or neck leads to further limbs: those start where it ends.
            if len(_ends(model, child, children)) > 1 and not _is_hand(model, child, children):
                trunks.append(child)
            else:
                chains.append(chain)
    return [c for c in chains if len(c) >= _FEWEST]


def _children(model: pin.Model) -> dict[int, list[int]]:
    children: dict[int, list[int]] = {j: [] for j in range(model.njoints)}
    for joint in range(1, model.njoints):
        children[int(model.parents[joint])].append(joint)
    return children


def _subtree(model: pin.Model, joint: int) -> list[int]:
    return [j for j in range(joint, model.njoints) if joint in list(model.supports[j])]


def _ends(model: pin.Model, joint: int, children: dict[int, list[int]]) -> list[int]:
    return [j for j in _subtree(model, joint) if not children[j]]


def _is_hand(model: pin.Model, joint: int, children: dict[int, list[int]]) -> bool:
    """Whether the chain from a joint parts into something as light as fingers, not into limbs."""
    place = joint
    while len(children[place]) == 1:
        place = children[place][0]
    beyond = {j for child in children[place] for j in _subtree(model, child)}
    mass = sum(float(model.inertias[j].mass) for j in beyond)
    return mass < _HAND_PART * sum(float(i.mass) for i in model.inertias)


def _mirrored_pairs(
    places: Float64[np.ndarray, "n 3"], branches: list[tuple[int, ...]], tolerance: float
) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Chains of equal length whose joints mirror each other across a vertical plane."""
    pairs: list[tuple[tuple[int, ...], tuple[int, ...]]] = []
    for i, one in enumerate(branches):
        for other in branches[i + 1 :]:
            if len(one) != len(other):
                continue
            a, b = places[list(one)], places[list(other)]
            level = np.abs(a[:, 2] - b[:, 2]).max() < tolerance
            # Shoulders may begin on the middle plane; hands and feet are off it.
            apart = a[-1] - b[-1]
            normal = np.array([apart[0], apart[1], 0.0])
            size = float(np.linalg.norm(normal))
            if not level or size < 1e-3:
                continue
            normal /= size
            middle = 0.5 * (a[-1] + b[-1])
            mirrored = a - 2.0 * np.outer((a - middle) @ normal, normal)
            if np.linalg.norm(mirrored - b, axis=1).max() < 2.0 * tolerance:
                pairs.append((one, other))
    return pairs


def _left_first(
    model: pin.Model,
    pair: tuple[tuple[int, ...], tuple[int, ...]],
    places: Float64[np.ndarray, "n 3"],
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """By the names of the joints; where these do not say, y points left."""
    one, other = pair
    names = ((model.names[a], model.names[b]) for a, b in zip(one, other, strict=True))
    votes = float(sum(_side(*pair) for pair in names))
    if votes == 0.0:
        votes = float(places[one[0], 1] - places[other[0], 1])
    return (one, other) if votes > 0 else (other, one)


def _side(name: str, other: str) -> int:
    """One where the first name is the left one: they part at an l against an r."""
    letters = zip(name.lower(), other.lower(), strict=False)
    parted = next(((a, b) for a, b in letters if a != b), ("", ""))
    return {("l", "r"): 1, ("r", "l"): -1}.get(parted, 0)


def _straightened(direction: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
    """An axis of the root link, where the direction is that but for rounding."""
    nearest = np.round(direction)
    return nearest if np.linalg.norm(direction - nearest) < 0.05 else direction


def _without_fingers(model: pin.Model, arm: Sequence[int]) -> tuple[int, ...]:
    """The arm up to the joint behind which it parts into fingers."""
    children = _children(model)
    kept: list[int] = []
    for joint in arm:
        kept.append(joint)
        if len(children[joint]) > 1 and len(kept) >= _FEWEST:
            break
    return tuple(kept)


def _beyond(model: pin.Model, joint: int) -> list[int]:
    return [j for j in _subtree(model, joint) if j != joint]


_UNEQUAL = 0.03
"""Left and right links may differ by this part of their mass before it is said."""

_ASKEW = 0.01
"""And the sizes of their joints' offsets by this much [m]."""


def _asymmetries(model: pin.Model, left: Sequence[int], right: Sequence[int]) -> list[str]:
    said: list[str] = []
    for a, b in zip(left, right, strict=True):
        one, other = float(model.inertias[a].mass), float(model.inertias[b].mass)
        if abs(one - other) > _UNEQUAL * max(one, other, 0.1):
            said.append(
                f"behind {model.names[a]} are {one:.2f} kg, behind {model.names[b]} {other:.2f} kg"
            )
        lengths = [float(np.linalg.norm(model.jointPlacements[j].translation)) for j in (a, b)]
        if abs(lengths[0] - lengths[1]) > _ASKEW:
            said.append(
                f"{model.names[a]} is {1e3 * lengths[0]:.0f} mm from the joint before it, "
                f"{model.names[b]} {1e3 * lengths[1]:.0f} mm"
            )
    return said
