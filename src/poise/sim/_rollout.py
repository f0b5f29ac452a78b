"""`rollout`: the loop between a plant and a controller, and protocols of its parts."""

import gc
import math
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol, TypeVar, runtime_checkable

from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.stack import Leader


@runtime_checkable
class Body(Protocol):
    """A controlled robot: a `Plant`, another simulation, or the link to a robot."""

    @property
    def control_dt(self) -> float:
        """Control period [s]."""
        ...

    @property
    def time(self) -> float:
        """Its clock [s]."""
        ...

    @property
    def fallen(self) -> bool:
        """True after a fall, or a diverged simulation."""
        ...

    def state(self) -> RobotState:
        """Return the measured state."""
        ...

    def true_state(self) -> RobotState:
        """Return the true state; on hardware, where it is unknown, the measured one."""
        ...

    def step(self, command: Command) -> None:
        """Advance one control period under a command."""


@runtime_checkable
class AnyController(Protocol):
    """A controller; it never raises on numbers."""

    def step(self, state: RobotState) -> Command:
        """Return the command for a state."""
        ...


@runtime_checkable
class Estimator(Protocol):
    """Estimates the state that leader and controller are given from the measured one."""

    def update(self, state: RobotState) -> RobotState:
        """Take a measured state in, once a tick; return the estimated one."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tick:
    """One control period: the measured state, the command, and the true state at its end."""

    index: int  # number of ticks of the rollout before
    time: float  # the body's clock when the tick began [s]
    state: RobotState  # as measured then
    estimate: RobotState  # as leader and controller get it; `state` itself without an estimator
    command: Command  # of the controller
    truth: RobotState  # at the end of the period, with the wrenches at the soles
    estimator_seconds: float  # wall-clock time of the estimator, zero without one [s]
    leader_seconds: float  # of the leader [s]
    controller_seconds: float  # of the controller [s]


B = TypeVar("B", bound=Body)
B_contra = TypeVar("B_contra", bound=Body, contravariant=True)

LeadFunction = Callable[[RobotState], object]  # a leader: gets the estimate, sets a stack
EstimateFunction = Callable[[RobotState], RobotState]  # from the measured state to the estimated


@runtime_checkable
class Observer(Protocol[B_contra]):
    """Observe a run, such as by a record, a log or a viewer, without changing it."""

    def begin(
        self, plant: B_contra, controller: AnyController, leader: Leader | LeadFunction | None
    ) -> None:
        """Before the first tick."""

    def observe(self, tick: Tick) -> None:
        """After each tick, before it is yielded."""

    def end(self) -> None:
        """Once after the last tick, however the rollout ended."""


def check_period(leader: object, dt: float) -> None:
    """Refuse a leader that has to be called at another period than `dt` [s]: its own `dt`."""
    period = getattr(leader, "dt", dt)
    if isinstance(leader, Leader) and not math.isclose(period, dt, rel_tol=1e-6):
        raise ConfigurationError(
            f"{type(leader).__name__} and plant have different control periods",
            got=f"{period:g} s and {dt:g} s",
            wanted="the same",
        )


@contextmanager
def garbage_frozen() -> Generator[None]:
    """Keep Python's search for garbage short inside a loop: it looks at objects of the loop."""
    # One of all objects of robots, solvers and packages stops the loop for a tenth of a second.
    gc.collect()
    ours = gc.get_freeze_count() == 0  # Objects that were frozen earlier stay so.
    gc.freeze()
    try:
        yield
    finally:
        if ours:
            gc.unfreeze()


def rollout(
    plant: B,
    controller: AnyController,
    leader: Leader | LeadFunction | None = None,
    observers: Sequence[Observer[B]] = (),
    *,
    estimator: Estimator | EstimateFunction | None = None,
    duration: float | None = None,
) -> Generator[Tick]:
    """Run a plant under a controller, one tick an iteration.

    A tick is: measure, estimate, lead, control, step the plant, call the observers. Nothing
    happens between two iterations, so the caller sets the pace, and may push the robot or set
    targets there. The rollout ends after `duration`, when the plant has fallen, or when the
    caller stops. Whatever ends it, an error included, every observer that began is ended, the
    last one first. Until then Python's garbage is frozen (`gc.freeze`).

    Args:
        plant: what is controlled; it goes on from where it is.
        controller: gives the commands.
        leader: sets the targets of the controller's stack; a `Leader` or a function of the state.
        observers: called before the first tick, after each, and after the last.
        estimator: makes the state for leader and controller of the measured one; an object with
            `update`, or a function. One with `command` is called with each commanded acceleration
            (None without one) and the time of its tick [s].
        duration: how long [s], to the nearest tick; without end when None.

    Yields:
        Every tick.

    Raises:
        ConfigurationError: the duration is no length of time, or the plant has another control
            period than the leader was made for.
    """
    if duration is not None and not duration >= 0.0:
        raise ConfigurationError("wrong duration of a rollout", got=duration, wanted=">= 0 s")
    check_period(leader, plant.control_dt)
    lead = leader.lead if isinstance(leader, Leader) else leader
    estimate = estimator if estimator is None or callable(estimator) else estimator.update
    tell = getattr(estimator, "command", None)
    count = math.inf if duration is None else duration / plant.control_dt - 0.5

    # A generator of its own, so that what is wrong is raised by the call of `rollout`.
    def ticks() -> Generator[Tick]:
        index = 0
        with ExitStack() as watched:
            for observer in observers:
                observer.begin(plant, controller, leader)
                watched.callback(observer.end)
            watched.enter_context(garbage_frozen())
            while index < count and not plant.fallen:
                time = plant.time
                measured = plant.state()
                asked = perf_counter()
                state = measured if estimate is None else estimate(measured)
                begin = perf_counter()
                if lead is not None:
                    lead(state)
                led = perf_counter()
                command = controller.step(state)
                controlled = perf_counter()
                plant.step(command)
                if tell is not None:
                    tell(command.acceleration, time)
                tick = Tick(
                    index=index,
                    time=time,
                    state=measured,
                    estimate=state,
                    command=command,
                    truth=plant.true_state(),
                    estimator_seconds=0.0 if estimate is None else begin - asked,
                    leader_seconds=led - begin,
                    controller_seconds=controlled - led,
                )
                for observer in observers:
                    observer.observe(tick)
                yield tick
                index += 1

    return ticks()
