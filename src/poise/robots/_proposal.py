"""`Proposal`: a description with the reason for each guess. `Draft`: one that is being written."""

import re
from collections.abc import Mapping, Sized
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
import yaml
from jaxtyping import Float64


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
            parts.append(f"{kind} limits of {_joints(values)}")
        if "armature" in facts:
            parts.append(f"rotor inertias of {_joints(facts['armature'])}")
        if "locked" in facts:
            parts.append(f"{_joints(facts['locked'])} locked")
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
            if isinstance(value, Mapping) and value and key not in ("pelvis", "torso"):
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


def _joints(some: Sized) -> str:
    return f"{len(some)} joint{'s' if len(some) != 1 else ''}"


def _inline(value: object) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=10_000, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...").strip()


class Draft:
    """A description that is being written.

    Attributes:
        facts: as `Proposal` has them; likewise the others.
        reasons: likewise.
        remarks: likewise.
        outlines: likewise.
    """

    def __init__(self) -> None:
        self.facts: dict[str, Any] = {}
        self.reasons: dict[str, str] = {}
        self.remarks: list[str] = []
        self.outlines: dict[str, Float64[np.ndarray, "k 2"]] = {}

    def say(self, key: str, value: object, reason: str = "") -> None:
        """Enters a fact at a dotted path, with its reason."""
        *parents, last = key.split(".", 1) if key.startswith(("soles", "hands")) else [key]
        place = self.facts
        for parent in parents:
            place = place.setdefault(parent, {})
        place[last] = value
        if reason:
            self.reasons[key] = reason

    def finish(self, name: str, links: tuple[str, ...], joints: tuple[str, ...]) -> Proposal:
        """The description.

        Args:
            name: of the model file.
            links: of the document.
            joints: of the document.
        """
        return Proposal(
            name=name,
            facts=_with_patterns(self.facts),
            reasons=self.reasons,
            remarks=tuple(self.remarks),
            outlines=self.outlines,
            links=links,
            joints=joints,
        )


_PLAIN = re.compile(r"[\w /-]*")
"""What a pattern of these letters alone matches is itself."""


def _pattern(joint: str) -> str:
    """A pattern that matches a joint's name and no other."""
    return joint if _PLAIN.fullmatch(joint) else re.escape(joint)


def _with_patterns(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts with patterns where joints are named."""
    written = dict(facts)
    for key in ("home", "armature"):
        if key in facts:
            written[key] = {_pattern(joint): value for joint, value in facts[key].items()}
    if "limits" in facts:
        written["limits"] = {
            kind: {_pattern(joint): value for joint, value in values.items()}
            for kind, values in facts["limits"].items()
        }
    if "locked" in facts:
        written["locked"] = [_pattern(joint) for joint in facts["locked"]]
    return written


def mount_on(link: str, place: pin.SE3) -> dict[str, Any]:
    """Where something is on a link, as descriptions say it.

    Args:
        link: its name.
        place: along the link's axes.
    """
    mount: dict[str, Any] = {"link": link}
    position = [round(float(x), 4) + 0.0 for x in place.translation]
    rpy = [round(float(x), 4) + 0.0 for x in pin.rpy.matrixToRpy(place.rotation)]
    if any(position):
        mount["position"] = position
    if any(rpy):
        mount["rpy"] = rpy
    return mount
