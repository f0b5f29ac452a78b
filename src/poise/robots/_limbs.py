"""Which joints of a stranger are legs and arms, from its tree alone: `find_limbs`, `find_arms`."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError
from poise.robots._asymmetries import asymmetries

_FEWEST = 3
"""A leg or an arm has at least so many joints."""

_HAND_PART = 0.1
"""What a chain parts into is a hand or toes below this part of the robot's mass; arms are more."""

_MIRRORED = 0.08
"""Ends of a left and a right limb are mirror images within this part of the robot's height."""


_DOWN = 0.15
"""Legs reach down by this part of the robot's height, or more."""

_LEVEL = 0.05
"""What carries legs, such as a waist, begins no further below them than this part of the height."""

_AHEAD = np.array([1.0, 0.0, 0.0])
"""Where a robot faces whose names do not say."""

Chain = tuple[int, ...]
Pair = tuple[Chain, Chain]


@dataclass(frozen=True)
class Arms:
    """Joints of a robot's arms by index.

    Attributes:
        chains: left and right, or one, or none; from the trunk outwards, the last carries the hand.
        trunk: the joint that carries them.
        fingers: joints beyond the hands.
        forward: horizontal direction of the robot at zero, in the root link's axes turned upright.
        asymmetries: where left and right are not mirror images, as sentences.
    """

    chains: tuple[Chain, ...]
    trunk: int
    fingers: Chain
    forward: Float64[np.ndarray, "3"]
    asymmetries: tuple[str, ...]


@dataclass(frozen=True)
class Limbs:
    """Joints of a biped's limbs by index, each limb from the trunk outwards; left first.

    Attributes:
        legs: two legs.
        arms: two arms, or none.
        asymmetries: where left and right are not mirror images, as sentences.
    """

    legs: Pair
    arms: Arms
    asymmetries: tuple[str, ...]


def find_limbs(
    model: pin.Model, upright: Float64[np.ndarray, "3 3"], grips: Collection[str], where: str
) -> Limbs | None:
    """Find the limbs: the two mirrored chains that reach lowest are legs, the next pair arms.

    Args:
        model: the model with a free base as its first joint.
        upright: world_R_base, as the document puts the robot.
        grips: joints that drive others, as those of grippers do.
        where: the file, for messages.

    Returns:
        The limbs; None without two mirrored chains of three joints or more that reach down.

    Raises:
        RobotError: there are four legs or more.
    """
    tree = _Tree(model, upright)
    hanging = [pair for pair in tree.pairs if tree.hangs(pair)]
    if not hanging:
        return None
    legs = tree.left_first(min(hanging, key=tree.reach))
    others = [p for p in tree.pairs if not {*p[0], *p[1]} & {*legs[0], *legs[1]}]
    low = [
        p for p in others if p in hanging and tree.reach(p) < tree.reach(legs) + tree.part(_DOWN)
    ]
    if low:
        feet = [model.names[chain[-1]] for pair in (legs, *low) for chain in pair]
        raise RobotError(
            f"{where} has more than two legs",
            got=f"chains of joints that end in {', '.join(feet)}",
            wanted="two; or a description that says what it stands on "
            "(poise.robots.description_template gives one to fill in)",
        )
    arms = tree.arms(others, grips, tree.forward(legs))
    crossed = tree.crossed(legs, arms)
    return Limbs(legs=legs, arms=arms, asymmetries=(*asymmetries(model, upright, *legs), *crossed))


def find_arms(
    model: pin.Model, upright: Float64[np.ndarray, "3 3"], grips: Collection[str]
) -> Arms:
    """Find the arms of a robot without legs: two mirrored chains, or the only one.

    Args:
        model: the model with a free base as its first joint.
        upright: world_R_base, as the document puts the robot.
        grips: joints that drive others, as those of grippers do.
    """
    tree = _Tree(model, upright)
    forward = _AHEAD
    if tree.pairs:
        forward = tree.forward(tree.left_first(_longest(tree.pairs)))
    return tree.arms(tree.pairs, grips, forward)


def no_feet(model: pin.Model, where: str) -> RobotError:
    """What is said of a robot that is neither a biped nor has arms.

    Args:
        model: with a free base as its first joint.
        where: the file, for messages.
    """
    return RobotError(
        f"no feet are found in {where}",
        got=f"{len(_branches(model))} chains of joints, none of them a mirrored pair of legs",
        wanted="two chains of at least three joints that reach down from the root; or a "
        "description, which for a robot that stands on a fixed base is the line `base: fixed` "
        "(poise.robots.description_template gives one to fill in)",
        choices=list(model.names)[2:],
    )


