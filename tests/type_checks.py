"""The type checker of the tests: every test has its first calls checked, and a long one no more.

A run of thousands of ticks makes the same calls over and over, and with all of them checked takes
six times as long.
"""

import jaxtyping
from beartype import beartype

CHECKED = 10_000
"""Calls that are checked in each test: some hundred ticks of a controller, half a second."""

_left = CHECKED


def begin_test():
    """The next calls are checked, whatever was before."""
    global _left
    _left = CHECKED
    jaxtyping.config.update("jaxtyping_disable", False)


def beartype_at_first(function):
    """`beartype.beartype`, which after so many calls in a test ends all checks until the next."""
    checked = beartype(function)

    def check(*arguments, **named):
        global _left
        _left -= 1
        if _left < 0:
            jaxtyping.config.update("jaxtyping_disable", True)
        return checked(*arguments, **named)

    return check
