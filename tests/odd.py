"""Objects with values that nobody has checked, such as a device or a driver may give."""

from copy import copy

from msgspec import Struct, structs


def odd(thing, **values):
    """A copy of a frozen thing that has other values, of whatever kind."""
    if isinstance(thing, Struct):
        return structs.replace(thing, **values)
    changed = copy(thing)
    for name, value in values.items():
        object.__setattr__(changed, name, value)
    return changed
