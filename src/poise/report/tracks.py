"""What a run's record is made of: checks, events, and the tracks of tasks, soles and support."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64

from poise.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class Check:
    """One thing the scenario demanded of the run, and whether it held.

    Attributes:
        name: what was checked, in words.
        value: what was measured, in `unit`; NaN where it could not be measured.
        bound: what it was compared with, in `unit`.
        relation: how a value that holds stands to the bound.
        unit: the unit of value and bound, "" for a pure number.
        ok: whether the check held.
    """

    name: str
    value: float | int
    bound: float | int
    relation: Literal["<=", ">=", "=="] = "<="
    unit: str = ""
    ok: bool


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happened at one time: a push, a new target, a foot released.

    Attributes:
        time: when [s].
        label: what, in a few words.
        duration: how long it lasted [s], zero for an instant.
    """

    time: float | int
    label: str
    duration: float | int = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite(self.time):
            raise ConfigurationError(
                f"the time of event {self.label!r} is not a number",
                got=self.time,
                wanted="a finite time [s]",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskTrack:
    """How far one task was from its target over the run.

    Attributes:
        name: the task's name; every plot draws one task in one colour.
        level: priority, 0 is the highest.
        unit: unit of the error, such as "m" or "rad".
        error: norm of the error in `unit`, NaN while the task was not active.
        components: the error itself in `unit`, None where only the norm was kept.
        component_names: names of the columns of `components`, such as ("x", "y", "z").
    """

    name: str
    level: int
    unit: str
    error: Float64[np.ndarray, " T"]
    components: Float64[np.ndarray, "T k"] | None = None
    component_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.components is None:
            return
        columns = self.components.shape[1]
        if len(self.component_names) not in (0, columns):
            raise ConfigurationError(
                f"component names of task {self.name!r} do not fit its components",
                got=self.component_names,
                wanted=f"{columns} names, or none",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class SoleTrack:
    """What one sole carried over the run.

    Attributes:
        name: the sole's name.
        normal_force: force of the ground along the sole's normal [N].
        planned: whether the controller counted on this contact at the time.
    """

    name: str
    normal_force: Float64[np.ndarray, " T"]
    planned: Bool[np.ndarray, " T"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SupportPhase:
    """The support polygon of one interval of time, constant within it.

    Attributes:
        start: beginning of the interval [s].
        end: end of the interval [s]; the polygon holds for start <= t < end.
        vertices: corners of the convex polygon in the world, in order around it [m]; no rows
            while nothing touches the ground.
        label: the phase in words, such as "left sole"; "" to leave it out.
    """

    start: float
    end: float
    vertices: Float64[np.ndarray, "k 2"]
    label: str = ""
