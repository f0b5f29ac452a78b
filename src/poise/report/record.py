"""`RunRecord`: everything that the report of one run is made from."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from poise.errors import ConfigurationError
from poise.report.replay import Replay
from poise.report.tracks import Check, Event, SoleTrack, SupportPhase, TaskTrack


@dataclass(frozen=True, kw_only=True, eq=False)
class RunRecord:
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
        video: file name of the video, relative to the report; None where there is none.
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
        for name, (got, wanted) in self._shapes().items():
            if got != wanted:
                raise ConfigurationError(
                    f"wrong shape of the record's {name}", got=got, wanted=str(wanted)
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
        for sole in self.soles:
            shapes[f"normal force of {sole.name!r}"] = (sole.normal_force.shape, (T,))
            shapes[f"planned contact of {sole.name!r}"] = (sole.planned.shape, (T,))
        for phase, values in self.tick_us.items():
            shapes[f"tick times of phase {phase!r}"] = (values.shape, (T,))
        return shapes
