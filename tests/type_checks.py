"""The type checker of the tests: of each function its first calls in each test, and a few later.

A run of thousands of ticks makes the same calls over and over, and with all of them checked takes
six times as long. Even asking at each call whether it is one to check takes a fifth of a run, so
most functions, once their first calls are checked, are left as they were written.

`--jaxtyping-packages` puts `@jaxtyping.jaxtyped` before every function and class of the packages;
here another decorator takes its name, so this is to be imported before any of them.
"""

import dataclasses
import functools
import inspect
import zlib
from collections import deque
from types import FunctionType

import jaxtyping

FIRST = 2
"""Calls of a function that are checked in each test, before what is checked is a sample.

The first call often comes from a constructor, with all at rest; the second from what is tried. With
ten a test of a small thing took a third longer."""

EVERY = 1000
"""So many calls after them are not checked, then one is, and so on; of those that count."""

_COUNT = 16
"""One function in so many counts its calls, so that the others need not."""

_test = 0
"""Number of the test."""

_free = deque()
"""Functions whose calls are not checked at present, the one that was checked last behind."""


def begin_test():
    """The next calls are checked, whatever was before."""
    global _test
    _test += 1
    _check_again(len(_free))


def _check_again(count):
    """The next call of so many functions is checked."""
    for _ in range(min(count, len(_free))):
        _free.popleft().begin()


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
    name = f"{function.__module__}.{function.__qualname__}"
    # What a call of another function makes comes and goes; what is set free stays.
    if "<locals>" in name or zlib.crc32(name.encode()) % _COUNT == 0:
        return counting(function, typechecker)
    return _Freed(function, typechecker).outer


def counting(function, typechecker):
    """The function, which knows at each call whether it is to be checked.

    With each sample of it, others that are free have their next call checked.
    """
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
        if left < 0:
            _check_again(_COUNT)
        if checked is None:
            checked = _jaxtyped(function, typechecker=typechecker)
        return checked(*arguments, **named)

    return call


class _Freed:
    """A function whose calls are checked, and whose own code takes the place of the check later.

    Attributes:
        outer: what takes the place of the function: its code is either.
    """

    def __init__(self, function, typechecker):
        self._function, self._typechecker = function, typechecker
        self._checked, self._test, self._left = None, -1, 0
        self._check = _code_of(self._call, function)
        outer = FunctionType(self._check, function.__globals__, closure=function.__closure__)
        self.outer = functools.update_wrapper(outer, function)
        outer.__defaults__, outer.__kwdefaults__ = function.__defaults__, function.__kwdefaults__

    def begin(self):
        """The next call is checked."""
        self.outer.__code__ = self._check

    def _call(self, /, *arguments, **named):
        __tracebackhide__ = True
        if self._test != _test:
            self._test, self._left = _test, FIRST
        self._left -= 1
        if self._left <= 0:
            self.outer.__code__ = self._function.__code__
            _free.append(self)
        if self._checked is None:
            self._checked = _jaxtyped(self._function, typechecker=self._typechecker)
        return self._checked(*arguments, **named)


def _code_of(taken, function):
    """Code of a function that calls another, for a function with the same closure."""
    code = _passing_on(len(function.__code__.co_freevars))
    constants = tuple(taken if one == "taken" else one for one in code.co_consts)
    return code.replace(co_consts=constants, co_freevars=function.__code__.co_freevars)


@functools.cache
def _passing_on(count):
    """Code with so many free variables.

    It is compiled with them, as a frame of code that has got them later cannot be looked into.
    """
    cells = [f"cell_{k}" for k in range(count)]
    source = f"""
def around({", ".join(cells)}):
    def pass_on(*arguments, **named):
        __tracebackhide__ = True
        taken = "taken"
        return taken(*arguments, **named)
        {", ".join(cells) or "..."}
    return pass_on
"""
    made = {}
    exec(source, made)
    return made["around"](*cells).__code__


_jaxtyped, jaxtyping.jaxtyped = jaxtyping.jaxtyped, jaxtyped
