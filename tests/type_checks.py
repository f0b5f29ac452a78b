"""The type checker of the tests: of each function its first calls in each test, and a few later.

A run of thousands of ticks makes the same calls over and over, and with all of them checked takes
six times as long.

`--jaxtyping-packages` puts `@jaxtyping.jaxtyped` before every function and class of the packages;
here another decorator takes its name, so this is to be imported before any of them.
"""

import dataclasses
import functools
import inspect

import jaxtyping

FIRST = 30
"""Calls of a function that are checked in each test, before what is checked is a sample."""

EVERY = 1000
"""So many calls after them are not checked, then one is, and so on."""

_test = 0
"""Number of the test."""


def begin_test():
    """The next calls are checked, whatever was before."""
    global _test
    _test += 1


def jaxtyped(*, typechecker):
    """In place of `jaxtyping.jaxtyped`, for functions and classes."""
    return functools.partial(_decorated, typechecker=typechecker)


def _decorated(thing, *, typechecker):
    if not inspect.isclass(thing):
        return _sampled(thing, typechecker)
    # A dataclass writes its own `__init__`, which no decorator stands before.
    if dataclasses.is_dataclass(thing) and not hasattr(thing.__init__, "__wrapped__"):
        thing.__init__ = _sampled(thing.__init__, typechecker)
    return thing


def _sampled(function, typechecker):
    """A function of which some calls are checked; what checks it is made by the first of them."""
    checked, test, left, passed = None, -1, 0, 0

    @functools.wraps(function)
    def call(*arguments, **named):
        nonlocal checked, test, left, passed
        if test != _test:
            test, left, passed = _test, FIRST, 0
        if passed:
            passed -= 1
            return function(*arguments, **named)
        __tracebackhide__ = True
        left -= 1
        if left <= 0:
            passed = EVERY
        if checked is None:
            checked = _jaxtyped(function, typechecker=typechecker)
        return checked(*arguments, **named)

    return call


_jaxtyped, jaxtyping.jaxtyped = jaxtyping.jaxtyped, jaxtyped
