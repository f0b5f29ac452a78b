"""What can be measured on a run: each metric is a function of the recorded signals."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64

from poise.apps.report import BaseErrors
from poise.apps.scenarios._signals import RunSignals


class Reading(NamedTuple):
    """What was measured.

    Attributes:
        value: the figure, NaN where there was nothing to measure.
        row: the tick that decided it; None where no single one did.
    """

    value: float
    row: int | None


NOTHING = Reading(float("nan"), None)

Measure = Callable[[RunSignals, str, int | None, Bool[np.ndarray, " T"]], Reading]
"""From signals, subject, axis and the ticks that count to a figure."""

Track = Callable[[RunSignals, str, int | None], Float64[np.ndarray, " T"]]
"""From signals, subject and axis to a figure a tick, NaN where there is none."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A figure of a run.

    Attributes:
        name: what scenario files call it.
        unit: its unit; "" for a number, and for a task's error the task's own.
        subject: what it is measured on: "", "task", "sole" or "level".
        takes_axis: whether an axis is given with it.
        describe: one line for people.
        measure: how.
    """

    name: str
    unit: str
    subject: str
    takes_axis: bool
    describe: str
    measure: Measure


def _largest(track: Track) -> Measure:
    """The largest figure of all ticks."""

    def measure(
        run: RunSignals, subject: str, axis: int | None, rows: Bool[np.ndarray, " T"]
    ) -> Reading:
        values = np.where(rows, track(run, subject, axis), np.nan)
        if not np.isfinite(values).any():
            return NOTHING
        row = int(np.nanargmax(np.where(np.isfinite(values), values, np.nan)))
        return Reading(float(values[row]), row)

    return measure


def _least(track: Track) -> Measure:
    """The least figure of all ticks."""
    most = _largest(lambda run, subject, axis: -track(run, subject, axis))

    def measure(
        run: RunSignals, subject: str, axis: int | None, rows: Bool[np.ndarray, " T"]
    ) -> Reading:
        reading = most(run, subject, axis, rows)
        return Reading(-reading.value, reading.row)

    return measure


def _last(track: Track) -> Measure:
    """The figure of the last tick."""

    def measure(
        run: RunSignals, subject: str, axis: int | None, rows: Bool[np.ndarray, " T"]
    ) -> Reading:
        if not rows.any():
            return NOTHING
        row = int(np.flatnonzero(rows)[-1])
        return Reading(float(track(run, subject, axis)[row]), row)

    return measure


def _root_mean_square(track: Track) -> Measure:
    """The root mean square of all ticks."""

    def measure(
        run: RunSignals, subject: str, axis: int | None, rows: Bool[np.ndarray, " T"]
    ) -> Reading:
        values = track(run, subject, axis)[rows]
        finite = values[np.isfinite(values)]
        return Reading(float(np.sqrt(np.mean(finite**2))), None) if finite.size else NOTHING

    return measure


def _com_error(run: RunSignals, _: str, axis: int | None) -> Float64[np.ndarray, " T"]:
    error = run.com_reference - run.com
    return np.linalg.norm(error, axis=1) if axis is None else np.abs(error[:, axis])


def _com_travel(run: RunSignals, _: str, axis: int | None, rows: Bool[np.ndarray, " T"]) -> Reading:
    com = run.com[rows]
    if not len(com):
        return NOTHING
    reach = com.max(axis=0) - com.min(axis=0)
    return Reading(float(np.linalg.norm(reach) if axis is None else reach[axis]), None)


def _com_speed_end(
    run: RunSignals, _: str, __: int | None, rows: Bool[np.ndarray, " T"]
) -> Reading:
    com, time = run.com[rows], run.time[rows]
    if len(com) < 2:
        return NOTHING
    last = max(1, int(np.searchsorted(time[-1] - time[::-1], 0.1)))
    span = slice(max(0, len(com) - 1 - last), None)
    distance = np.linalg.norm(com[span][-1] - com[span][0])
    speed = float(distance / max(time[span][-1] - time[span][0], 1e-9))
    return Reading(speed, int(np.flatnonzero(rows)[-1]))


def _task_error(run: RunSignals, task: str, _: int | None) -> Float64[np.ndarray, " T"]:
    return run.task_errors[task]


def _torque_ratio(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    # The joint that is nearest to its limit; a tick without a torque has none.
    ratios = np.abs(run.torque) / run.torque_max
    return np.max(ratios, axis=1, initial=-np.inf, where=np.isfinite(ratios))


def _torque_step(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    # From the tick before; the first has none.
    steps = np.abs(np.diff(run.torque, axis=0, prepend=np.nan)) / run.torque_max
    return np.max(steps, axis=1, initial=-np.inf, where=np.isfinite(steps))


def _sole_force(run: RunSignals, sole: str, _: int | None) -> Float64[np.ndarray, " T"]:
    return run.sole_forces[sole]


def _sole_height(run: RunSignals, sole: str, _: int | None) -> Float64[np.ndarray, " T"]:
    return run.sole_heights[sole]


def _residual(run: RunSignals, level: str, _: int | None) -> Float64[np.ndarray, " T"]:
    return run.residuals[:, int(level) - 1]


def _zmp_margin(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    return run.zmp_margin


def _clearance(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    return run.clearance


def _self_contact(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    return run.self_contact


def _beyond_blocks(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    return run.beyond


def _zmp_error(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    return np.linalg.norm(run.zmp_reference - run.zmp, axis=1)


def _known(run: RunSignals) -> BaseErrors:
    """Errors of the base's estimate; none where the truth is told."""
    if run.base_errors is not None:
        return run.base_errors
    nothing = np.zeros(len(run.time))
    return BaseErrors(drift=nothing, tilt=nothing, speed=nothing)


