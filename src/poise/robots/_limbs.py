"""Legs and arms of a model, found in its tree of joints, and straight arms bent."""

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import few
from poise.errors import RobotError

FEWEST = 3  # joints of a limb: fewer cannot place its end in space
_HAND_PART = 0.1  # of the mass, below which a branching is a hand: a person's arms are 0.1
_MIRRORED = 0.08  # of the height, tolerance of mirrored joints: a person's hips are 0.1 apart
_DOWN = 0.15  # of the height, that legs reach down by: 0.5 in a person, less in a folded leg
_LEVEL = 0.05  # of the height, by which a waist may begin below the legs that it carries
_BEND = 0.8  # [rad] by which an elbow is bent: an arm of equal halves keeps 0.92 of its length
_NEAR = 0.01  # [m] by which an elbow beside the line to the hand may stretch a straight arm
MARGIN = 0.02  # [rad] of proposed postures to position limits: encoders are off by less

# Joints of a limb from the trunk outwards; two limbs, left and right once the sides are known.
Chain = tuple[int, ...]
Pair = tuple[Chain, Chain]
Point = Float64[np.ndarray, "3"]
Posture = Float64[np.ndarray, " nq"]


@dataclass(frozen=True)
class Limbs:
    """Legs, one or two arms up to the hand, or none, and the horizontal direction forward."""

    legs: Pair | None
    arms: tuple[Chain, ...]
    trunk: int
    fingers: Chain
    forward: Point
    differences: tuple[str, ...]


def find_limbs(
    model: pin.Model, upright: Float64[np.ndarray, "3 3"], grips: Collection[str], where: str
) -> Limbs:
    """Legs are the two mirrored chains that reach lowest, arms the longest two others."""
    tree = _Tree(model, upright)
    hanging = [pair for pair in tree.pairs if tree.hangs(pair)]
    legs = tree.sided(min(hanging, key=tree.end), pin.XAxis) if hanging else None
    others = [p for p in tree.pairs if not {*p[0], *p[1]} & {j for leg in legs or () for j in leg}]
    low = min(map(tree.end, hanging), default=0.0) + _DOWN * tree.height
    if feet := [p for p in others if p in hanging and tree.end(p) < low]:
        ends = [model.names[chain[-1]] for pair in (legs or (), *feet) for chain in pair]
        got = f"chains of joints that end in {', '.join(ends)}"
        wanted = "two; or a description that says what it stands on (description_template)"
        raise RobotError(f"{where} has more than two legs", got=got, wanted=wanted)
    arms: tuple[Chain, ...] = tuple(tree.branches) if len(tree.branches) == 1 else ()
    forward = tree.forward(legs) if legs is not None else pin.XAxis
    if others:
        pair = max(others, key=lambda p: len(p[0]))
        forward = forward if legs is not None else tree.forward(tree.sided(pair, pin.XAxis))
        arms = tree.sided(pair, forward)
    arms = tuple(_without_fingers(model, arm, grips) for arm in arms)
    differences = [said for pair in (legs, arms) for said in tree.differences(pair or ())]
    if legs is not None and len(arms) == 2 and tree.forward(arms) @ forward < 0.0:
        differences.append(
            f"the left arm ({model.names[arms[0][0]]}, ...) is on the side of the right leg "
            f"({model.names[legs[1][0]]}, ...), the right one on that of the left leg"
        )
    trunk = int(model.parents[arms[0][0]]) if arms else 1
    fingers = tuple(j for arm in arms for j in list(model.subtrees[arm[-1]])[1:])
    return Limbs(legs, arms, trunk, fingers, forward, tuple(differences))


