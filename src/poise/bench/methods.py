"""`Method`: a way to solve the tick that is timed, by the name the command line gives it."""

from dataclasses import dataclass

from poise.control.make import ControllerPlan
from poise.errors import UnknownNameError

DIRECT = "direct"
"""What every other method is compared with."""

DEFAULT_METHODS = (DIRECT, "cascade/osqp", "weighted")
"""The product's own, the paper's way, and one QP with weights."""

BACKENDS = ("osqp", "proxqp", "piqp", "quadprog", "clarabel", "daqp")
"""QP solvers that the cascade and weighted strategies take."""

METHODS = (
    DIRECT,
    "weighted",
    *(f"cascade/{b}" for b in BACKENDS),
    *(f"weighted/{b}" for b in BACKENDS),
)
"""All names a method can have."""


@dataclass(frozen=True, kw_only=True)
class Method:
    """A strategy with its backend.

    Attributes:
        name: "direct", "cascade/osqp", "weighted", ...
        strategy: as `make_solver` takes it.
        backend: likewise, None for the strategy's own.
    """

    name: str
    strategy: str
    backend: str | None

    def plan(self, controller: str) -> ControllerPlan:
        """A controller that solves like this."""
        return ControllerPlan(name=controller, strategy=self.strategy, backend=self.backend)


def parse_method(name: str) -> Method:
    """The method of a name.

    Raises:
        UnknownNameError: no such method.
    """
    if name not in METHODS:
        raise UnknownNameError("unknown method", got=name, choices=METHODS)
    strategy, _, backend = name.partition("/")
    return Method(name=name, strategy=strategy, backend=backend or None)
