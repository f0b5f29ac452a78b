"""Metrics of a run: each reduces one figure a tick to one of the run."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Shaped

from poise.apps.report import RunSignals


class Reading(NamedTuple):
    """A figure, NaN where there was nothing to measure, and the only tick that decided it."""

    value: float
    row: int | None


NOTHING = Reading(float("nan"), None)

Rows = Bool[np.ndarray, " T"]
Values = Shaped[np.ndarray, "T ..."]


@dataclass(frozen=True)
class Metric:
    """A figure of a run."""

    unit: str  # "" for a number, and for a task's error the task's own
    describe: str  # one line for people
    track: Callable[[RunSignals, str, int | None], Values]  # of signals, subject and axis
    reduce: Callable[[Values, Rows], Reading]  # of the track and the ticks that count
    subject: str = ""  # "", "task", "sole" or "level"
    takes_axis: bool = False

    def measure(self, run: RunSignals, subject: str, axis: int | None, rows: Rows) -> Reading:
        """Measure a subject along an axis in the ticks that count."""
        return self.reduce(self.track(run, subject, axis), rows) if rows.any() else NOTHING


def _largest(values: Values, rows: Rows) -> Reading:
    counted = np.where(rows & np.isfinite(values), values, -np.inf)
    row = int(np.argmax(counted))
    return Reading(float(values[row]), row) if counted[row] > -np.inf else NOTHING


def _least(values: Values, rows: Rows) -> Reading:
    value, row = _largest(-values, rows)
    return Reading(-value, row)


def _last(values: Values, rows: Rows) -> Reading:
    row = int(np.flatnonzero(rows)[-1])
    return Reading(float(values[row]), row)


def _root_mean_square(values: Values, rows: Rows) -> Reading:
    finite = values[rows & np.isfinite(values)]
    return Reading(float(np.sqrt(np.mean(finite**2))), None) if finite.size else NOTHING


def _extent(places: Values, rows: Rows) -> Reading:
    return Reading(float(np.linalg.norm(np.ptp(places[rows], axis=0))), None)


def _end_speed(timed: Values, rows: Rows) -> Reading:
    """Mean speed over the last 0.1 s of places behind their times."""
    time, places = timed[rows, 0], timed[rows, 1:]
    if len(time) < 2:
        return NOTHING
    last = max(1, int(np.searchsorted(time[-1] - time[::-1], 0.1)))
    first = max(0, len(time) - 1 - last)
    distance = np.linalg.norm(places[-1] - places[first])
    speed = float(distance / max(time[-1] - time[first], 1e-9))
    return Reading(speed, int(np.flatnonzero(rows)[-1]))


def _rises(on: Values, rows: Rows) -> Reading:
    counted = on[rows]
    return Reading(float(np.count_nonzero(counted[1:] & ~counted[:-1])), None)


def _signal(name: str) -> Callable[[RunSignals, str, int | None], Values]:
    return lambda run, *_: getattr(run, name)


def _base_error(name: str) -> Callable[[RunSignals, str, int | None], Values]:
    """An error of the base's estimate; zeros where the controller has the truth."""
    return lambda run, *_: getattr(run.base_errors, name, np.zeros(len(run.time)))


def _com(run: RunSignals, _: str, axis: int | None) -> Values:
    return run.com if axis is None else run.com[:, axis]


def _timed_com(run: RunSignals, _: str, __: int | None) -> Values:
    return np.column_stack([run.time, run.com])


def _com_error(run: RunSignals, _: str, axis: int | None) -> Values:
    error = run.com_reference - run.com
    return np.linalg.norm(error, axis=1) if axis is None else np.abs(error[:, axis])


def _task_error(run: RunSignals, task: str, _: int | None) -> Values:
    return next(track.error for track in run.tasks if track.name == task)


def _most(ratios: Float64[np.ndarray, "T nj"]) -> Float64[np.ndarray, " T"]:
    """Ratio of the joint that is nearest to its limit; minus infinity in a tick without torques."""
    return np.max(ratios, axis=1, initial=-np.inf, where=np.isfinite(ratios))


def _torque(run: RunSignals, _: str, __: int | None) -> Values:
    return _most(np.abs(run.torque) / run.torque_max)


def _torque_step(run: RunSignals, _: str, __: int | None) -> Values:
    # From the tick before; the first has none.
    return _most(np.abs(np.diff(run.torque, axis=0, prepend=np.nan)) / run.torque_max)


