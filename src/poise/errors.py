"""Errors of Poise: one root, and one class for each kind that a caller may catch.

Every message has the value, the wanted one and, where there is a list, the valid choices. The
control loop raises none of these: it returns a status.
"""

import copy
import difflib
from collections.abc import Iterable
from importlib import import_module
from typing import Any

__all__ = [
    "ConfigurationError",
    "MissingExtraError",
    "PoiseError",
    "ProblemError",
    "RobotError",
    "TargetError",
    "UnknownNameError",
]

_LONGEST = 1000
"""Characters shown of a value: a screen holds about 2,000."""

_NOTHING = object()


class PoiseError(Exception):
    """Root of all errors that Poise raises on purpose.

    Args:
        what: what is wrong, as a short sentence without a full stop.
        got: the offending value, kept as the attribute `got`.
        wanted: what would have been right.
        choices: the valid names, nearest to `got` first in the message.
    """

    def __init__(
        self,
        what: str,
        *,
        got: object = _NOTHING,
        wanted: str = "",
        choices: Iterable[str] | None = None,
    ) -> None:
        self.what = what = " ".join(what.split())
        self.got = None if got is _NOTHING else got
        self.wanted = wanted
        self.choices = tuple(choices) if choices is not None else ()
        parts = [what]
        if got is not _NOTHING:
            said = repr(got)
            parts.append(f"got {said if len(said) <= _LONGEST else said[:_LONGEST] + '...'}")
        if wanted:
            parts.append(f"wanted {wanted}")
        if choices is not None:
            parts.append(f"choices: {_list_choices(str(self.got)[:_LONGEST], self.choices)}")
        super().__init__("; ".join(parts))

    def located(self, place: str) -> "PoiseError":
        """Return the error with its place in front, such as a file with its line."""
        said = copy.copy(self)
        said.what, said.args = f"{place}: {self.what}", (f"{place}: {self}",)
        return said


class RobotError(PoiseError):
    """A robot cannot be loaded or described: a missing file, mesh, inertia, limit or frame."""


class UnknownNameError(PoiseError):
    """A robot, frame, joint, task, solver, scenario or other name that does not exist."""


class ConfigurationError(PoiseError):
    """A gain, bound, mask, stack, scenario or setting that cannot be right."""


class TargetError(PoiseError):
    """A task target with the wrong shape, or with NaN or infinity in it."""


class ProblemError(PoiseError):
    """A hierarchical problem that is not one: wrong shapes, NaN coefficients, crossing bounds."""


class MissingExtraError(PoiseError):
    """Something optional is not installed; the message names the command that installs it.

    Args:
        package: what is missing.
        extra: of Poise that has it, "" where no extra does.
        purpose: what it is needed for.
        install: the command that installs it; pip with the extra when None.
    """

    def __init__(
        self, package: str, extra: str, purpose: str, *, install: str | None = None
    ) -> None:
        install = f'pip install "poise[{extra}]"' if install is None else install
        super().__init__(
            f"{purpose} needs the package {package!r}, which is not installed; "
            f"install it with: {install}"
        )


def import_extra(module: str, extra: str, purpose: str, *, package: str = "") -> Any:
    """Import an optional module, of the package with its name unless another is given."""
    root = module.split(".")[0]
    try:
        import_module(root)
        return import_module(module)
    except ModuleNotFoundError as error:
        raise MissingExtraError(package or root, extra, purpose) from error


def _list_choices(got: str, choices: tuple[str, ...], most: int = 60) -> str:
    if not choices:
        return "(none)"
    nearest = difflib.get_close_matches(got, choices, n=5, cutoff=0.5)
    rest = [c for c in choices if c not in nearest]
    shown = (nearest + rest)[:most]
    hidden = len(choices) - len(shown)
    return ", ".join(shown) + (f" and {hidden} more" if hidden else "")