class _Tree:
    """Chains of joints, and where the joints are at zero, upright."""

    def __init__(self, model: pin.Model, upright: Float64[np.ndarray, "3 3"]) -> None:
        data = model.createData()
        pin.forwardKinematics(model, data, pin.neutral(model))
        self._model = model
        self._axes = [upright @ place.rotation for place in data.oMi]
        self._places = np.array([upright @ place.translation for place in data.oMi])
        self.height = float(np.ptp(self._places[1:, 2]))
        self.branches = _branches(model)
        pairs = [(a, b) for k, a in enumerate(self.branches) for b in self.branches[k + 1 :]]
        self.pairs = [pair for pair in pairs if self._mirrored(pair)]

    def _mirrored(self, pair: Pair) -> bool:
        if len(pair[0]) != len(pair[1]):
            return False
        a, b = (self._places[list(chain)] for chain in pair)
        tolerance = _MIRRORED * max(self.height, 0.1)
        # Shoulders may begin on the middle plane; hands and feet are off it.
        if np.linalg.norm((a[-1] - b[-1])[:2]) < 1e-3 or abs(a - b)[:, 2].max() > tolerance:
            return False
        middle = 0.5 * (a[-1] + b[-1])
        apart = middle + (a - middle) @ self._mirror(pair) - b
        return bool(np.linalg.norm(apart, axis=1).max() < 2.0 * tolerance)

    def _mirror(self, pair: Pair) -> Float64[np.ndarray, "3 3"]:
        """The reflection that takes the end of one limb to that of the other."""
        normal = (self._places[pair[0][-1]] - self._places[pair[1][-1]]) * [1.0, 1.0, 0.0]
        return np.eye(3) - 2.0 * np.outer(normal, normal) / (normal @ normal)

    def end(self, pair: Pair) -> float:
        """Height of the chains' ends [m]."""
        return float(self._places[pair[0][-1], 2])

    def hangs(self, pair: Pair) -> bool:
        """Legs reach down, from a trunk that does not come up to them as a torso does to arms."""
        hip = float(self._places[pair[0][0], 2])
        trunk = [int(j) for j in self._model.supports[pair[0][0]] if 1 < j < pair[0][0]]
        carried = any(self._places[j, 2] < hip - _LEVEL * self.height for j in trunk)
        # Where the root link begins on the ground, so do feet.
        down = _DOWN * self.height
        return not carried and self.end(pair) <= min(hip - down, float(self._places[1, 2]) + down)

    def sided(self, pair: Pair, forward: Point) -> Pair:
        """Return the left chain first, by the joints' names or else by their places."""
        names = self._model.names
        votes = float(sum(_side(names[a], names[b]) for a, b in zip(*pair, strict=True)))
        apart = self._places[pair[0][0]] - self._places[pair[1][0]]
        left, right = pair
        votes = votes or float(apart @ np.cross(pin.ZAxis, forward))
        return pair if votes > 0.0 else (right, left)

    def forward(self, pair: Pair) -> Point:
        """The horizontal direction across from a left and a right chain."""
        forward = np.cross(self._places[pair[0][-1]] - self._places[pair[1][-1]], pin.ZAxis)
        forward /= np.linalg.norm(forward)
        # An axis of the root link, where it is that but for rounding and unequal limbs.
        axis = np.round(forward)
        return axis if np.linalg.norm(forward - axis) < 0.05 else forward

    def differences(self, limbs: tuple[Chain, ...]) -> list[str]:
        """Differences of two limbs from mirror images of each other, as sentences."""
        if len(limbs) != 2:
            return []
        pair = limbs[0], limbs[1]
        found, model, mirror = defaultdict[str, list[str]](list), self._model, self._mirror(pair)
        for sides in zip(*pair, strict=True):
            links = [model.inertias[j] for j in sides]
            com = [self._axes[j] @ link.lever for j, link in zip(sides, links, strict=True)]
            mass = [float(link.mass) for link in links]
            inertia = [float(np.linalg.eigvalsh(link.inertia)[2]) for link in links]
            offset = [_norm(model.jointPlacements[j].translation) for j in sides]
            off = [_norm(mirror @ com[0] - com[1]), 0.0]
            # Cables, rounding, a battery on one side and other drawings of one part explain less.
            for what, (a, b), most, unit in (
                ("masses behind", mass, 0.03 * max(mass), "kg"),
                ("distances from the joint before of", offset, 0.03, "m"),
                ("centres of mass behind", off, 0.03, "m from mirrored"),
                ("largest principal inertias behind", inertia, 0.5 * max(inertia), "kg m^2"),
            ):
                if abs(a - b) > most:
                    values = f"{a:.3g}" if off == [a, b] else f"{a:.3g} and {b:.3g}"
                    found[what].append(f"{model.names[sides[0]]} ({values} {unit})")
        return [f"{what} {few(items)}" for what, items in found.items()]


def _side(name: str, other: str) -> int:
    """One where the first name is the left one: they part at an l against an r."""
    letters = zip(name.lower(), other.lower(), strict=False)
    parted = next(((a, b) for a, b in letters if a != b), ("", ""))
    return {("l", "r"): 1, ("r", "l"): -1}.get(parted, 0)