def _residual(run: RunSignals, level: str, _: int | None) -> Values:
    return run.residuals[:, int(level) - 1]


def _sole_force(run: RunSignals, sole: str, _: int | None) -> Values:
    return run.soles[sole].force


def _sole_height(run: RunSignals, sole: str, _: int | None) -> Values:
    return run.soles[sole].height


def _planned(run: RunSignals, _: str, __: int | None) -> Values:
    planned = [sole.planned > 0.5 for sole in run.soles.values()]
    return np.reshape(planned, (-1, len(run.time))).astype(np.bool_).T


def _zmp_error(run: RunSignals, _: str, __: int | None) -> Values:
    return np.linalg.norm(run.zmp_reference - run.zmp, axis=1)


def _base_tilt(run: RunSignals, _: str, __: int | None) -> Values:
    x, y = _base_turn(run)[:2]
    return np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))


def _base_yaw(run: RunSignals, _: str, __: int | None) -> Values:
    x, y, z, w = _base_turn(run)
    return np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def _base_turn(run: RunSignals) -> Float64[np.ndarray, "4 T"]:
    """Quaternions of the base, NaN of a fixed one."""
    if run.q.shape[1] == len(run.joint_names):
        return np.full((4, len(run.time)), np.nan)
    return run.q[:, 3:7].T


def _gain(values: Values, rows: Rows) -> Reading:
    found = values[rows]
    return Reading(float(found[-1] - found[0]), None)


METRICS = {
    "com_error_max": Metric(
        "m", "largest distance of the CoM from its reference", _com_error, _largest, takes_axis=True
    ),
    "com_error_rms": Metric(
        "m",
        "root mean square distance of the CoM from its reference",
        _com_error,
        _root_mean_square,
        takes_axis=True,
    ),
    "com_travel": Metric(
        "m", "how far the CoM moved, from least to most", _com, _extent, takes_axis=True
    ),
    "com_speed_end": Metric(
        "m/s", "mean speed of the CoM over the last 0.1 s", _timed_com, _end_speed
    ),
    "task_error_max": Metric("", "largest error of a task", _task_error, _largest, "task"),
    "task_error_rms": Metric(
        "", "root mean square error of a task", _task_error, _root_mean_square, "task"
    ),
    "task_error_end": Metric(
        "", "error of a task at the end of the window", _task_error, _last, "task"
    ),
    "torque_ratio_max": Metric("", "largest torque over its limit", _torque, _largest),
    "torque_step_max": Metric(
        "", "largest change of a torque from tick to tick over its limit", _torque_step, _largest
    ),
    "sole_force_max": Metric("N", "largest normal force of a sole", _sole_force, _largest, "sole"),
    "sole_height_min": Metric(
        "m",
        "least height of a sole's centre above the floor or the block under it",
        _sole_height,
        _least,
        "sole",
    ),
    "residual_max": Metric(
        "", "largest relative residual of a level, 1 is the physics", _residual, _largest, "level"
    ),
    "base_tilt_max": Metric(
        "rad", "largest angle of the base from where it is upright", _base_tilt, _largest
    ),
    "base_turned": Metric("rad", "how far the base turned to the left", _base_yaw, _gain),
    "zmp_margin_min": Metric(
        "m",
        "least distance of the ZMP from the edge of the support polygon",
        _signal("zmp_margin"),
        _least,
    ),
    "zmp_error_max": Metric(
        "m", "largest distance of the ZMP from its reference", _zmp_error, _largest
    ),
    "steps_made": Metric("", "how often a sole was put down and counted on", _planned, _rises),
    "clearance_min": Metric(
        "m", "least distance of the robot from a block, 0.2 m at most", _signal("clearance"), _least
    ),
    "self_contact_max": Metric(
        "N",
        "largest force of one link of the robot on another; needs plant.self_contact",
        _signal("self_contact"),
        _largest,
    ),
    "beyond_blocks_end": Metric(
        "m", "how far the hindmost heel ends ahead of the last block", _signal("beyond"), _last
    ),
    "drift_max": Metric(
        "m",
        "largest level distance of the estimated base from the true one",
        _base_error("drift"),
        _largest,
    ),
    "tilt_error_rms": Metric(
        "rad",
        "root mean square angle of the estimated vertical to the true one",
        _base_error("tilt"),
        _root_mean_square,
    ),
    "velocity_error_rms": Metric(
        "m/s",
        "root mean square error of the estimated base velocity",
        _base_error("speed"),
        _root_mean_square,
    ),
}
"""The metrics by name."""
