"""`describe`: a description proposed for a URDF or MJCF that nobody has described yet."""

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError
from poise.robots._assembly import assemble
from poise.robots._document import JointLimits
from poise.robots._inputs import RobotInput, open_document
from poise.robots._kinematics import hinges
from poise.robots._limbs import Arms, Limbs, Pair, find_arms, find_limbs, no_feet
from poise.robots._proposal import Draft, Proposal, mount_on
from poise.robots._proposed_arms import Hand, bend_arms, find_hand
from poise.robots._proposed_feet import FeetFinder, Foot, main_frame, part_legs
from poise.robots._proposed_limits import propose_armature, propose_limits, propose_positions
from poise.robots._stance import Stance, find_stance
from poise.robots._unit_remarks import remark_on_angles, remark_on_weight

SIDES = ("left", "right")

_SAME_SOLE = 0.015
"""Soles whose sizes differ by less are given the smaller size both [m]."""

_Y_UP = pin.utils.rotate("x", 0.5 * math.pi)
"""Turns a link whose y points up."""

_WIDEST = 0.45
"""Feet stand no wider apart than this part of a straight leg's length: who walks with feet wider
apart has to sway faster than ankles brake."""

_FAR_ROOT = 0.5
"""A root link whose origin is this far from the hips is no pelvis: some stand on the ground [m]."""

_BACKWARDS = 0.9
"""Cosine of the angle to -x of a robot that faces that way."""

_MARGIN = 0.02
"""Distance that a home posture keeps from position limits [rad]."""


