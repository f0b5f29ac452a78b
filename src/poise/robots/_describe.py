"""`describe`: a description proposed for a URDF or MJCF that nobody has described yet."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._yaml import read_text
from poise.errors import RobotError
from poise.robots._base import followers_of, settle_base
from poise.robots._document import Document, mend_inertias, parse, write_limits
from poise.robots._geometry import link_shapes
from poise.robots._kinematics import build_model, hinges
from poise.robots._limbs import Limbs, find_limbs
from poise.robots._limits import tighten_torques
from poise.robots._meshes import asset_folders, drop_missing_meshes
from poise.robots._mjcf_facts import MjcfFacts, read_facts
from poise.robots._proposal import Draft, Proposal, mount_on
from poise.robots._proposed_feet import FeetFinder, Foot, body_frames, main_frame, part_legs
from poise.robots._proposed_limits import (
    find_endless,
    find_stuck,
    propose_armature,
    propose_limits,
    propose_positions,
)
from poise.robots._robot import ModelSource
from poise.robots._stance import Stance, find_stance

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

_FOREARM = 0.25
"""What the last joint of an arm moves is a forearm where it reaches this far, else a hand [m]."""


def describe(path: str | Path) -> Proposal:
    """Propose a description for a URDF or MJCF file, each guess with its reason.

    Feet are the two mirrored chains of joints that reach lowest; soles the largest rectangles on
    the flat lower faces of their collision or visual shapes; hands and torso follow from the other
    mirrored pair; the home posture puts the soles level and the COM over them, knees a little
    bent. What the file lacks, limits and rotor inertias, is estimated.

    Args:
        path: the model file.

    Returns:
        The proposal; `Proposal.text` is the file to save as `<stem>.poise.yaml` beside the model.

    Raises:
        RobotError: the file cannot be read, or no feet with flat faces are found.
    """
    path = Path(path)
    return _Describer(path).proposal()


class _Describer:
    """One file on its way to a proposal."""

    def __init__(self, path: Path) -> None:
        self._path, self._where = path, path.name
        self._draft = Draft()
        document = self._read()
        self._links, self._joints = document.links(), document.joints()
        directory, packages = asset_folders(document, path)
        self._mjcf = read_facts(document, directory) if document.kind == "mjcf" else None
        self._says_fixed = _says_fixed(document, self._mjcf)
        settle_base(document, "floating")
        self._locked = find_stuck(document)
        if self._locked:
            stuck = ", ".join(self._locked)
            self._draft.remarks.append(f"limits of these joints leave no room: {stuck}")
        mended = mend_inertias(document)
        if mended:
            self._draft.remarks.append(
                f"inertias that no body has, made possible: {', '.join(mended)}"
            )
        followers = followers_of(document, self._mjcf)
        endless = find_endless(document)
        if document.kind == "urdf":
            write_limits(document, endless, {}, {})
        source = ModelSource(
            kind=document.kind,
            text=document.text,
            directory=directory,
            package_dirs=packages,
            locked_joints=tuple(dict.fromkeys([*followers, *self._locked])),
        )
        missing = drop_missing_meshes(document.root, source, self._where)
        self._lost_meshes = missing
        self._source = ModelSource(
            kind=source.kind,
            text=document.text,
            directory=directory,
            package_dirs=packages,
            locked_joints=source.locked_joints,
        )
        self._model = build_model(self._source, floating=True, armature={}, where=self._where)
        if not sum(float(inertia.mass) for inertia in self._model.inertias) > 0.0:
            raise RobotError(
                f"{self._where} has no mass",
                got="no link with one",
                wanted="an <inertial> with a positive mass in its links",
            )
        if self._mjcf is not None:
            tighten_torques(self._model, self._mjcf.torque)
        propose_positions(self._draft, self._model, endless, self._source.locked_joints)
        self._upright = self._mjcf.upright if self._mjcf is not None else np.eye(3)

    def proposal(self) -> Proposal:
        """The whole description."""
        try:
            limbs = self._find_limbs()
        except RobotError:
            if not self._says_fixed:
                raise
            self._fixed()
        else:
            self._floating(limbs)
        return self._draft.finish(self._where, self._links, self._joints)

    def _find_limbs(self) -> Limbs:
        """The limbs, with z of the root link up or, where that gives no legs, its y."""
        try:
            return find_limbs(self._model, self._upright, self._where)
        except RobotError:
            y_up = _Y_UP @ self._upright
            try:
                limbs = find_limbs(self._model, y_up, self._where)
            except RobotError:
                limbs = None
            if limbs is None:
                raise
        self._upright = y_up
        self._draft.remarks.append("y of the root link points up")
        return limbs

    def _read(self) -> Document:
        return parse(read_text(self._path, error=RobotError), self._where, self._path.parent)

    def _fixed(self) -> None:
        self._draft.facts = {"base": "fixed", **self._draft.facts}
        self._draft.reasons["base"] = "the root is fixed in the file, and no legs were found"
        propose_limits(self._draft, self._model, (), floating=True)
        propose_armature(self._draft, self._model, pin.neutral(self._model))
        self._lock(())

    def _floating(self, limbs: Limbs) -> None:
        limits = self._draft.facts.pop("limits", None)
        self._draft.say("base", "floating", "two legs were found")
        if self._says_fixed:
            self._draft.remarks.append("the file fixes the root, but the robot has legs")
        self._draft.remarks += [f"left and right differ: {a}" for a in limbs.asymmetries]
        world_T_base = pin.SE3(self._upright, np.zeros(3))
        q = pin.neutral(self._model)
        q[:7] = pin.SE3ToXYZQUAT(world_T_base)
        data = self._model.createData()
        pin.framesForwardKinematics(self._model, data, q)
        finder = FeetFinder(
            self._model, self._source, self._where, self._lost_meshes, data, limbs.forward
        )
        feet = [finder.find(leg) for leg in limbs.legs]
        soles = self._soles(feet, data)
        legs, beyond = part_legs(limbs.legs, feet)
        apart = abs(float((feet[0].fit.position - feet[1].fit.position) @ _left(limbs.forward)))
        tall = float(data.oMi[limbs.legs[0][0]].translation[2] - feet[0].fit.position[2])
        apart = max(min(apart, _WIDEST * tall), 1.15 * max(foot.fit.width for foot in feet))
        back = finder.ankle_relief(feet, legs)
        stance = find_stance(
            self._model,
            soles,
            legs,
            self._upright,
            limbs.forward,
            apart,
            self._start(),
            ahead=-back,
        )
        self._trunk(limbs, stance.q)
        self._hands(limbs)
        self._home(stance, back)
        if limits is not None:
            self._draft.facts["limits"] = limits
        propose_limits(self._draft, self._model, soles, floating=True)
        propose_armature(self._draft, self._model, stance.q)
        self._lock([*limbs.fingers, *beyond])

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
        poses = self._mjcf.poses if self._mjcf is not None else {}
        for wanted in ("home", "stand", "knees"):
            for name, pose in poses.items():
                if wanted in name.lower():
                    return pose
        return {}

    def _trunk(self, limbs: Limbs, q: Float64[np.ndarray, " nq"]) -> None:
        data = self._model.createData()
        pin.framesForwardKinematics(self._model, data, q)
        for key, joint, reason in (
            ("pelvis", 1, "the root link"),
            ("torso", limbs.trunk, "the link that carries both arms"),
        ):
            index = main_frame(self._model, joint)
            placement, said = data.oMf[index], reason
            if key == "torso" and not limbs.arms:
                said = "no arms were found: the root link"
            middle = 0.5 * sum((data.oMi[leg[0]].translation for leg in limbs.legs), np.zeros(3))
            origin = np.zeros(3)
            if key == "pelvis" and np.linalg.norm(middle - placement.translation) > _FAR_ROOT:
                origin, said = placement.actInv(middle), f"{reason}, between the hips"
            place = pin.SE3(placement.rotation.T, origin)
            self._draft.say(key, mount_on(self._model.frames[index].name, place), said)

    def _hands(self, limbs: Limbs) -> None:
        for side, arm in zip(SIDES, limbs.arms, strict=False):
            index = main_frame(self._model, arm[-1])
            frame = self._model.frames[index]
            point, reason = self._hand_point(arm[-1])
            self._draft.say(
                f"hands.{side}_hand",
                mount_on(frame.name, pin.SE3(np.eye(3), frame.placement.actInv(point))),
                reason,
            )

    def _hand_point(self, joint: int) -> tuple[Float64[np.ndarray, "3"], str]:
        """Where a hand is, in the axes of the joint that carries it [m]."""
        com = np.array(self._model.inertias[joint].lever)
        frames = body_frames(self._model, joint)
        names = [self._model.frames[i].name for i in frames]
        shapes = link_shapes(self._source, names, self._where)
        parts = [
            balls.moved(self._model.frames[i].placement).centres
            for i, name in zip(frames, names, strict=True)
            for balls in (*shapes[name].visual, *shapes[name].collision)
        ]
        size = float(np.linalg.norm(com))
        if parts and size > 1e-3:
            along = com / size
            end = float(max((points @ along).max() for points in parts))
            if end > _FOREARM:
                return 0.9 * end * along, "near the end of a forearm without a hand of its own"
        return com, "end of the arm, at the COM of what its last joint moves"

    def _home(self, stance: Stance, back: float) -> None:
        angles: dict[str, float] = {}
        for name, joint in hinges(self._model):
            angle = round(float(stance.q[joint.idx_q]), 4) + 0.0
            if angle:
                angles[name] = angle
        self._draft.facts["home"] = angles
        if stance.reached:
            reason = (
                "by inverse kinematics: soles level, COM over their middle, knees a little bent"
            )
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
        for values in self._draft.facts.get("limits", {}).values():
            for name in locked:
                values.pop(name, None)


def _left(forward: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
    return np.cross([0.0, 0.0, 1.0], forward)


def _says_fixed(document: Document, mjcf: MjcfFacts | None) -> bool:
    """Whether a file hangs its root on the world."""
    if mjcf is not None:
        return not mjcf.free
    parents = {p.get("link") for p in document.root.iter("parent")}
    children = {c.get("link") for c in document.root.iter("child")}
    return "world" in parents - children


def _floor(size: float) -> float:
    """A size in whole millimetres, never larger [m]."""
    return math.floor(1e3 * size + 1e-6) / 1e3
