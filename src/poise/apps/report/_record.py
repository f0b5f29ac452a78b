"""`RunSignals`: the record of a run as arrays with one row a tick, judged and shown by a page."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64, Int

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


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskTrack:
    """Distance of one task from its target over the run."""

    name: str
    level: int  # priority, 0 is the highest
    unit: str  # of the error, such as "m" or "rad"
    error: Float64[np.ndarray, " T"]  # norm of the error in `unit`, NaN while not active


@dataclass(frozen=True, kw_only=True, eq=False)
class SoleTrack:
    """Place and load of one sole over the run."""

    position: Float64[np.ndarray, "T 3"]  # of the centre [m]
    height: Float64[np.ndarray, " T"]  # of the centre over floor or block [m]
    wrench: Float64[np.ndarray, "T 6"]  # measured, in the sole's frame [N, N m]
    planned: Float64[np.ndarray, " T"]  # 1 where the controller counted on it

    @property
    def force(self) -> Float64[np.ndarray, " T"]:
        """Normal force [N]."""
        return self.wrench[:, 2]


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
class Geometry:
    """A shape fixed to a body."""

    body: int  # its index
    shape: Literal["box", "sphere", "ellipsoid", "cylinder", "capsule", "mesh"]
    # half lengths along x, y, z for a box; radius for a sphere; radii along x, y, z for an
    # ellipsoid; radius and half length (of the straight part) along z for cylinder and capsule [m]
    size: tuple[float | int, ...] = ()
    position: Float64[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))  # [m]
    # orientation of the shape in its body (x, y, z, w)
    quaternion: Float64[np.ndarray, "4"] = field(default_factory=lambda: np.eye(4)[3])
    rgba: tuple[float | int, float | int, float | int, float | int] = (0.7, 0.7, 0.72, 1.0)
    vertices: Float64[np.ndarray, "nvert 3"] | None = field(default=None, repr=False)  # [m]
    faces: Int[np.ndarray, "nface 3"] | None = field(default=None, repr=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceTrack:
    """A force on the robot, drawn as an arrow that starts (contact) or ends (push) at its point."""

    name: str
    kind: Literal["contact", "push"] = "contact"
    point: Float64[np.ndarray, "F 3"]  # in the world [m]
    force: Float64[np.ndarray, "F 3"]  # in the world [N]; zero or NaN where there is none


@dataclass(frozen=True, kw_only=True, eq=False)
class Replay:
    """Body poses over time, about 30 frames a second, and the shapes of the bodies."""

    time: Float64[np.ndarray, " F"]  # [s]
    position: Float64[np.ndarray, "F B 3"]  # of each body's origin in the world [m]
    quaternion: Float64[np.ndarray, "F B 4"]  # of each body in the world (x, y, z, w)
    geometries: tuple[Geometry, ...]
    forces: tuple[ForceTrack, ...] = ()
    # Points shown as small balls, such as a hand's target, in the world [m]
    markers: Mapping[str, Float64[np.ndarray, "F 3"]] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RunSignals:
    """Course of one run of T ticks with nj joints; NaN where a signal was not recorded.

    References and targets, which the robot follows by its estimate, are shifted to where they lie
    for the true robot as they do for the estimated one.
    """

    robot: str
    controller: str
    scenario: str
    description: str = ""  # what the scenario is about, in a sentence or two
    seed: int = 0
    fell: bool = False
    ended_early: str = ""  # why the run stopped before its end
    time: Float64[np.ndarray, " T"]  # of each tick, increasing [s]
    joint_names: tuple[str, ...]
    q: Float64[np.ndarray, "T nq"]  # true configuration [m, rad]
    torque: Float64[np.ndarray, "T nj"]  # [N m]
    torque_max: Float64[np.ndarray, " nj"]  # [N m]
    position_min: Float64[np.ndarray, " nj"]  # [rad]
    position_max: Float64[np.ndarray, " nj"]  # [rad]
    tasks: tuple[TaskTrack, ...] = ()
    com: Float64[np.ndarray, "T 3"]  # in the world [m]
    com_reference: Float64[np.ndarray, "T 3"]  # [m]
    zmp: Float64[np.ndarray, "T 2"]  # on the ground [m], NaN in flight
    zmp_reference: Float64[np.ndarray, "T 2"]  # [m]
    zmp_margin: Float64[np.ndarray, " T"]  # from the support polygon's edge, negative outside [m]
    support: tuple[SupportPhase, ...] = ()  # in order of time
    soles: Mapping[str, SoleTrack] = field(default_factory=dict[str, SoleTrack])
    targets: Mapping[str, Float64[np.ndarray, "T 3"]]  # of the points that tasks move [m]
    clearance: Float64[np.ndarray, " T"]  # distance of the robot from the nearest block [m]
    self_contact: Float64[np.ndarray, " T"]  # force of links on each other [N]
    beyond: Float64[np.ndarray, " T"]  # hindmost heel ahead of the last block [m]
    modes: tuple[tuple[float, str], ...]  # mode walked by hand or status of a walk, from a time [s]
    base_errors: BaseErrors | None = None  # None where the controller has the true state
    # mass beyond the description's [kg], and offset of the centre of mass of all but what hands
    # hold along the torso's axes [m], as estimated; None without an estimate
    payload: Float64[np.ndarray, "T 4"] | None = None
    residuals: Float64[np.ndarray, "T nl"]  # of each level, relative to the level's scale [-]
    level_names: tuple[str, ...]
    status: tuple[str, ...]  # of each command, as `CommandStatus.value`
    # time each tick took, by phase, in the order of the phases [us]
    tick_us: Mapping[str, Float64[np.ndarray, " T"]]
    tick_budget_us: float  # time between two ticks [us]
    events: tuple[Event, ...] = ()
    checks: tuple[Check, ...] = ()
    summary: Mapping[str, object] = field(default_factory=dict[str, object])  # `summary.json`
    replay: Replay | None = None  # None to leave it out
    # name of the file beside the page; a picture of the same name, with `.jpg` behind, is shown
    # until it is played
    video: str | None = None
    notes: tuple[str, ...] = ()  # for the reader, such as why there is no video

    def __post_init__(self) -> None:
        if len(self.time) == 0:
            raise ConfigurationError("a record without a tick", got=0, wanted="one tick or more")

    @property
    def position(self) -> Float64[np.ndarray, "T nj"]:
        """Joint positions [rad]."""
        return self.q[:, self.q.shape[1] - len(self.joint_names) :]

    @property
    def total_tick(self) -> Float64[np.ndarray, " T"]:
        """Time of the whole tick [us], the sum of its phases."""
        return np.sum([*self.tick_us.values()], axis=0)
