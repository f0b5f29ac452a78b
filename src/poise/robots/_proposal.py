"""`describe`: a description proposed for a URDF or MJCF that nobody has described yet."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import yaml
from jaxtyping import Float64

from poise._yaml import read_text
from poise.errors import RobotError
from poise.robots._base import followers_of, settle_base
from poise.robots._document import Document, mend_inertias, parse, write_limits
from poise.robots._geometry import Balls, link_shapes, union
from poise.robots._kinematics import build_model, hinges
from poise.robots._limbs import Limbs, find_limbs
from poise.robots._limits import apply_limits, assume_limits
from poise.robots._meshes import asset_folders, drop_missing_meshes
from poise.robots._mjcf import MjcfFacts, read_facts
from poise.robots._robot import GRAVITY, ModelSource
from poise.robots._sole_fit import SoleFit, fit_sole
from poise.robots._stance import Stance, find_stance

SIDES = ("left", "right")

_RUN_UP = 0.004
"""A motor alone reaches its top speed within about this time [s]: published rotor inertias of G1
and T1 are 0.003 to 0.006 s times torque limit over speed limit."""

_LEAST_ROTOR = 0.02
"""No rotor is assumed smaller than this part of the inertia that its joint moves."""

_MOST_ROTOR = 0.01
"""None is assumed larger than that inertia, or than this where the joint moves less [kg m^2]."""

_SAME_SOLE = 0.015
"""Soles whose sizes differ by less are given the smaller size both [m]."""

_Y_UP = pin.utils.rotate("x", 0.5 * math.pi)
"""Turns a link whose y points up."""

_ANKLE_PART = 0.35
"""An ankle should need no more of its torque to stand, so that it has some left to balance with."""

_MOST_BACK = 0.25
"""But the COM stays within this part of the sole's length from its middle."""

_WIDEST = 0.45
"""Feet stand no wider apart than this part of a straight leg's length: who walks with feet wider
apart has to sway faster than ankles brake."""

_FAR_ROOT = 0.5
"""A root link whose origin is this far from the hips is no pelvis: some stand on the ground [m]."""

_FOREARM = 0.25
"""What the last joint of an arm moves is a forearm where it reaches this far, else a hand [m]."""

_MUCH_LARGER = 1.5
"""A visual shape is believed before contact geometry with so much less sole."""

_TOE = 0.02
"""A foot of two parts: the part behind the toes touches the ground within this height [m]."""


@dataclass(frozen=True)
class Proposal:
    """A description with the reason for each guess.

    Attributes:
        name: of the model file.
        facts: the description, as `load_robot(path, description)` takes it.
        reasons: why, by the path of a fact, such as "soles.left_sole".
        remarks: what is odd about the file, as sentences.
        outlines: the flat face of each sole in the sole's own x and y [m].
        links: names of the document's links.
        joints: names of its joints.
    """

    name: str
    facts: dict[str, Any] = field(repr=False)
    reasons: dict[str, str] = field(repr=False)
    remarks: tuple[str, ...]
    outlines: dict[str, Float64[np.ndarray, "k 2"]] = field(repr=False)
    links: tuple[str, ...] = field(repr=False)
    joints: tuple[str, ...] = field(repr=False)

    @property
    def summary(self) -> str:
        """The guesses in one line."""
        facts = self.facts
        parts = [f"base {facts['base']}"]
        for name, sole in facts.get("soles", {}).items():
            size = f"{1e3 * sole['length']:.0f} x {1e3 * sole['width']:.0f} mm"
            parts.append(f"{name} {size} on {sole['link']}")
        parts += [f"{n} on {m['link']}" for n, m in facts.get("hands", {}).items()]
        parts += [f"{k} {facts[k]['link']}" for k in ("torso", "pelvis") if k in facts]
        if "home" in facts:
            parts.append("a home posture")
        for kind, values in facts.get("limits", {}).items():
            parts.append(f"{kind} limits of {len(values)} joints")
        if "armature" in facts:
            parts.append(f"rotor inertias of {len(facts['armature'])} joints")
        if "locked" in facts:
            parts.append(f"{len(facts['locked'])} joints locked")
        return ", ".join(parts)

    @property
    def text(self) -> str:
        """The description file: YAML with each guess's reason as a comment."""
        lines = [
            f"# Proposed for {self.name} by `poise describe`: check what follows.",
            *(f"# Note: {remark}" for remark in self.remarks),
            f"# Links: {', '.join(self.links)}",
            f"# Joints: {', '.join(self.joints)}",
        ]
        for key, value in self.facts.items():
            lines += self._comment(key, 0)
            if isinstance(value, Mapping) and key not in ("pelvis", "torso"):
                lines.append(f"{key}:")
                lines += self._block(key, value, 1)
            else:
                lines.append(f"{key}: {_inline(value)}")
        return "\n".join(lines) + "\n"

    def _block(self, path: str, values: Mapping[str, Any], depth: int) -> list[str]:
        lines: list[str] = []
        for key, value in values.items():
            place, indent = f"{path}.{key}", "  " * depth
            lines += self._comment(place, depth)
            if path == "limits":
                lines.append(f"{indent}{key}:")
                lines += self._block(place, value, depth + 1)
            else:
                lines.append(f"{indent}{_inline(key)}: {_inline(value)}")
        return lines

    def _comment(self, place: str, depth: int) -> list[str]:
        reason = self.reasons.get(place)
        return [f"{'  ' * depth}# {reason}"] if reason else []


