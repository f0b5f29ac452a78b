"""What is raced: names of methods, which of them are installed, and a contestant of each."""

from collections.abc import Sequence

from benchmarks.hqp.contestant import Contestant, LexlsContestant, StrategyContestant
from benchmarks.hqp.daqp_contestants import DaqpHard, DaqpHierarchical
from poise.errors import MissingExtraError, UnknownNameError
from poise.hqp import ACCURACY, make_solver

REFERENCE = "lexls"
"""What every other method is compared with."""

_OWN = ("lexls", "daqp-hard", "daqp-hierarchical", "weighted")

METHODS = (
    *_OWN,
    *(f"cascade/{backend}" for backend in ACCURACY),
    "lexls/solve",
    "daqp-hierarchical/own-scale",
    *(f"weighted/{backend}" for backend in ACCURACY),
)
"""All names: what is raced by default, then what must be asked for."""

_USUAL = (*_OWN, *(f"cascade/{backend}" for backend in ACCURACY))

QUICK = ("lexls", "daqp-hard", "daqp-hierarchical")
"""Methods, or what stands before their slash, that take turns problem by problem."""


def is_quick(method: str) -> bool:
    """Whether a method takes turns with the quick ones, which leave it a warm cache.

    Args:
        method: one of `METHODS`.
    """
    return method.partition("/")[0] in QUICK


def usual_methods() -> tuple[str, ...]:
    """What is raced where nothing else is asked for: as far as it is installed."""
    return tuple(name for name in _USUAL if _missing(name) is None)


def what_is_missing() -> tuple[str, ...]:
    """For each usual method that is not installed, what it needs and the command to install it."""
    reasons = (_missing(name) for name in _USUAL)
    return tuple(str(reason) for reason in reasons if reason is not None)


def checked_methods(names: Sequence[str] | None) -> tuple[str, ...]:
    """Everything that is raced: what was asked for, the reference before it.

    Args:
        names: of `METHODS`; the usual ones when None.

    Raises:
        UnknownNameError: no such method.
        MissingExtraError: one that is not installed.
    """
    wanted = usual_methods() if names is None else tuple(names)
    for name in wanted:
        if name not in METHODS:
            raise UnknownNameError("unknown method", got=name, choices=METHODS)
        reason = _missing(name)
        if reason is not None:
            raise reason
    return tuple(dict.fromkeys((REFERENCE, *wanted)))


def make_contestant(method: str, time_limit: float) -> Contestant:
    """A method with a workspace of its own; whatever must be compiled is, before it returns.

    Args:
        method: one of `METHODS`.
        time_limit: cap on a solve [s].
    """
    if method == REFERENCE:
        return LexlsContestant(time_limit)
    if method == "lexls/solve":
        return StrategyContestant(make_solver("direct", time_limit=time_limit))
    if method == "daqp-hard":
        return DaqpHard(time_limit)
    if method.startswith("daqp-hierarchical"):
        return DaqpHierarchical(time_limit, weighs=method == "daqp-hierarchical")
    strategy, _, backend = method.partition("/")
    return StrategyContestant(make_solver(strategy, backend or None, time_limit=time_limit))


def _missing(method: str) -> MissingExtraError | None:
    """The error that a method which is not installed would raise."""
    _, _, backend = method.partition("/")
    if backend not in ACCURACY:
        return None
    try:
        make_solver("cascade", backend)
    except MissingExtraError as reason:
        return reason
    return None
