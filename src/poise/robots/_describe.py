"""`describe`: a description proposed for a URDF or MJCF file that has none."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import few
from poise.errors import RobotError
from poise.robots._assembly import assemble, welded
from poise.robots._document import Document, JointLimits
from poise.robots._inputs import RobotInput, open_document
from poise.robots._limbs import MARGIN, Chain, Limbs, Pair, Posture, bent_arms, find_limbs
from poise.robots._limits import NO_LIMIT, apply_limits, assume_limits, hinges, joint_kind
from poise.robots._proposal import Proposal, joint_pattern
from poise.robots._robot import GRAVITY
from poise.robots._soles import Foot, body_frames, find_foot, shapes_of
from poise.robots._stance import find_stance
from poise.robots._urdf import crossed_limits

_SIDES = ("left", "right")

_FOREARM = 0.4  # of an arm: in a person the hand is 0.25 of it, forearm and hand are 0.6
_SAME_SOLE = 0.015  # [m] that left and right meshes of one sole differ by
_WATER = 1000.0  # [kg/m^3] of a cube as high as two legs, which is heavier than a robot
_ABSURD = 10.0  # of weight times size: what holds up ten such robots at arm's length
_FAR_TOO_WEAK = 0.01  # of weight times leg length: the legs of shipped humanoids have 0.15 to 0.5


def describe(model: RobotInput, geometry: pin.GeometryModel | None = None) -> Proposal:
    """Propose a description for a robot's model, each guess with its reason.

    Feet are the two mirrored chains of joints that reach lowest; soles the largest rectangles on
    the flat lower faces of their collision or visual shapes; hands and torso follow from the other
    mirrored pair; the home posture puts the soles level and the CoM over them, knees and elbows a
    little bent. A robot without legs that has one arm or two is fixed. What the file lacks, limits
    and rotor inertias, is estimated.

    Args:
        model: a path, XML text or any other model that `load_robot` takes.
        geometry: shapes of a `pin.Model`.

    Returns:
        The proposal; `Proposal.text` is the file to save as `<stem>.poise.yaml` beside the model.

    Raises:
        RobotError: the file cannot be read, it has more than two legs, or neither feet with flat
            faces nor arms are found.
    """
    return _Describer(open_document(model, geometry)).proposal()


class _Describer:
    """Description under construction."""

    def __init__(self, document: Document) -> None:
        self._name, self._where = document.name, document.where
        self._names = document.links(), document.joints()
        self._file, self._upright = document.facts, document.facts.upright
        endless = dict.fromkeys(document.endless(), (-NO_LIMIT, NO_LIMIT))
        assembly = assemble(document, "floating", JointLimits(position=endless))
        self._grips, self._poses = assembly.grips, assembly.poses
        self._remarks = [*assembly.remarks, *assembly.clipped]
        self._facts: dict[str, Any] = {}
        self._reasons: dict[str, str] = {}
        self._outlines: dict[str, Float64[np.ndarray, "k 2"]] = {}
        self._source, self._soles, model = assembly.source, list[int](), assembly.model
        lows, highs = model.lowerPositionLimit, model.upperPositionLimit
        ranges = {n: (float(lows[j.idx_q]), float(highs[j.idx_q])) for n, j in hinges(model)}
        if crossed := {name: ends for name, ends in ranges.items() if ends[0] > ends[1]}:
            raise crossed_limits(self._where, crossed)
        self._locked = [name for name, (low, high) in ranges.items() if low == high]
        stuck = f"limits of these joints leave no room: {', '.join(self._locked)}"
        if self._remark(self._locked, stuck):
            locked = (*self._source.locked_joints, *self._locked)
            self._source, model = (
                replace(self._source, locked_joints=locked),
                welded(model, self._locked),
            )
        if not pin.computeTotalMass(model) > 0.0:
            wanted = "an <inertial> with a positive mass in its links"
            raise RobotError(f"{self._where} has no mass", got="no link with one", wanted=wanted)
        self._model, self._data = model, model.createData()
        spans = {name: high - low for name, (low, high) in ranges.items()}
        self._endless = [name for name, _ in hinges(model) if not spans[name] < NO_LIMIT]
        self._ranges = ranges | dict.fromkeys(self._endless, (-math.pi, math.pi))
        apply_limits(model, JointLimits(position=self._ranges))

    def proposal(self) -> Proposal:
        """The whole description."""
        model, data = self._model, self._data
        limbs = self._limbs()
        self._locked += [model.names[j] for j in limbs.fingers]
        self._remark_on_limits()
        self._remarks += [f"left and right differ: {said}" for said in limbs.differences]
        backwards = "the robot is taken to face along -x of its root link, as the limbs that are "
        backwards += "left by the names of their joints are on the right of +x"
        self._remark(limbs.forward @ self._upright[:, 0] < 0.0, backwards)
        q = pin.neutral(model)
        q[:7] = pin.SE3ToXYZQUAT(pin.SE3(self._upright, np.zeros(3)))
        pin.framesForwardKinematics(model, data, q)
        words, poses = ("home", "stand", "knees"), self._poses
        start = next((poses[n] for word in words for n in poses if word in n.lower()), {})
        if limbs.legs is None:
            q = self._on_fixed_base(limbs, q, start)
        else:
            q = self._on_legs(limbs, limbs.legs, q, start)
        self._trunk(limbs, q)
        free = [(name, joint) for name, joint in hinges(model) if name not in self._locked]
        home = {name: round(float(q[joint.idx_q]), 4) + 0.0 for name, joint in free}
        self._facts["home"] = {joint_pattern(name): at for name, at in home.items() if at}
        self._limits(free, q)
        locked = [joint_pattern(name) for name in self._locked]
        self._say("locked", locked, "fingers, toes, and joints whose limits leave no room")
        said = self._facts, self._reasons, tuple(self._remarks), self._outlines
        return Proposal(self._name, *said, *self._names)

    def _say(self, key: str, value: object, reason: str) -> None:
        """Enter a fact that is not empty, or a part of one after a dot, with its reason."""
        if value:
            *above, last = key.split(".")
            place = self._facts.setdefault(above[0], {}) if above else self._facts
            place[last], self._reasons[key] = value, reason

    def _remark(self, there: object, remark: str) -> bool:
        """Remark on something that is there."""
        self._remarks += [remark] if there else []
        return bool(there)

    def _limbs(self) -> Limbs:
        """The limbs, with z of the root link up or, where that gives no legs, its y."""
        facts, where = self._file, self._where
        y_up = pin.utils.rotate("x", 0.5 * math.pi) @ self._upright
        limbs = find_limbs(self._model, self._upright, self._grips, where)
        turned = limbs if limbs.legs else find_limbs(self._model, y_up, self._grips, where)
        if turned.legs and not limbs.legs:
            self._upright = y_up
            self._remarks.append("y of the root link points up")
        elif not limbs.legs and (facts.free or not (limbs.arms or facts.fixed)):
            ends = [n for n in self._endless if not self._model.children[self._model.getJointId(n)]]
            wheels = f", and joints that turn without end, as wheels do: {few(ends)}"
            raise RobotError(
                f"no feet are found in {where}",
                got=f"{'a free' if facts.free else 'no fixed'} base{wheels if ends else ''}",
                wanted="two legs, chains of at least three joints that reach down from the root, or"
                " a description (description_template), for a fixed base the line `base: fixed`",
                choices=list(self._model.names)[2:],
            )
        return turned if turned.legs else limbs

    def _on_fixed_base(self, limbs: Limbs, q: Posture, start: Mapping[str, float]) -> Posture:
        """The home posture of a robot whose root is fixed."""
        also = "the root is fixed in the file, and " if self._file.fixed else ""
        self._say("base", "fixed", f"{also}no legs were found")
        loose = "the file does not fix the root, which is taken as fixed: a base that drives or "
        self._remark(not self._file.fixed, f"{loose}flies is not controlled")
        for name, joint in hinges(self._model):
            low, high = self._ranges[name]
            room = min(MARGIN, 0.5 * (high - low))
            q[joint.idx_q] = min(max(start.get(name, 0.0), low + room), high - room)
        hands = self._hands(limbs)
        said = "that of a keyframe" if start else "zero, arms bent where they were straight"
        self._reasons["home"] = f"{said}, inside the limits [rad]"
        return q if start else bent_arms(self._model, q, limbs, hands)

    def _on_legs(self, limbs: Limbs, legs: Pair, q: Posture, start: Mapping[str, float]) -> Posture:
        """The home posture of a robot that stands on its soles."""
        self._say("base", "floating", "two legs were found")
        self._remark(self._file.fixed, "the file fixes the root, but the robot has legs")
        model, data, where, forward = self._model, self._data, self._where, limbs.forward
        feet = [find_foot(model, data, self._source, leg, forward, where) for leg in legs]
        places = [foot.place.translation for foot in feet]
        self._remark_on_weight(legs, float(data.oMi[legs[0][0]].translation[2] - places[0][2]))
        self._feet(feet)
        to_soles = [leg[: leg.index(foot.joint) + 1] for leg, foot in zip(legs, feet, strict=True)]
        self._locked += [model.names[j] for leg in legs for j in leg if j not in sum(to_soles, ())]
        bent = bent_arms(model, q, limbs, self._hands(limbs))
        angles = ((name, float(bent[joint.idx_q])) for name, joint in hinges(model))
        elbows = {} if start else {name: angle for name, angle in angles if angle}
        apart = abs(float((places[0] - places[1]) @ np.cross([0.0, 0.0, 1.0], forward)))
        # Feet do not touch.
        apart = max(apart, 1.15 * max(float(foot.size[1]) for foot in feet))
        stance = find_stance(
            model, self._soles, to_soles, self._upright, forward, apart, start or elbows
        )
        reason = "by inverse kinematics: soles level, CoM over their middle, knees a little bent"
        reason += ", and elbows" if elbows else ""
        off = f"off by {stance.error:.3f} m or rad"
        ends = f"{off}; at their limits: {', '.join(stance.at_limit) or 'none'}"
        lacking = f"no posture with level soles and the CoM over them was found ({ends})"
        if self._remark(not stance.reached, lacking):
            reason = f"NOT a standing posture: {off} at best"
        reason += f"; the root leans by {stance.tilt:.2f} rad" if round(stance.tilt, 2) else ""
        reason += f"; toes point {stance.yaw:.2f} rad off ahead" if round(stance.yaw, 2) else ""
        self._reasons["home"] = f"{reason} [rad]"
        return stance.q

    def _feet(self, feet: Sequence[Foot]) -> None:
        """Enter the soles."""
        sizes = np.array([foot.size for foot in feet])
        if np.ptp(sizes, axis=0).max() < _SAME_SOLE:
            sizes[:] = sizes.min(axis=0)
        else:
            said = " and ".join(f"{1e3 * a:.0f} x {1e3 * b:.0f} mm" for a, b in sizes)
            self._remarks.append(f"left and right differ: soles of {said}")
        # Whole millimetres, never larger.
        sizes = np.floor(1e3 * sizes + 1e-6) / 1e3
        for side, foot, (length, width) in zip(_SIDES, feet, sizes.tolist(), strict=True):
            key, place = f"{side}_sole", self._data.oMi[foot.joint].actInv(foot.place)
            face = f"the largest rectangle on the flat lower face of its {foot.kind} geometry"
            why = f"{face} ({foot.points} points within 3 mm)"
            put = self._put(f"soles.{key}", foot.joint, place, why, length=length, width=width)
            self._soles.append(put)
            self._outlines[key] = foot.outline

    def _hands(self, limbs: Limbs) -> list[int]:
        """Enter the hands and return their frames."""
        names = [f"{side}_hand" for side in _SIDES] if len(limbs.arms) == 2 else ["hand"]
        return [self._hand(name, arm) for name, arm in zip(names, limbs.arms, strict=False)]

    def _hand(self, name: str, arm: Chain, grip: float = 0.9) -> int:
        """Add a hand, on the last link of an arm, or at that part of a forearm."""
        model, joint, reason = self._model, arm[-1], "at the CoM of what its last joint moves"
        point = np.array(model.inertias[joint].lever)
        along = point / max(float(np.linalg.norm(point)), 1e-9)
        shapes = shapes_of(model, self._source, joint, self._where).values()
        end = max((float((balls.centres @ along).max()) for balls in shapes), default=0.0)
        upper = sum(float(np.linalg.norm(model.jointPlacements[j].translation)) for j in arm[1:])
        if end > _FOREARM * (end + upper):
            point, reason = grip * end * along, "near the end of a forearm without a hand"
        place = pin.SE3(self._link(joint).placement.rotation, point)
        return self._put(f"hands.{name}", joint, place, f"end of the arm, {reason}")

    def _trunk(self, limbs: Limbs, q: Posture) -> None:
        """Enter pelvis and torso, upright at home."""
        data = self._model.createData()
        pin.framesForwardKinematics(self._model, data, q)
        arms = "the link that carries both arms" if len(limbs.arms) == 2 else "the root link"
        torso = arms if limbs.arms else "no arms were found: the root link"
        for key, joint, reason in (("pelvis", 1, "the root link"), ("torso", limbs.trunk, torso)):
            upright = pin.SE3(data.oMi[joint].rotation.T, self._link(joint).placement.translation)
            self._put(key, joint, upright, reason)

    def _link(self, joint: int) -> pin.Frame:
        """Return the heaviest of the links that a joint moves, the first where none has a mass."""
        links = [self._model.frames[i] for i in body_frames(self._model, joint)]
        return max(links, key=lambda link: link.inertia.mass)

    def _put(self, key: str, joint: int, place: pin.SE3, reason: str, **more: float) -> int:
        """Enter a place in a joint's frame as a fact, and put a frame there into the model."""
        link = self._link(joint)
        local = link.placement.actInv(place)
        numbers = {"position": local.translation, "rpy": pin.rpy.matrixToRpy(local.rotation)}
        rounded = {k: [round(float(x), 4) + 0.0 for x in v] for k, v in numbers.items()}
        mount = {"link": link.name, **{k: v for k, v in rounded.items() if any(v)}, **more}
        self._say(key, mount, reason)
        kind = pin.FrameType.OP_FRAME
        return int(self._model.addFrame(pin.Frame(f"proposed {key}", joint, 0, place, kind), False))

    def _limits(self, free: Sequence[tuple[str, pin.JointModel]], q: Posture) -> None:
        """Enter the limits and rotor inertias that the file lacks."""
        model, none = self._model, "as the file has none"
        before = {"velocity": model.velocityLimit.copy(), "torque": model.effortLimit.copy()}
        said = assume_limits(model, [model.frames[i].name for i in self._soles])
        after = {"velocity": model.velocityLimit, "torque": model.effortLimit}
        places = {joint_pattern(name): joint.idx_v for name, joint in free}
        endless = [joint_pattern(name) for name, _ in free if name in self._endless]
        reason = "assumed: one turn for joints that the file lets turn without end [rad]"
        self._say("limits.position", {name: [-3.1416, 3.1416] for name in endless}, reason)
        for kind, now in after.items():
            changed = {name: now[k] for name, k in places.items() if now[k] != before[kind][k]}
            reason = f"assumed, {none}: {''.join(w for w in said if w.startswith(kind))}"
            self._say(f"limits.{kind}", {n: float(f"{x:.3g}") for n, x in changed.items()}, reason)
        moved = pin.crba(model, model.createData(), q).diagonal()
        # Published rotors of G1 and T1 take 3 to 6 ms to the top speed of a motor alone. Behind a
        # light link they may have 0.01 kg m^2: torque limits may stand in for unknown ones.
        rotor = 0.004 * model.effortLimit / model.velocityLimit
        rotor = np.minimum(rotor, np.maximum(moved, 0.01))
        bare = {name: rotor[k] for name, k in places.items() if model.armature[k] <= 0.0}
        why = "4 ms times torque limit over speed limit, at most the inertia that the joint moves"
        reason = f"estimated, {none}: {why} [kg m^2]"
        self._say("armature", {name: float(f"{x:.2g}") for name, x in bare.items()}, reason)

    def _remark_on_limits(self) -> None:
        """Limits of hinges that make sense in degrees alone, and torques beyond any motor."""
        turning = [(n, j) for n, j in hinges(self._model) if joint_kind(j) == "revolute"]
        two_turns = 4.0 * math.pi
        odd = [
            f"{name} ({low:.4g} to {high:.4g})"
            for name, _ in turning
            for low, high in [self._ranges[name]]
            if two_turns < max(-low, high) <= math.degrees(two_turns)
        ]
        said = "limits beyond two turns, which look like degrees in place of radians"
        self._remark(odd, f"{said}: {few(odd)}")
        pin.forwardKinematics(self._model, self._data, pin.neutral(self._model))
        places = np.array([place.translation for place in self._data.oMi[1:]])
        weight = GRAVITY * pin.computeTotalMass(self._model)
        most = _ABSURD * weight * np.ptp(places, axis=0).max()
        torques = [(name, float(self._model.effortLimit[j.idx_v])) for name, j in turning]
        strong = [f"{name} ({t:.6g} N m)" for name, t in torques if most < t < NO_LIMIT]
        said = "torque limits that no motor of a robot of this weight has"
        self._remark(strong, f"{said}: {few(strong)}")

    def _remark_on_weight(self, legs: Pair, tall: float) -> None:
        """A mass that a robot of this size cannot have, or that its legs cannot carry."""
        model, mass = self._model, float(pin.computeTotalMass(self._model))
        joints = [model.joints[j] for leg in legs for j in leg]
        torques = [float(model.effortLimit[j.idx_v]) for j in joints if joint_kind(j) == "revolute"]
        least, most = min(torques, default=0.0), max(torques, default=0.0)
        size = f"legs of {tall:.3g} m"
        weak = least > 0.0 and most < min(NO_LIMIT, _FAR_TOO_WEAK * mass * GRAVITY * tall)
        grams = "are masses in grams, or lengths in another unit than metres?"
        heavy = f"{mass:.0f} kg on {size}, more than so much water: {grams}"
        if not self._remark(mass > _WATER * (2.0 * tall) ** 3, heavy):
            strongest = f"the strongest joint of the legs has {most:.3g} N m under {mass:.4g} kg"
            why = "far too little to stand: are torques or masses in other units?"
            self._remark(weak, f"{strongest} on {size}, {why}")
