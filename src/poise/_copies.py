"""Copies of objects whose arrays are views of memory that others use."""

from enum import Enum
from typing import Any, ClassVar

import numpy as np


class Copied:
    """Base of objects that share memory with others.

    A copied view is an array of its own: `share_memory` has to make views of the object's own
    arrays anew. Arrays named in `foreign` are copied, other objects named there left out.
    """

    foreign: ClassVar[tuple[str, ...]] = ()
    """Attributes that refer to memory of another object, which writes them."""

    def __getstate__(self) -> dict[str, Any]:
        return {
            name: value
            for name, value in vars(self).items()
            if name not in self.foreign or isinstance(value, np.ndarray)
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.share_memory()

    def share_memory(self) -> None:
        """Make views of the object's own arrays."""


def restore(thing: object, saved: object) -> None:
    """Set an object to the numbers of a copy of it, in place."""
    foreign = getattr(thing, "foreign", ())
    for name, value in vars(saved).items():
        if name not in foreign:
            # Public attributes of some are for reading.
            vars(thing)[name] = restored(vars(thing).get(name), value)


def restored(own: Any, saved: Any) -> Any:
    """Return the value of an attribute after `restore`, its own where that is changed in place."""
    kind = type(own)
    if own is saved or isinstance(own, Copied):
        return own
    if isinstance(own, np.ndarray) and isinstance(saved, np.ndarray) and own.shape == saved.shape:
        if own.flags.writeable:
            own[...] = saved
        return own
    if kind is not type(saved) or kind.__module__ in ("builtins", "numpy") or _is_frozen(own):
        return saved
    if isinstance(own, tuple) and hasattr(own, "_fields"):
        return own._replace(**{k: restored(getattr(own, k), v) for k, v in saved._asdict().items()})
    if kind.__module__.startswith("poise."):
        restore(own, saved)
    # A user's object may be known elsewhere: it stays.
    return own


def _is_frozen(value: Any) -> bool:
    parameters = getattr(type(value), "__dataclass_params__", None)
    return isinstance(value, Enum) or (parameters is not None and parameters.frozen)