def _branches(model: pin.Model) -> list[Chain]:
    """Chains from where left and right part to their deepest ends: one for each limb."""
    chains: list[Chain] = []
    trunks = [1]
    for trunk in trunks:
        for child in model.children[trunk]:
            end = max(model.subtrees[child], key=lambda j: len(model.supports[j]))
            chain = tuple(int(j) for j in model.supports[end] if j >= child)
            # A waist or neck leads to further limbs, which start where it ends.
            if _parts(model, child):
                trunks.append(child)
            elif len(chain) >= FEWEST:
                chains.append(chain)
    return chains


def _parts(model: pin.Model, joint: int) -> bool:
    """A chain that parts into limbs, which are heavier than fingers."""
    while len(children := model.children[joint]) == 1:
        joint = children[0]
    beyond = sum(float(model.inertias[j].mass) for j in list(model.subtrees[joint])[1:])
    return len(children) > 1 and beyond >= _HAND_PART * pin.computeTotalMass(model)


def _without_fingers(model: pin.Model, arm: Chain, grips: Collection[str]) -> Chain:
    """The arm up to the joint behind which it parts into fingers, and without a gripper's."""
    parting = (k for k, j in enumerate(arm, 1) if k >= FEWEST and len(model.children[j]) > 1)
    kept = arm[: next(parting, len(arm))]
    while len(kept) > FEWEST and model.names[kept[-1]] in grips:
        kept = kept[:-1]
    return kept


class Swing(NamedTuple):
    """One joint of an arm turned by itself, and the hand's place then [m]."""

    joint: int
    q: Posture
    place: Point


def swings(
    model: pin.Model, q: Posture, arm: Sequence[int], hand: int, angle: float
) -> Iterator[Swing]:
    """Turn each joint of an arm by an angle [rad] both ways, as far as its limits let it."""
    data = model.createData()
    for joint in arm:
        k = model.joints[joint].idx_q
        low, high = model.lowerPositionLimit[k] + MARGIN, model.upperPositionLimit[k] - MARGIN
        for by in (angle, -angle):
            turned = q.copy()
            turned[k] = min(max(q[k] + by, min(low, q[k])), max(high, q[k]))
            pin.framesForwardKinematics(model, data, turned)
            yield Swing(joint, turned, data.oMf[hand].translation.copy())


def bent_arms(model: pin.Model, q: Posture, limbs: Limbs, hands: Sequence[int]) -> Posture:
    """The configuration with straight arms bent, whose hands could not move along them.

    The elbow is the joint nearest to the arm's middle: far from the shoulder, with a long lever on
    the hand. It turns the way that brings the hand forward and up, on the right as the mirror image
    of the left. An elbow that takes the hand away from the shoulder by turning is bent already.
    """
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    bent, wanted, across = q.copy(), None, np.cross(pin.ZAxis, limbs.forward)
    for arm, hand in zip(limbs.arms, hands, strict=True):
        start, shoulder = data.oMf[hand].translation, data.oMi[arm[0]].translation
        turns = list(swings(model, q, arm, hand, _BEND))
        moved = np.array([turn.place - start for turn in turns])
        room = np.array([np.abs(turn.q - q).max() > 0.5 * _BEND for turn in turns])
        upper = [_norm(data.oMi[turn.joint].translation - shoulder) for turn in turns]
        middle = np.minimum(upper, np.linalg.norm(moved, axis=1) / _BEND * room)
        # To a centimetre: of joints that share one place the one that points ahead.
        best = np.lexsort((moved @ (limbs.forward + pin.ZAxis), np.round(middle, 2)))[-1]
        if wanted is not None:
            best = np.argmin(np.linalg.norm(moved - wanted, axis=1))
        elbow = turns[int(best)]
        reach = max(_norm(t.place - shoulder) for t in turns if t.joint == elbow.joint)
        if reach > _norm(start - shoulder) + _NEAR:
            return q
        wanted = moved[best] - 2.0 * float(moved[best] @ across) * across
        bent[model.joints[elbow.joint].idx_q] = elbow.q[model.joints[elbow.joint].idx_q]
    return bent


def _norm(vector: Point) -> float:
    return float(np.linalg.norm(vector))
