"""`RunView`: everything that the report of one run is made from; NaN stands for "not measured"."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64

from poise.apps.report._replay import Replay, check_shapes
from poise.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class Check:
    """One thing the scenario demanded of the run, and whether it held."""

    name: str  # what was checked, in words
    metric: str = ""  # a key of `METRICS`, or "fell", "ended_early" or "missed_ticks"
    value: float | int  # what was measured, in `unit`; NaN where it could not be
    bound: float | int  # what it was compared with, in `unit`
    relation: Literal["<=", ">=", "=="] = "<="  # how a value that holds stands to the bound
    unit: str = ""  # "" for a pure number
    ok: bool  # a value that could not be measured does not hold
    time: float | None = None  # of the worst moment [s]; None where no single one decided
    mechanism: str = ""  # what went wrong shortly before; "" where nothing is known


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happened at one time: a push, a new target, a foot released."""

    time: float | int  # [s]
    label: str  # in a few words
    duration: float | int = 0.0  # [s], zero for an instant

    def __post_init__(self) -> None:
        if not np.isfinite(self.time):
            raise ConfigurationError(
                f"the time of event {self.label!r} is not a number",
                got=self.time,
                wanted="a finite time [s]",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskTrack:
    """Distance of one task from its target over the run."""

    name: str
    level: int  # priority, 0 is the highest
    unit: str  # of the error, such as "m" or "rad"
    error: Float64[np.ndarray, " T"]  # norm of the error in `unit`, NaN while not active


@dataclass(frozen=True, kw_only=True, eq=False)
class SoleTrack:
    """Load of one sole over the run."""

    name: str
    normal_force: Float64[np.ndarray, " T"]  # of the ground along the sole's normal [N]
    planned: Bool[np.ndarray, " T"]  # whether the controller counted on this contact


@dataclass(frozen=True, kw_only=True, eq=False)
class SupportPhase:
    """The support polygon of one interval of time, constant for start <= t < end."""

    start: float  # [s]
    end: float  # [s]
    # corners of the convex polygon in the world, in order around it [m]; none in flight
    vertices: Float64[np.ndarray, "k 2"]
    label: str = ""  # the soles that stand, or "flight"


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseErrors:
    """Errors of the estimate of the base, a figure a tick."""

    # level distance of the position from the true one [m]: dead reckoning, it grows with the way
    drift: Float64[np.ndarray, " T"] = field(repr=False)
    tilt: Float64[np.ndarray, " T"] = field(repr=False)  # between the two verticals [rad]
    speed: Float64[np.ndarray, " T"] = field(repr=False)  # of the velocity, in the base [m/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class RunView:
    """Course of one run; arrays have a row a control tick (T ticks, nj joints)."""

    robot: str
    controller: str
    scenario: str
    description: str = ""  # what the scenario is about, in a sentence or two
    seed: int = 0
    fell: bool = False
    ended_early: str = ""  # why the run stopped before its end
    time: Float64[np.ndarray, " T"] = field(repr=False)  # of each tick, increasing [s]
    joint_names: tuple[str, ...] = field(repr=False)
    torque: Float64[np.ndarray, "T nj"] = field(repr=False)  # [N m]
    torque_max: Float64[np.ndarray, " nj"] = field(repr=False)  # [N m]
    position: Float64[np.ndarray, "T nj"] = field(repr=False)  # [rad]
    position_min: Float64[np.ndarray, " nj"] = field(repr=False)  # [rad]
    position_max: Float64[np.ndarray, " nj"] = field(repr=False)  # [rad]
    tasks: tuple[TaskTrack, ...] = field(default=(), repr=False)
    com: Float64[np.ndarray, "T 3"] = field(repr=False)  # in the world [m]
    com_reference: Float64[np.ndarray, "T 3"] = field(repr=False)  # [m]
    zmp: Float64[np.ndarray, "T 2"] = field(repr=False)  # on the ground [m], NaN in flight
    zmp_reference: Float64[np.ndarray, "T 2"] | None = field(default=None, repr=False)  # [m]
    support: tuple[SupportPhase, ...] = field(default=(), repr=False)  # in order of time
    soles: tuple[SoleTrack, ...] = field(default=(), repr=False)
    # None where the robot knows the truth
    base_errors: BaseErrors | None = field(default=None, repr=False)
    # mass beyond the description's [kg], and offset of the centre of mass of all but what hands
    # hold along the torso's axes [m], as estimated; None where nobody does
    payload: Float64[np.ndarray, "T 4"] | None = field(default=None, repr=False)
    # what each level could not meet, relative to the level's scale [-]
    residuals: Float64[np.ndarray, "T nl"] = field(repr=False)
    level_names: tuple[str, ...] = ()  # empty to call them by their number
    status: tuple[str, ...] = field(repr=False)  # of each command, as `CommandStatus.value`
    # time each tick took, by phase, in the order of the phases [us]
    tick_us: Mapping[str, Float64[np.ndarray, " T"]] = field(repr=False)
    tick_budget_us: float | None = None  # time between two ticks [us]
    events: tuple[Event, ...] = field(default=(), repr=False)
    checks: tuple[Check, ...] = field(default=(), repr=False)
    summary: Mapping[str, object] = field(default_factory=dict, repr=False)  # `summary.json`
    replay: Replay | None = field(default=None, repr=False)  # None to leave it out
    # name of the file beside the page; a picture of the same name, with `.jpg` behind, is shown
    # until it is played
    video: str | None = None
    notes: tuple[str, ...] = ()  # for the reader, such as why there is no video

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or len(self.time) == 0:
            raise ConfigurationError(
                "a record without a tick", got=self.time.shape, wanted="one time or more [s]"
            )
        if not np.isfinite(self.time).all() or (np.diff(self.time) <= 0.0).any():
            raise ConfigurationError(
                "the times of a record do not increase", wanted="finite, increasing times [s]"
            )
        sizes = {"T": len(self.time), "nj": len(self.joint_names)}
        check_shapes(self, "record", sizes)
        for track in (*self.tasks, *self.soles):
            check_shapes(track, repr(track.name), sizes)
        if self.base_errors is not None:
            check_shapes(self.base_errors, "base's estimate", sizes)
        lengths = {"status": (len(self.status), len(self.time))}
        if self.level_names:
            lengths["level_names"] = (len(self.level_names), sizes["nl"])
        for phase, values in self.tick_us.items():
            lengths[f"tick times of phase {phase!r}"] = (len(values), len(self.time))
        for name, (got, wanted) in lengths.items():
            if got != wanted:
                raise ConfigurationError(f"wrong length of {name}", got=got, wanted=str(wanted))