def describe(model: RobotInput, geometry: pin.GeometryModel | None = None) -> Proposal:
    """Propose a description for a robot's model, each guess with its reason.

    Feet are the two mirrored chains of joints that reach lowest; soles the largest rectangles on
    the flat lower faces of their collision or visual shapes; hands and torso follow from the other
    mirrored pair; the home posture puts the soles level and the COM over them, knees and elbows a
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
    return _Describer(model, geometry).proposal()


class _Describer:
    """One file on its way to a proposal."""

    def __init__(self, given: RobotInput, geometry: pin.GeometryModel | None) -> None:
        document = open_document(given, geometry)
        self._where, self._draft = document.where, Draft()
        self._links, self._joints = document.links(), document.joints()
        self._facts = document.facts
        self._says_fixed, self._upright = self._facts.fixed, self._facts.upright
        self._locked = document.stuck()
        if self._locked:
            stuck = ", ".join(self._locked)
            self._draft.remarks.append(f"limits of these joints leave no room: {stuck}")
        endless = dict.fromkeys(document.endless(), (-math.pi, math.pi))
        assembly = assemble(
            document,
            "floating",
            JointLimits(position=endless),
            locked=self._locked,
        )
        self._model, self._source = assembly.model, assembly.source
        self._grips, self._lost_meshes = assembly.grips, assembly.lost_meshes
        self._draft.remarks += [*assembly.remarks, *assembly.clipped]
        self._poses = assembly.poses
        if not sum(float(inertia.mass) for inertia in self._model.inertias) > 0.0:
            raise RobotError(
                f"{self._where} has no mass",
                got="no link with one",
                wanted="an <inertial> with a positive mass in its links",
            )
        self._draft.remarks += remark_on_angles(self._model)
        propose_positions(self._draft, self._model, endless, self._source.locked_joints)

    def proposal(self) -> Proposal:
        """The whole description."""
        limbs = self._find_limbs()
        if limbs is not None:
            self._floating(limbs)
        else:
            arms = find_arms(self._model, self._upright, self._grips)
            if not (self._says_fixed or arms.chains):
                raise no_feet(self._model, self._where)
            self._fixed(arms)
        return self._draft.finish(self._where, self._links, self._joints)

    def _find_limbs(self) -> Limbs | None:
        """The limbs, with z of the root link up or, where that gives no legs, its y."""
        limbs = find_limbs(self._model, self._upright, self._grips, self._where)
        if limbs is None:
            y_up = _Y_UP @ self._upright
            limbs = find_limbs(self._model, y_up, self._grips, self._where)
            if limbs is not None:
                self._upright = y_up
                self._draft.remarks.append("y of the root link points up")
        return limbs

    def _fixed(self, arms: Arms) -> None:
        limits = self._draft.facts.pop("limits", None)
        reason = "the root is fixed in the file, and no legs were found"
        if not self._says_fixed:
            reason = "no legs were found"
            self._draft.remarks.append(
                "the file does not fix the root, which is taken as fixed: a base that drives or "
                "flies is not controlled"
            )
        self._draft.say("base", "fixed", reason)
        self._draft.remarks += [f"left and right differ: {a}" for a in arms.asymmetries]
        self._remark_on_facing(arms)
        q, start = self._neutral(), self._start()
        for name, joint in hinges(self._model):
            k = joint.idx_q
            low, high = self._model.lowerPositionLimit[k], self._model.upperPositionLimit[k]
            room = min(_MARGIN, 0.5 * float(high - low))
            q[k] = min(max(start.get(name, 0.0), low + room), high - room)
        hands = self._find_hands(arms)
        if not start:
            for name, angle in bend_arms(self._model, q, arms, hands).items():
                q[self._model.joints[self._model.getJointId(name)].idx_q] = angle
        self._trunk(arms, q, None)
        self._hands(hands)
        self._home(q)
        said = "that of a keyframe" if start else "zero, arms bent where they were straight"
        self._draft.reasons["home"] = f"{said}, inside the limits [rad]"
        if limits is not None:
            self._draft.facts["limits"] = limits
        propose_limits(self._draft, self._model, ())
        propose_armature(self._draft, self._model, q)
        self._lock(arms.fingers)

    def _remark_on_facing(self, arms: Arms) -> None:
        """Few robots face backwards; exchanged names are a mistake that looks the same."""
        if float(arms.forward @ self._upright[:, 0]) < -_BACKWARDS:
            self._draft.remarks.append(
                "the robot is taken to face along -x of its root link, as the limbs that are left "
                "by the names of their joints are on the right of +x"
            )

    def _neutral(self) -> Float64[np.ndarray, " nq"]:
        """The robot upright with all joints at zero."""
        q = pin.neutral(self._model)
        q[:7] = pin.SE3ToXYZQUAT(pin.SE3(self._upright, np.zeros(3)))
        return q

    def _floating(self, limbs: Limbs) -> None:
        limits = self._draft.facts.pop("limits", None)
        self._draft.say("base", "floating", "two legs were found")
        if self._says_fixed:
            self._draft.remarks.append("the file fixes the root, but the robot has legs")
        self._draft.remarks += [
            f"left and right differ: {a}" for a in (*limbs.asymmetries, *limbs.arms.asymmetries)
        ]
        self._remark_on_facing(limbs.arms)
        q = self._neutral()
        data = self._model.createData()
        pin.framesForwardKinematics(self._model, data, q)
        finder = FeetFinder(
            self._model, self._source, self._where, self._lost_meshes, data, limbs.arms.forward
        )
        feet = [finder.find(leg) for leg in limbs.legs]
        soles = self._soles(feet, data)
        legs, beyond = part_legs(limbs.legs, feet)
        apart = abs(
            float((feet[0].fit.position - feet[1].fit.position) @ _left(limbs.arms.forward))
        )
        tall = float(data.oMi[limbs.legs[0][0]].translation[2] - feet[0].fit.position[2])
        self._draft.remarks += remark_on_weight(
            self._model, [j for leg in limbs.legs for j in leg], tall
        )
        apart = max(min(apart, _WIDEST * tall), 1.15 * max(foot.fit.width for foot in feet))
        back = finder.ankle_relief(feet, legs)
        hands = self._find_hands(limbs.arms)
        start = self._start()
        bent = {} if start else bend_arms(self._model, q, limbs.arms, hands)
        stance = find_stance(
            self._model,
            soles,
            legs,
            self._upright,
            limbs.arms.forward,
            apart,
            start or bent,
            ahead=-back,
        )
        self._trunk(limbs.arms, stance.q, limbs.legs)
        self._hands(hands)
        self._home(stance.q)
        self._explain(stance, back, elbows=bool(bent))
        if limits is not None:
            self._draft.facts["limits"] = limits
        propose_limits(self._draft, self._model, soles)
        propose_armature(self._draft, self._model, stance.q)
        self._lock([*limbs.arms.fingers, *beyond])

    def _soles(self, feet: Sequence[Foot], data: pin.Data) -> list[int]:
        """Enter the soles, and put their frames into the model."""
        sizes = np.array([[f.fit.length, f.fit.width] for f in feet])
        if np.abs(sizes[0] - sizes[1]).max() < _SAME_SOLE:
            sizes[:] = sizes.min(axis=0)
        else:
            said = " and ".join(f"{1e3 * a:.0f} x {1e3 * b:.0f} mm" for a, b in sizes)
            self._draft.remarks.append(f"left and right differ: soles of {said}")
        frames: list[int] = []
        for side, foot, (length, width) in zip(SIDES, feet, sizes, strict=True):
            fit, model = foot.fit, self._model
            index = main_frame(model, foot.joint)
            place = data.oMf[index].actInv(pin.SE3(fit.rotation, fit.position))
            name = f"{side}_sole"
            mount = mount_on(model.frames[index].name, place)
            self._draft.say(
                f"soles.{name}",
                {**mount, "length": _floor(length), "width": _floor(width)},
                f"the largest rectangle on the flat lower face of its {foot.kind} geometry "
                f"({fit.points} points within 3 mm)",
            )
            self._draft.outlines[name] = fit.outline
            frame = model.frames[index]
            local = frame.placement * place
            frames.append(
                int(
                    model.addFrame(
                        pin.Frame(
                            f"{name} proposed", foot.joint, index, local, pin.FrameType.OP_FRAME
                        ),
                        False,
                    )
                )
            )
        return frames

    def _start(self) -> dict[str, float]:
        """Joint positions to begin with: a keyframe for standing, where there is one."""
        poses = self._poses
        for wanted in ("home", "stand", "knees"):
            for name, pose in poses.items():
                if wanted in name.lower():
                    return pose
        return {}

    def _trunk(self, arms: Arms, q: Float64[np.ndarray, " nq"], legs: Pair | None) -> None:
        data = self._model.createData()
        pin.framesForwardKinematics(self._model, data, q)
        carries = "the link that carries both arms" if len(arms.chains) == 2 else "the root link"
        for key, joint, reason in (
            ("pelvis", 1, "the root link"),
            ("torso", arms.trunk, carries),
        ):
            index = main_frame(self._model, joint)
            placement, said = data.oMf[index], reason
            if key == "torso" and not arms.chains:
                said = "no arms were found: the root link"
            origin = np.zeros(3)
            if key == "pelvis" and legs is not None:
                middle = 0.5 * sum((data.oMi[leg[0]].translation for leg in legs), np.zeros(3))
                if np.linalg.norm(middle - placement.translation) > _FAR_ROOT:
                    origin, said = placement.actInv(middle), f"{reason}, between the hips"
            place = pin.SE3(placement.rotation.T, origin)
            self._draft.say(key, mount_on(self._model.frames[index].name, place), said)

    def _find_hands(self, arms: Arms) -> list[Hand]:
        return [find_hand(self._model, self._source, c[-1], self._where) for c in arms.chains]

    def _hands(self, hands: Sequence[Hand]) -> None:
        names = [f"{side}_hand" for side in SIDES] if len(hands) == 2 else ["hand"]
        for name, hand in zip(names, hands, strict=False):
            frame = self._model.frames[main_frame(self._model, hand.joint)]
            place = pin.SE3(np.eye(3), frame.placement.actInv(hand.point))
            self._draft.say(f"hands.{name}", mount_on(frame.name, place), hand.reason)

    def _home(self, q: Float64[np.ndarray, " nq"]) -> None:
        self._draft.facts["home"] = {
            name: angle
            for name, joint in hinges(self._model)
            if (angle := round(float(q[joint.idx_q]), 4) + 0.0)
        }

    def _explain(self, stance: Stance, back: float, *, elbows: bool) -> None:
        """Says how a standing posture was found."""
        if stance.reached:
            reason = (
                "by inverse kinematics: soles level, COM over their middle, knees a little bent"
            )
            reason += ", and elbows" if elbows else ""
        else:
            reason = f"NOT a standing posture: off by {stance.error:.3f} m or rad at best"
            self._draft.remarks.append(
                f"no posture with level soles and the COM over them was found (off by "
                f"{stance.error:.3f} m or rad; at their limits: "
                f"{', '.join(stance.at_limit) or 'none'})"
            )
        if back > 1e-3:
            reason += f"; the COM {1e3 * back:.0f} mm back, as the ankles are weak"
        if stance.tilt > 0.01:
            reason += f"; the root leans by {stance.tilt:.2f} rad"
        if stance.yaw > 0.01:
            reason += f"; toes point {stance.yaw:.2f} rad off ahead"
        self._draft.reasons["home"] = reason + " [rad]"

    def _lock(self, fingers: Sequence[int]) -> None:
        locked = [*self._locked, *(self._model.names[j] for j in fingers)]
        if not locked:
            return
        self._draft.facts["locked"] = locked
        self._draft.reasons["locked"] = "fingers, toes, and joints whose limits leave no room"
        for key in ("home", "armature"):
            for name in locked:
                self._draft.facts.get(key, {}).pop(name, None)
        limits = self._draft.facts.get("limits", {})
        for kind, values in list(limits.items()):
            for name in locked:
                values.pop(name, None)
            if not values:
                del limits[kind]
        if not limits:
            self._draft.facts.pop("limits", None)


def _left(forward: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
    return np.cross([0.0, 0.0, 1.0], forward)


def _floor(size: float) -> float:
    """A size in whole millimetres, never larger [m]."""
    return math.floor(1e3 * size + 1e-6) / 1e3
