"""`Method`: a controller and the way it solves, by the name the command line gives it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from poise.control import CONTROLLERS, ControllerPlan
from poise.errors import UnknownNameError

DIRECT = "direct"
"""The whole-body controller's own way, what everything else is compared with."""

DEFAULT_METHODS = (DIRECT, "cascade/osqp", "weighted")
"""The product's own, the paper's way, and one QP with weights."""

COMPARED_METHODS = (DIRECT, "cascade/osqp")
"""What the reduced controller is compared by: the product's own way and the paper's."""

BY_PROGRAMS = ("whole_body", "reduced")
"""Controllers by quadratic programs: they solve in the same ways."""

BACKENDS = ("osqp", "proxqp", "piqp", "quadprog", "clarabel", "daqp")
"""QP solvers that the cascade and weighted strategies take."""


def method_names(controller: str) -> tuple[str, ...]:
    """All names that a controller's methods can have, its default first."""
    names = CONTROLLERS[controller].strategies
    if controller not in BY_PROGRAMS:
        return names
    solved = tuple(f"{s}/{b}" for s in ("cascade", "weighted") for b in BACKENDS)
    return (DIRECT, "weighted", *solved)


@dataclass(frozen=True, kw_only=True)
class Method:
    """A controller, a strategy and its backend."""

    controller: str  # one of `CONTROLLERS`
    name: str  # "direct", "cascade/osqp", "fused",
    strategy: str  # as the controller takes it
    backend: str | None  # as the controller takes it, None for the strategy's own

    def plan(self) -> ControllerPlan:
        """A controller that solves like this."""
        return ControllerPlan(name=self.controller, strategy=self.strategy, backend=self.backend)


REFERENCE = Method(controller="whole_body", name=DIRECT, strategy=DIRECT, backend=None)
"""What every other method is compared with."""


def parse_method(controller: str, name: str) -> Method:
    """The method of a name."""
    names = method_names(controller)
    if name not in names:
        raise UnknownNameError(
            f"unknown method of controller {controller}", got=name, choices=names
        )
    strategy, _, backend = name.partition("/")
    return Method(controller=controller, name=name, strategy=strategy, backend=backend or None)


def default_methods(controller: str) -> tuple[str, ...]:
    """Methods of a controller that are timed by default."""
    if controller == "reduced":
        return COMPARED_METHODS
    return DEFAULT_METHODS if controller == "whole_body" else method_names(controller)[:1]


def timed_methods(controller: str, names: Sequence[str] | None) -> tuple[Method, ...]:
    """Everything that is timed: what was asked for, and what it is compared with.

    The reference comes first. Each method of the reduced controller has the whole-body
    controller's of the same name beside it.
    """
    names = default_methods(controller) if names is None else names
    wanted = [parse_method(controller, name) for name in names]
    beside = [replace(m, controller="whole_body") for m in wanted if controller == "reduced"]
    return tuple(dict.fromkeys((REFERENCE, *beside, *wanted)))