class _Tree:
    """A robot's chains of joints, and where they are at zero."""

    def __init__(self, model: pin.Model, upright: Float64[np.ndarray, "3 3"]) -> None:
        data = model.createData()
        pin.forwardKinematics(model, data, pin.neutral(model))
        self._model, self._upright = model, upright
        self._places = np.array([upright @ data.oMi[j].translation for j in range(model.njoints)])
        self._height = float(np.ptp(self._places[1:, 2])) if model.njoints > 2 else 0.0
        self.branches = _branches(model)
        self.pairs = _mirrored_pairs(
            self._places, self.branches, _MIRRORED * max(self._height, 0.1)
        )

    def part(self, share: float) -> float:
        """A share of the robot's height [m]."""
        return share * self._height

    def reach(self, pair: Pair) -> float:
        """How high a pair of chains ends [m]."""
        return float(self._places[pair[0][-1], 2])

    def hangs(self, pair: Pair) -> bool:
        """Whether chains reach down as legs do, from a trunk that does not come up to them."""
        hip = float(self._places[pair[0][0], 2])
        # Arms hang down, too, but from a torso that joints carry from below.
        trunk = [int(j) for j in self._model.supports[pair[0][0]] if 1 < j < pair[0][0]]
        carried = any(self._places[j, 2] < hip - self.part(_LEVEL) for j in trunk)
        # Where the root link begins on the ground, so do feet.
        low = float(self._places[1, 2]) + self.part(_DOWN)
        return self.reach(pair) <= min(hip - self.part(_DOWN), low) and not carried

    def left_first(self, pair: Pair, forward: Float64[np.ndarray, "3"] = _AHEAD) -> Pair:
        """By the names of the joints; where these do not say, as seen along `forward`."""
        left = np.cross([0.0, 0.0, 1.0], forward)
        return _left_first(self._model, pair, self._places @ left)

    def forward(self, pair: Pair) -> Float64[np.ndarray, "3"]:
        """The horizontal direction across from a left and a right chain."""
        across = self._places[pair[0][-1]] - self._places[pair[1][-1]]
        forward = np.cross(np.array([across[0], across[1], 0.0]), [0.0, 0.0, 1.0])
        return _straightened(forward / np.linalg.norm(forward))

    def arms(
        self, pairs: Sequence[Pair], grips: Collection[str], forward: Float64[np.ndarray, "3"]
    ) -> Arms:
        """The longest pair; a single chain where that is all there is."""
        model, chains = self._model, tuple(self.branches) if len(self.branches) == 1 else ()
        if pairs:
            chains = self.left_first(_longest(pairs), forward)
        hands = tuple(_without_fingers(model, chain, grips) for chain in chains)
        return Arms(
            chains=hands,
            trunk=int(model.parents[hands[0][0]]) if hands else 1,
            fingers=tuple(j for hand in hands for j in _beyond(model, hand[-1])),
            forward=forward,
            asymmetries=asymmetries(model, self._upright, *hands) if len(hands) == 2 else (),
        )

    def crossed(self, legs: Pair, arms: Arms) -> tuple[str, ...]:
        """Whether the arms' left is the legs' right, as a sentence."""
        if len(arms.chains) != 2:
            return ()
        left, right = arms.chains
        if float(self.forward((left, right)) @ self.forward(legs)) >= 0.0:
            return ()
        names = self._model.names
        return (
            f"the left arm ({names[left[0]]}, ...) is on the side of the right leg "
            f"({names[legs[1][0]]}, ...), the right one on that of the left leg",
        )


def _longest(pairs: Sequence[Pair]) -> Pair:
    return max(pairs, key=lambda pair: len(pair[0]))


def _branches(model: pin.Model) -> list[Chain]:
    """Chains from where left and right part to their deepest ends: one for each limb."""
    depth = {j: len(model.supports[j]) for j in range(model.njoints)}
    children = _children(model)
    chains: list[Chain] = []
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
    places: Float64[np.ndarray, "n 3"], branches: list[Chain], tolerance: float
) -> list[Pair]:
    """Chains of equal length whose joints mirror each other across a vertical plane."""
    pairs: list[Pair] = []
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


def _left_first(model: pin.Model, pair: Pair, lefts: Float64[np.ndarray, " n"]) -> Pair:
    """By the names of the joints; where these do not say, by how far left each joint is."""
    one, other = pair
    names = ((model.names[a], model.names[b]) for a, b in zip(one, other, strict=True))
    votes = float(sum(_side(*pair) for pair in names))
    if votes == 0.0:
        votes = float(lefts[one[0]] - lefts[other[0]])
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


def _without_fingers(model: pin.Model, arm: Chain, grips: Collection[str]) -> Chain:
    """The arm up to the joint behind which it parts into fingers, and without a gripper's."""
    children = _children(model)
    kept: list[int] = []
    for joint in arm:
        kept.append(joint)
        if len(children[joint]) > 1 and len(kept) >= _FEWEST:
            break
    while len(kept) > _FEWEST and model.names[kept[-1]] in grips:
        kept.pop()
    return tuple(kept)


def _beyond(model: pin.Model, joint: int) -> list[int]:
    return [j for j in _subtree(model, joint) if j != joint]
