"""`rollout`: the loop between a plant and a controller, and what belongs to one pass of it.

`garbage_frozen`: what keeps Python's search for garbage short inside any loop.
`Tick`: what happened in one control period.
`Body`, `AnyController`, `Estimator`, `Observer`: what the loop needs of those who take part.
"""

import gc
import math
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.stack import Leader


@runtime_checkable
class Body(Protocol):
    """What is controlled: a `Plant`, a plant of one's own, or the link to a robot."""

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
        """Whether there is nothing left to control: it fell, or a simulation diverged."""
        ...

    def state(self) -> RobotState:
        """What the sensors say."""
        ...

    def true_state(self) -> RobotState:
        """What is; on hardware, where nobody knows, what the sensors say."""
        ...

    def step(self, command: Command) -> None:
        """Lets one control period pass under a command."""
        ...


@runtime_checkable
class AnyController(Protocol):
    """What a rollout needs of a controller; one that never raises on numbers."""

    def step(self, state: RobotState) -> Command:
        """The command for a state."""
        ...


@runtime_checkable
class Estimator(Protocol):
    """Makes of what the sensors say what leader and controller are given."""

    def update(self, state: RobotState) -> RobotState:
        """Takes a measured state in, once a tick; returns the estimated one."""
        ...


@runtime_checkable
class CommandedEstimator(Estimator, Protocol):
    """One that has to know what the robot is commanded, as who makes up for late sensors does."""

    def command(self, acceleration: Float64[np.ndarray, " nv"] | None, time: float) -> None:
        """Takes in what the robot was commanded, once a tick."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tick:
    """One control period: what was measured, what was commanded, what then was.

    Attributes:
        index: how many ticks of the rollout came before.
        time: the body's clock when the tick began [s].
        state: as measured then.
        estimate: what leader and controller were given; `state` itself without an estimator.
        command: what the controller answered.
        truth: the true state at the end of the period, with the wrenches at the soles.
        estimator_seconds: wall-clock time that the estimator took, zero without one [s].
        leader_seconds: and the leader [s].
        controller_seconds: and the controller [s].
    """

    index: int
    time: float
    state: RobotState
    estimate: RobotState
    command: Command
    truth: RobotState
    estimator_seconds: float
    leader_seconds: float
    controller_seconds: float


B = TypeVar("B", bound=Body)
B_contra = TypeVar("B_contra", bound=Body, contravariant=True)

LeadFunction = Callable[[RobotState], object]
"""A leader as a function: gets the estimate, sets a stack; what it returns is passed over."""

EstimateFunction = Callable[[RobotState], RobotState]
"""An estimator as a function: from the measured state to the estimated one."""


@runtime_checkable
class Observer(Protocol[B_contra]):
    """Looks on: records, logs, shows, films, counts. It changes nothing that takes part."""

    def begin(
        self, plant: B_contra, controller: AnyController, leader: Leader | LeadFunction | None
    ) -> None:
        """Before the first tick."""
        ...

    def observe(self, tick: Tick) -> None:
        """After each tick, before the one who iterates gets it."""
        ...

    def end(self) -> None:
        """Once after the last tick, however the rollout ended."""
        ...


@runtime_checkable
class PeriodicLeader(Leader, Protocol):
    """A leader that has to be asked at a period of its own."""

    @property
    def dt(self) -> float:
        """That period [s]."""
        ...


_SAME_PERIOD = 1e-9
"""Periods that differ by less are the same [s]."""


def check_period(leader: object, dt: float) -> None:
    """Refuses a leader that has to be asked at another period than it will be."""
    if isinstance(leader, PeriodicLeader) and abs(leader.dt - dt) > _SAME_PERIOD:
        raise ConfigurationError(
            f"{type(leader).__name__} and plant have different control periods",
            got=f"{leader.dt:g} s and {dt:g} s",
            wanted="the same",
        )


@contextmanager
def garbage_frozen() -> Generator[None]:
    """Keeps Python's search for garbage short inside a loop.

    Everything made so far, some hundred thousand objects of robots, solvers and packages, is set
    aside (`gc.freeze`): a full collection, which otherwise stops the loop for a tenth of a second,
    then looks at what the loop has made, and takes a fraction of a millisecond.

    What is garbage already when it begins is collected first. At the end everything is as before,
    unless somebody else had frozen objects earlier: then these stay so, with those made since.
    """
    gc.collect()
    ours = gc.get_freeze_count() == 0
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
    """Runs a plant under a controller, one tick an iteration.

    A tick is: measure, estimate, lead, control, step the plant, tell the observers. Nothing
    happens between two iterations, so whoever iterates sets the pace, and may push the robot or
    set targets there. The rollout ends after `duration`, when the plant has fallen, or when nobody
    asks for a further tick. Whatever ends it, an error included, every observer that began is
    ended, the last one first. Until then Python's garbage is frozen, see `garbage_frozen`.

    Args:
        plant: what is controlled; it goes on from where it is.
        controller: gives the commands.
        leader: sets what the controller's stack asks for; nobody does when None. A function of the
            state does for `lead`.
        observers: look on.
        estimator: between the sensors and those who get a state; none when None. A function from
            state to state does for `update`. One with `command` is told what was commanded.
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
    # A generator would say so at the first tick only, far from the line that is wrong.
    return _ticks(plant, controller, leader, observers, estimator, duration)


def _ticks(
    plant: B,
    controller: AnyController,
    leader: Leader | LeadFunction | None,
    observers: Sequence[Observer[B]],
    estimator: Estimator | EstimateFunction | None,
    duration: float | None,
) -> Generator[Tick]:
    lead = leader.lead if isinstance(leader, Leader) else leader
    estimate = estimator if estimator is None or callable(estimator) else estimator.update
    tell = estimator.command if isinstance(estimator, CommandedEstimator) else None
    ticks = math.inf if duration is None else duration / plant.control_dt - 0.5
    count = ticks if math.isinf(ticks) else math.ceil(ticks)
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