def _inline(value: object) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=10_000, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...").strip()


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
        self._facts: dict[str, Any] = {}
        self._reasons: dict[str, str] = {}
        self._remarks: list[str] = []
        self._outlines: dict[str, Float64[np.ndarray, "k 2"]] = {}
        document = self._read()
        self._links, self._joints = document.links(), document.joints()
        directory, packages = asset_folders(document, path)
        self._mjcf = read_facts(document, directory) if document.kind == "mjcf" else None
        self._says_fixed = _says_fixed(document, self._mjcf)
        settle_base(document, "floating")
        self._locked = self._without_room(document)
        mended = mend_inertias(document)
        if mended:
            self._remarks.append(f"inertias that no body has, made possible: {', '.join(mended)}")
        followers = followers_of(document, self._mjcf)
        endless = _endless(document)
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
        if self._mjcf is not None:
            apply_limits(self._model, torque=self._mjcf.torque)
        self._note_positions(endless)
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
        return Proposal(
            name=self._where,
            facts=self._facts,
            reasons=self._reasons,
            remarks=tuple(self._remarks),
            outlines=self._outlines,
            links=self._links,
            joints=self._joints,
        )

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
        self._remarks.append("y of the root link points up")
        return limbs

    def _read(self) -> Document:
        return parse(read_text(self._path, error=RobotError), self._where, self._path.parent)

    def _say(self, key: str, value: object, reason: str = "") -> None:
        """Enter a fact at a dotted path, with its reason."""
        *parents, last = key.split(".", 1) if key.startswith(("soles", "hands")) else [key]
        place = self._facts
        for parent in parents:
            place = place.setdefault(parent, {})
        place[last] = value
        if reason:
            self._reasons[key] = reason

    def _without_room(self, document: Document) -> list[str]:
        """Hinges whose limits leave no room: they are meant to be fixed."""
        if document.kind != "urdf":
            return []
        stuck: list[str] = []
        for joint in document.root.findall("joint"):
            limit = joint.find("limit")
            if joint.get("type") not in ("revolute", "prismatic") or limit is None:
                continue
            low, high = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
            if not low < high:
                stuck.append(joint.get("name", ""))
        if stuck:
            self._remarks.append(f"limits of these joints leave no room: {', '.join(stuck)}")
        return stuck

    def _note_positions(self, endless: Mapping[str, tuple[float, float]]) -> None:
        """Give a range to hinges without one, which Poise needs."""
        unlimited = dict(endless)
        for name, joint in hinges(self._model):
            low = float(self._model.lowerPositionLimit[joint.idx_q])
            high = float(self._model.upperPositionLimit[joint.idx_q])
            if not (math.isfinite(low) and math.isfinite(high) and abs(high - low) < 1e300):
                unlimited[name] = (-math.pi, math.pi)
        apply_limits(self._model, unlimited)
        free = [n for n in unlimited if n not in self._source.locked_joints]
        if free:
            self._facts["limits"] = {"position": {n: [-3.1416, 3.1416] for n in free}}
            self._reasons["limits.position"] = (
                "assumed: one turn for joints that the file lets turn without end [rad]"
            )

    def _fixed(self) -> None:
        facts = {"base": "fixed", **self._facts}
        self._facts = facts
        self._reasons["base"] = "the root is fixed in the file, and no legs were found"
        self._limits((), floating=True)
        self._armature(pin.neutral(self._model))
        self._lock(())

    def _floating(self, limbs: Limbs) -> None:
        limits = self._facts.pop("limits", None)
        self._say("base", "floating", "two legs were found")
        if self._says_fixed:
            self._remarks.append("the file fixes the root, but the robot has legs")
        self._remarks += [f"left and right differ: {a}" for a in limbs.asymmetries]
        world_T_base = pin.SE3(self._upright, np.zeros(3))
        q = pin.neutral(self._model)
        q[:7] = pin.SE3ToXYZQUAT(world_T_base)
        data = self._model.createData()
        pin.framesForwardKinematics(self._model, data, q)
        feet = [self._foot(leg, data, limbs.forward) for leg in limbs.legs]
        soles = self._soles(feet, data)
        legs, beyond = _parted(limbs.legs, feet)
        apart = abs(float((feet[0].fit.position - feet[1].fit.position) @ _left(limbs.forward)))
        tall = float(data.oMi[limbs.legs[0][0]].translation[2] - feet[0].fit.position[2])
        apart = max(min(apart, _WIDEST * tall), 1.15 * max(foot.fit.width for foot in feet))
        back = self._ankle_relief(feet, legs, data, limbs.forward)
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
            self._facts["limits"] = limits
        self._limits(soles, floating=True)
        self._armature(stance.q)
        self._lock([*limbs.fingers, *beyond])

    def _foot(self, leg: Sequence[int], data: pin.Data, forward: Float64[np.ndarray, "3"]):
        """The joint whose links a leg stands on, and its sole: the last one, or that before toes.

        Raises:
            RobotError: neither has a flat lower face.
        """
        found: list[_Foot] = []
        problem: RobotError | None = None
        # Joints of two or three axes carry links with their last axis alone.
        for joint in [j for j in reversed(leg) if _body_frames(self._model, j)][:2]:
            try:
                found.append(self._fit(joint, data, forward))
            except RobotError as error:
                problem = problem or error
        if not found:
            assert problem is not None
            raise problem
        end = found[0]
        for foot in found[1:]:
            level = foot.fit.position[2] < end.fit.position[2] + _TOE
            if level and foot.area > end.area:
                return foot
        return end

    def _fit(self, joint: int, data: pin.Data, forward: Float64[np.ndarray, "3"]) -> "_Foot":
        frames = _body_frames(self._model, joint)
        names = [self._model.frames[i].name for i in frames]
        shapes = link_shapes(self._source, names, self._where)
        problem: RobotError | None = None
        fits: list[_Foot] = []
        for kind in ("collision", "visual"):
            parts: list[Balls] = [
                balls.moved(data.oMf[i])
                for i, name in zip(frames, names, strict=True)
                for balls in getattr(shapes[name], kind)
            ]
            foot = union(parts)
            if foot is None:
                continue
            try:
                fit = fit_sole(foot, forward, f"foot {names[0]!r} of {self._where}")
            except RobotError as error:
                problem = error
                continue
            fits.append(_Foot(joint=joint, fit=fit, kind=kind))
        if fits:
            # A few contact points can leave out most of a foot that has a whole flat face.
            larger = fits[-1].area > _MUCH_LARGER * fits[0].area
            level = abs(fits[-1].fit.position[2] - fits[0].fit.position[2]) < _TOE
            return fits[-1] if larger and level else fits[0]
        raise problem or RobotError(
            f"foot {names[0]!r} of {self._where} has no shape to read a sole from",
            got=f"links {names} with neither collision nor visual geometry"
            + (f"; missing meshes {self._lost_meshes[:4]}" if self._lost_meshes else ""),
            wanted="the meshes beside the file, or a sole under `soles` in a description",
        )

    def _soles(self, feet: Sequence["_Foot"], data: pin.Data) -> list[int]:
        """Enter the soles, and put their frames into the model."""
        sizes = np.array([[f.fit.length, f.fit.width] for f in feet])
        if np.abs(sizes[0] - sizes[1]).max() < _SAME_SOLE:
            sizes[:] = sizes.min(axis=0)
        else:
            said = " and ".join(f"{1e3 * a:.0f} x {1e3 * b:.0f} mm" for a, b in sizes)
            self._remarks.append(f"left and right differ: soles of {said}")
        frames: list[int] = []
        for side, foot, (length, width) in zip(SIDES, feet, sizes, strict=True):
            fit, model = foot.fit, self._model
            index = _main_frame(model, foot.joint)
            place = data.oMf[index].actInv(pin.SE3(fit.rotation, fit.position))
            name = f"{side}_sole"
            mount = _mount(model.frames[index].name, place)
            self._say(
                f"soles.{name}",
                {**mount, "length": _floor(length), "width": _floor(width)},
                f"the largest rectangle on the flat lower face of its {foot.kind} geometry "
                f"({fit.points} points within 3 mm)",
            )
            self._outlines[name] = fit.outline
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
            index = _main_frame(self._model, joint)
            placement, said = data.oMf[index], reason
            if key == "torso" and not limbs.arms:
                said = "no arms were found: the root link"
            middle = 0.5 * sum((data.oMi[leg[0]].translation for leg in limbs.legs), np.zeros(3))
            origin = np.zeros(3)
            if key == "pelvis" and np.linalg.norm(middle - placement.translation) > _FAR_ROOT:
                origin, said = placement.actInv(middle), f"{reason}, between the hips"
            place = pin.SE3(placement.rotation.T, origin)
            self._say(key, _mount(self._model.frames[index].name, place), said)

    def _hands(self, limbs: Limbs) -> None:
        for side, arm in zip(SIDES, limbs.arms, strict=False):
            index = _main_frame(self._model, arm[-1])
            frame = self._model.frames[index]
            point, reason = self._hand_point(arm[-1])
            self._say(
                f"hands.{side}_hand",
                _mount(frame.name, pin.SE3(np.eye(3), frame.placement.actInv(point))),
                reason,
            )

    def _hand_point(self, joint: int) -> tuple[Float64[np.ndarray, "3"], str]:
        """Where a hand is, in the axes of the joint that carries it [m]."""
        com = np.array(self._model.inertias[joint].lever)
        frames = _body_frames(self._model, joint)
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

    def _ankle_relief(
        self,
        feet: Sequence["_Foot"],
        legs: Sequence[Sequence[int]],
        data: pin.Data,
        forward: Float64[np.ndarray, "3"],
    ) -> float:
        """How far the COM should stand behind the soles' middle, to spare weak ankles [m]."""
        model, back = self._model, 0.0
        weight = sum(float(i.mass) for i in model.inertias) * GRAVITY
        for foot, leg in zip(feet, legs, strict=True):
            dofs = [model.joints[j].idx_v for j in leg[-2:]]
            torque = float(min(model.effortLimit[d] for d in dofs))
            before = float((foot.fit.position - data.oMi[leg[-1]].translation) @ forward)
            if 0.0 < torque < 1e300:
                back = max(back, before - _ANKLE_PART * torque / (0.5 * weight))
        return min(back, _MOST_BACK * min(foot.fit.length for foot in feet))

    def _home(self, stance: Stance, back: float) -> None:
        angles: dict[str, float] = {}
        for name, joint in hinges(self._model):
            angle = round(float(stance.q[joint.idx_q]), 4) + 0.0
            if angle:
                angles[name] = angle
        self._facts["home"] = angles
        if stance.reached:
            reason = (
                "by inverse kinematics: soles level, COM over their middle, knees a little bent"
            )
        else:
            reason = f"NOT a standing posture: off by {stance.error:.3f} m or rad at best"
            self._remarks.append(
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
        self._reasons["home"] = reason + " [rad]"

    def _limits(self, soles: Sequence[int], *, floating: bool) -> None:
        model = self._model
        before = model.velocityLimit.copy(), model.effortLimit.copy()
        names = [model.frames[i].name for i in soles]
        said = assume_limits(model, names, floating=floating)
        limits = self._facts.setdefault("limits", {})
        for key, now, old, unit in (
            ("velocity", model.velocityLimit, before[0], "rad/s"),
            ("torque", model.effortLimit, before[1], "N m"),
        ):
            changed = {
                name: float(f"{now[j.idx_v]:.3g}")
                for name, j in hinges(model)
                if now[j.idx_v] != old[j.idx_v]
            }
            if changed:
                limits[key] = changed
                why = next(s for s in said if s.startswith(key))
                self._reasons[f"limits.{key}"] = f"assumed, as the file has none: {why} [{unit}]"
        if not limits:
            del self._facts["limits"]

    def _armature(self, q: Float64[np.ndarray, " nq"]) -> None:
        """Rotor inertias where the file has none: _RUN_UP times torque over speed limit."""
        model, data = self._model, self._model.createData()
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
            self._facts["armature"] = found
            self._reasons["armature"] = (
                "estimated, as the file has none: 4 ms times torque limit over speed limit, and "
                "at least 2 % of the inertia that the joint moves [kg m^2]"
            )

    def _lock(self, fingers: Sequence[int]) -> None:
        locked = [*self._locked, *(self._model.names[j] for j in fingers)]
        if not locked:
            return
        self._facts["locked"] = locked
        self._reasons["locked"] = "fingers, toes, and joints whose limits leave no room"
        for key in ("home", "armature"):
            for name in locked:
                self._facts.get(key, {}).pop(name, None)
        for values in self._facts.get("limits", {}).values():
            for name in locked:
                values.pop(name, None)


@dataclass(frozen=True)
class _Foot:
    """What a leg stands on: the joint that moves it, its flat face, and which shapes have it."""

    joint: int
    fit: SoleFit
    kind: str

    @property
    def area(self) -> float:
        """Of the sole [m^2]."""
        return self.fit.length * self.fit.width


def _parted(
    legs: Sequence[Sequence[int]], feet: Sequence[_Foot]
) -> tuple[list[Sequence[int]], list[int]]:
    """The joints of each leg down to its sole, and those of toes beyond."""
    kept = [leg[: leg.index(foot.joint) + 1] for leg, foot in zip(legs, feet, strict=True)]
    return kept, [j for leg, part in zip(legs, kept, strict=True) for j in leg[len(part) :]]


def _left(forward: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
    return np.cross([0.0, 0.0, 1.0], forward)


def _says_fixed(document: Document, mjcf: MjcfFacts | None) -> bool:
    """Whether a file hangs its root on the world."""
    if mjcf is not None:
        return not mjcf.free
    parents = {p.get("link") for p in document.root.iter("parent")}
    children = {c.get("link") for c in document.root.iter("child")}
    return "world" in parents - children


def _endless(document: Document) -> dict[str, tuple[float, float]]:
    """One turn for each joint of a URDF that turns without end."""
    if document.kind != "urdf":
        return {}
    joints = document.root.findall("joint")
    ends = {
        j.get("name", "")
        for j in joints
        if j.get("type") == "continuous"
        or (j.get("type") == "revolute" and j.find("limit") is None)
    }
    return dict.fromkeys(sorted(ends), (-math.pi, math.pi))


def _body_frames(model: pin.Model, joint: int) -> list[int]:
    """Links that a joint moves as one."""
    kind = pin.FrameType.BODY
    return [i for i, f in enumerate(model.frames) if f.type == kind and f.parentJoint == joint]


def _main_frame(model: pin.Model, joint: int) -> int:
    """The heaviest of the links that a joint moves as one; the first where none says its mass."""
    return max(_body_frames(model, joint), key=lambda i: (float(model.frames[i].inertia.mass), -i))


def _mount(link: str, place: pin.SE3) -> dict[str, Any]:
    mount: dict[str, Any] = {"link": link}
    position = [round(float(x), 4) + 0.0 for x in place.translation]
    rpy = [round(float(x), 4) + 0.0 for x in pin.rpy.matrixToRpy(place.rotation)]
    if any(position):
        mount["position"] = position
    if any(rpy):
        mount["rpy"] = rpy
    return mount


def _floor(size: float) -> float:
    """A size in whole millimetres, never larger [m]."""
    return math.floor(1e3 * size + 1e-6) / 1e3
