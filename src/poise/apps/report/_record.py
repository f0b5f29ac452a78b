"""`RunView`: everything that the report of one run is made from.

What a run's record is made of: checks, events, and the tracks of tasks, soles and support.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64

from poise.apps.report._replay import Replay
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
        time: of the worst moment [s], None where no single one decided.
        mechanism: what went wrong shortly before, in words; "" where nothing is known.
    """

    name: str
    value: float | int
    bound: float | int
    relation: Literal["<=", ">=", "=="] = "<="
    unit: str = ""
    ok: bool
    time: float | None = None
    mechanism: str = ""


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


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseErrors:
    """How far the estimate of the base is off, a figure a tick.

    Attributes:
        drift: level distance of the estimated position from the true one [m]. Absolute position
            and yaw are dead reckoning, so it grows with the way.
        tilt: angle between the estimated vertical and the true one [rad].
        speed: of the estimated velocity against the true one, in the base [m/s].
    """

    drift: Float64[np.ndarray, " T"] = field(repr=False)
    tilt: Float64[np.ndarray, " T"] = field(repr=False)
    speed: Float64[np.ndarray, " T"] = field(repr=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class RunView:
    """What happened in one run: names, and arrays with one row a control tick (T ticks, nj joints).

    NaN stands for "not measured" or "nothing to measure" everywhere.

    Attributes:
        robot: the robot's name.
        controller: the controller's name.
        scenario: the scenario's name.
        description: what the scenario is about, in a sentence or two.
        seed: seed of everything random in the run.
        fell: whether the robot fell.
        ended_early: why the run stopped before its end, "" where it did not.
        time: time of each tick, increasing [s].
        joint_names: the actuated joints.
        joint_groups: group of each joint for the torque plot, such as "left leg"; empty to have
            the groups guessed from the names.
        torque: joint torques [N m].
        torque_max: joint torque limits [N m].
        position: joint positions [rad].
        position_min: lower joint position limits [rad].
        position_max: upper joint position limits [rad].
        tasks: the tasks and their errors.
        com: centre of mass in the world [m].
        com_reference: where it should be [m].
        zmp: zero moment point on the ground [m], NaN in flight.
        zmp_reference: where it should be, None where nothing asks [m].
        support: support polygons, in order of time.
        soles: the soles and what they carried.
        base_errors: how far off the robot's own estimate of its base is; None where it is told the
            truth.
        payload: mass beyond the description's [kg], and offset of the centre of mass of all but
            what hands hold along the torso's axes [m], as estimated; None where nobody does.
        residuals: what each level could not meet, relative to the level's scale [-].
        level_names: names of the levels, empty to call them by their number.
        status: how each command came about, as `CommandStatus.value`.
        tick_us: time each tick took, by phase, in the order of the phases [us]; a phase called
            "total" is drawn as the whole, without it the sum of the phases is.
        tick_budget_us: time between two ticks [us], None where there is no such bound.
        events: pushes, targets, contact changes.
        checks: what the scenario demanded.
        summary: the figures of `summary.json`.
        replay: the motion for the 3D replay, None to leave it out.
        video: file name of the video, relative to the report; None where there is none. A picture
            of the same name, with `.jpg` behind, is shown until it is played.
        notes: sentences for the reader, such as why there is no video.
    """

    robot: str
    controller: str
    scenario: str
    description: str = ""
    seed: int = 0
    fell: bool = False
    ended_early: str = ""
    time: Float64[np.ndarray, " T"] = field(repr=False)
    joint_names: tuple[str, ...] = field(repr=False)
    joint_groups: tuple[str, ...] = field(default=(), repr=False)
    torque: Float64[np.ndarray, "T nj"] = field(repr=False)
    torque_max: Float64[np.ndarray, " nj"] = field(repr=False)
    position: Float64[np.ndarray, "T nj"] = field(repr=False)
    position_min: Float64[np.ndarray, " nj"] = field(repr=False)
    position_max: Float64[np.ndarray, " nj"] = field(repr=False)
    tasks: tuple[TaskTrack, ...] = field(default=(), repr=False)
    com: Float64[np.ndarray, "T 3"] = field(repr=False)
    com_reference: Float64[np.ndarray, "T 3"] = field(repr=False)
    zmp: Float64[np.ndarray, "T 2"] = field(repr=False)
    zmp_reference: Float64[np.ndarray, "T 2"] | None = field(default=None, repr=False)
    support: tuple[SupportPhase, ...] = field(default=(), repr=False)
    soles: tuple[SoleTrack, ...] = field(default=(), repr=False)
    base_errors: BaseErrors | None = field(default=None, repr=False)
    payload: Float64[np.ndarray, "T 4"] | None = field(default=None, repr=False)
    residuals: Float64[np.ndarray, "T nl"] = field(repr=False)
    level_names: tuple[str, ...] = ()
    status: tuple[str, ...] = field(repr=False)
    tick_us: Mapping[str, Float64[np.ndarray, " T"]] = field(repr=False)
    tick_budget_us: float | None = None
    events: tuple[Event, ...] = field(default=(), repr=False)
    checks: tuple[Check, ...] = field(default=(), repr=False)
    summary: Mapping[str, object] = field(default_factory=dict, repr=False)
    replay: Replay | None = field(default=None, repr=False)
    video: str | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or len(self.time) == 0:
            raise ConfigurationError(
                "a record without a tick", got=self.time.shape, wanted="one time or more [s]"
            )
        if not np.isfinite(self.time).all() or (np.diff(self.time) <= 0.0).any():
            raise ConfigurationError(
                "the times of a record do not increase", wanted="finite, increasing times [s]"
            )
        for name, (got, due) in self._shapes().items():
            if got != due:
                raise ConfigurationError(
                    f"wrong shape of the record's {name}", got=got, wanted=str(due)
                )

    def _shapes(self) -> dict[str, tuple[tuple[int, ...], tuple[int, ...]]]:
        """Shape of every array, beside the shape it should have."""
        T, nj = len(self.time), len(self.joint_names)
        levels = self.residuals.shape[-1] if self.residuals.ndim else 0
        shapes = {
            "torque": (self.torque.shape, (T, nj)),
            "torque_max": (self.torque_max.shape, (nj,)),
            "position": (self.position.shape, (T, nj)),
            "position_min": (self.position_min.shape, (nj,)),
            "position_max": (self.position_max.shape, (nj,)),
            "com": (self.com.shape, (T, 3)),
            "com_reference": (self.com_reference.shape, (T, 3)),
            "zmp": (self.zmp.shape, (T, 2)),
            "residuals": (self.residuals.shape, (T, levels)),
            "status": ((len(self.status),), (T,)),
        }
        if self.zmp_reference is not None:
            shapes["zmp_reference"] = (self.zmp_reference.shape, (T, 2))
        if self.joint_groups:
            shapes["joint_groups"] = ((len(self.joint_groups),), (nj,))
        if self.level_names:
            shapes["level_names"] = ((len(self.level_names),), (levels,))
        for task in self.tasks:
            shapes[f"error of task {task.name!r}"] = (task.error.shape, (T,))
            if task.components is not None:
                k = task.components.shape[-1]
                shapes[f"components of task {task.name!r}"] = (task.components.shape, (T, k))
        if self.payload is not None:
            shapes["payload"] = (self.payload.shape, (T, 4))
        if self.base_errors is not None:
            for what, values in vars(self.base_errors).items():
                shapes[f"{what} of the base's estimate"] = (values.shape, (T,))
        for sole in self.soles:
            shapes[f"normal force of {sole.name!r}"] = (sole.normal_force.shape, (T,))
            shapes[f"planned contact of {sole.name!r}"] = (sole.planned.shape, (T,))
        for phase, values in self.tick_us.items():
            shapes[f"tick times of phase {phase!r}"] = (values.shape, (T,))
        return shapes