def _drift(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    return _known(run).drift


def _tilt_error(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    return _known(run).tilt


def _velocity_error(run: RunSignals, _: str, __: int | None) -> Float64[np.ndarray, " T"]:
    return _known(run).speed


def _steps_made(run: RunSignals, _: str, __: int | None, rows: Bool[np.ndarray, " T"]) -> Reading:
    if not rows.any():
        return NOTHING
    standing = [planned[rows] > 0.5 for planned in run.sole_planned.values()]
    return Reading(float(sum(np.count_nonzero(on[1:] & ~on[:-1]) for on in standing)), None)


METRICS = {
    m.name: m
    for m in (
        Metric(
            name="com_error_max",
            unit="m",
            subject="",
            takes_axis=True,
            describe="largest distance of the COM from its reference",
            measure=_largest(_com_error),
        ),
        Metric(
            name="com_error_rms",
            unit="m",
            subject="",
            takes_axis=True,
            describe="root mean square distance of the COM from its reference",
            measure=_root_mean_square(_com_error),
        ),
        Metric(
            name="com_travel",
            unit="m",
            subject="",
            takes_axis=True,
            describe="how far the COM moved, from least to most",
            measure=_com_travel,
        ),
        Metric(
            name="com_speed_end",
            unit="m/s",
            subject="",
            takes_axis=False,
            describe="mean speed of the COM over the last 0.1 s",
            measure=_com_speed_end,
        ),
        Metric(
            name="task_error_max",
            unit="",
            subject="task",
            takes_axis=False,
            describe="largest error of a task",
            measure=_largest(_task_error),
        ),
        Metric(
            name="task_error_rms",
            unit="",
            subject="task",
            takes_axis=False,
            describe="root mean square error of a task",
            measure=_root_mean_square(_task_error),
        ),
        Metric(
            name="task_error_end",
            unit="",
            subject="task",
            takes_axis=False,
            describe="error of a task at the end of the window",
            measure=_last(_task_error),
        ),
        Metric(
            name="torque_ratio_max",
            unit="",
            subject="",
            takes_axis=False,
            describe="largest torque over its limit",
            measure=_largest(_torque_ratio),
        ),
        Metric(
            name="torque_step_max",
            unit="",
            subject="",
            takes_axis=False,
            describe="largest change of a torque from tick to tick over its limit",
            measure=_largest(_torque_step),
        ),
        Metric(
            name="sole_force_max",
            unit="N",
            subject="sole",
            takes_axis=False,
            describe="largest normal force of a sole",
            measure=_largest(_sole_force),
        ),
        Metric(
            name="sole_height_min",
            unit="m",
            subject="sole",
            takes_axis=False,
            describe="least height of a sole's centre above the floor or the block under it",
            measure=_least(_sole_height),
        ),
        Metric(
            name="residual_max",
            unit="",
            subject="level",
            takes_axis=False,
            describe="largest relative residual of a level, 1 is the physics",
            measure=_largest(_residual),
        ),
        Metric(
            name="zmp_margin_min",
            unit="m",
            subject="",
            takes_axis=False,
            describe="least distance of the ZMP from the edge of the support polygon",
            measure=_least(_zmp_margin),
        ),
        Metric(
            name="zmp_error_max",
            unit="m",
            subject="",
            takes_axis=False,
            describe="largest distance of the ZMP from its reference",
            measure=_largest(_zmp_error),
        ),
        Metric(
            name="steps_made",
            unit="",
            subject="",
            takes_axis=False,
            describe="how often a sole was put down and counted on",
            measure=_steps_made,
        ),
        Metric(
            name="clearance_min",
            unit="m",
            subject="",
            takes_axis=False,
            describe="least distance of the robot from a block, 0.2 m at most",
            measure=_least(_clearance),
        ),
        Metric(
            name="self_contact_max",
            unit="N",
            subject="",
            takes_axis=False,
            describe="largest force of one link of the robot on another; needs plant.self_contact",
            measure=_largest(_self_contact),
        ),
        Metric(
            name="beyond_blocks_end",
            unit="m",
            subject="",
            takes_axis=False,
            describe="how far the hindmost heel ends ahead of the last block",
            measure=_last(_beyond_blocks),
        ),
        Metric(
            name="drift_max",
            unit="m",
            subject="",
            takes_axis=False,
            describe="largest level distance of the estimated base from the true one",
            measure=_largest(_drift),
        ),
        Metric(
            name="tilt_error_rms",
            unit="rad",
            subject="",
            takes_axis=False,
            describe="root mean square angle of the estimated vertical to the true one",
            measure=_root_mean_square(_tilt_error),
        ),
        Metric(
            name="velocity_error_rms",
            unit="m/s",
            subject="",
            takes_axis=False,
            describe="root mean square error of the estimated base velocity",
            measure=_root_mean_square(_velocity_error),
        ),
    )
}
"""The metrics by name."""
