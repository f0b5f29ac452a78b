"""`Proposal`: a description with the reason for each guess."""

import re
from collections.abc import Mapping, Sized
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import yaml
from jaxtyping import Float64


@dataclass(frozen=True)
class Proposal:
    """A description with the reason for each guess."""

    name: str  # of the model file
    # the description, as `load_robot(path, description)` takes it
    facts: dict[str, Any] = field(repr=False)
    # why, by the path of a fact, such as "soles.left_sole"
    reasons: dict[str, str] = field(repr=False)
    remarks: tuple[str, ...]  # what is odd about the file, as sentences
    # the flat face of each sole in the sole's own x and y [m]
    outlines: dict[str, Float64[np.ndarray, "k 2"]] = field(repr=False)
    links: tuple[str, ...] = field(repr=False)  # names of the document's links
    joints: tuple[str, ...] = field(repr=False)  # names of its joints

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
        parts.append("a home posture")
        parts += [f"{k} limits of {_joints(v)}" for k, v in facts.get("limits", {}).items()]
        words = {"armature": "rotor inertias of {}", "locked": "{} locked"}
        parts += [said.format(_joints(facts[k])) for k, said in words.items() if k in facts]
        return ", ".join(parts)

    @property
    def text(self) -> str:
        """The description file: YAML with each guess's reason as a comment."""
        head = [f"# Proposed for {self.name} by `poise describe`: check what follows."]
        head += [f"# Note: {remark}" for remark in self.remarks]
        head += [f"# Links: {', '.join(self.links)}", f"# Joints: {', '.join(self.joints)}"]
        return "\n".join(head + self._lines("", self.facts)) + "\n"

    def _lines(self, path: str, values: Mapping[str, Any]) -> list[str]:
        """One line a value, and one of its own for each entry of what has parts."""
        lines: list[str] = []
        indent = "  " * path.count(".")
        for key, value in values.items():
            place = f"{path}{key}"
            lines += [f"{indent}# {self.reasons[place]}"] if place in self.reasons else []
            parts = path in ("", "limits.") and key not in ("pelvis", "torso")
            if parts and isinstance(value, Mapping) and value:
                lines += [f"{indent}{key}:", *self._lines(f"{place}.", value)]
            else:
                lines.append(f"{indent}{_inline(key)}: {_inline(value)}")
        return lines


def joint_pattern(joint: str) -> str:
    """A pattern that matches a joint's name and no other."""
    return joint if re.fullmatch(r"[\w /-]*", joint) else re.escape(joint)


def _joints(some: Sized) -> str:
    return f"{len(some)} joint{'s' if len(some) != 1 else ''}"


def _inline(value: object) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=10_000, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...").strip()
