"""What can be measured on a run: each metric is a function of the recorded signals."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from poise.apps.scenarios._signals import RunSignals


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A figure of a run.

    Attributes:
        name: what scenario files call it.
        unit: its unit; "" for a number, and for a task's error the task's own.
        subject: what it is measured on: "", "task", "sole" or "level".
        takes_axis: whether an axis is given with it.
        describe: one line for people.
        measure: from signals, subject, axis and the samples that count to the figure.
    """

    name: str
    unit: str
    subject: str
    takes_axis: bool
    describe: str
    measure: Callable[[RunSignals, str, int | None, Bool[np.ndarray, " T"]], float]


def _largest(values: Float64[np.ndarray, "..."]) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else float("nan")


def _com_error_max(
    run: RunSignals, _: str, axis: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    error = run.com_reference[rows] - run.com[rows]
    size = np.linalg.norm(error, axis=1) if axis is None else np.abs(error[:, axis])
    return _largest(size)


def _root_mean_square(values: Float64[np.ndarray, "..."]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")


def _com_error_rms(
    run: RunSignals, _: str, axis: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    error = run.com_reference[rows] - run.com[rows]
    return _root_mean_square(np.linalg.norm(error, axis=1) if axis is None else error[:, axis])


def _com_travel(run: RunSignals, _: str, axis: int | None, rows: Bool[np.ndarray, " T"]) -> float:
    com = run.com[rows]
    if not len(com):
        return float("nan")
    reach = com.max(axis=0) - com.min(axis=0)
    return float(np.linalg.norm(reach) if axis is None else reach[axis])


def _com_speed_end(run: RunSignals, _: str, __: int | None, rows: Bool[np.ndarray, " T"]) -> float:
    com, time = run.com[rows], run.time[rows]
    if len(com) < 2:
        return float("nan")
    last = max(1, int(np.searchsorted(time[-1] - time[::-1], 0.1)))
    span = slice(max(0, len(com) - 1 - last), None)
    return float(
        np.linalg.norm(com[span][-1] - com[span][0]) / max(time[span][-1] - time[span][0], 1e-9)
    )


def _task_error_max(
    run: RunSignals, task: str, _: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    return _largest(run.task_errors[task][rows])


def _task_error_rms(
    run: RunSignals, task: str, _: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    return _root_mean_square(run.task_errors[task][rows])


def _task_error_end(
    run: RunSignals, task: str, _: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    errors = run.task_errors[task][rows]
    return float(errors[-1]) if len(errors) else float("nan")


def _torque_ratio_max(
    run: RunSignals, _: str, __: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    return _largest(np.abs(run.torque[rows]) / run.torque_max)


def _sole_force_max(
    run: RunSignals, sole: str, _: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    return _largest(run.sole_forces[sole][rows])


def _sole_height_min(
    run: RunSignals, sole: str, _: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    heights = run.sole_positions[sole][rows, 2]
    return float(heights.min()) if len(heights) else float("nan")


def _residual_max(
    run: RunSignals, level: str, _: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    return _largest(run.residuals[rows, int(level) - 1])


def _zmp_margin_min(run: RunSignals, _: str, __: int | None, rows: Bool[np.ndarray, " T"]) -> float:
    margin = run.zmp_margin[rows]
    finite = margin[np.isfinite(margin)]
    return float(finite.min()) if finite.size else float("nan")


def _clearance_min(run: RunSignals, _: str, __: int | None, rows: Bool[np.ndarray, " T"]) -> float:
    return -_largest(-run.clearance[rows])


def _beyond_blocks_end(
    run: RunSignals, _: str, __: int | None, rows: Bool[np.ndarray, " T"]
) -> float:
    beyond = run.beyond[rows]
    return float(beyond[-1]) if len(beyond) else float("nan")


def _steps_made(run: RunSignals, _: str, __: int | None, rows: Bool[np.ndarray, " T"]) -> float:
    if not rows.any():
        return float("nan")
    standing = [planned[rows] > 0.5 for planned in run.sole_planned.values()]
    return float(sum(np.count_nonzero(on[1:] & ~on[:-1]) for on in standing))


def _zmp_error_max(run: RunSignals, _: str, __: int | None, rows: Bool[np.ndarray, " T"]) -> float:
    return _largest(np.linalg.norm(run.zmp_reference[rows] - run.zmp[rows], axis=1))


METRICS = {
    m.name: m
    for m in (
        Metric(
            name="com_error_max",
            unit="m",
            subject="",
            takes_axis=True,
            describe="largest distance of the COM from its reference",
            measure=_com_error_max,
        ),
        Metric(
            name="com_error_rms",
            unit="m",
            subject="",
            takes_axis=True,
            describe="root mean square distance of the COM from its reference",
            measure=_com_error_rms,
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
            measure=_task_error_max,
        ),
        Metric(
            name="task_error_rms",
            unit="",
            subject="task",
            takes_axis=False,
            describe="root mean square error of a task",
            measure=_task_error_rms,
        ),
        Metric(
            name="task_error_end",
            unit="",
            subject="task",
            takes_axis=False,
            describe="error of a task at the end of the window",
            measure=_task_error_end,
        ),
        Metric(
            name="torque_ratio_max",
            unit="",
            subject="",
            takes_axis=False,
            describe="largest torque over its limit",
            measure=_torque_ratio_max,
        ),
        Metric(
            name="sole_force_max",
            unit="N",
            subject="sole",
            takes_axis=False,
            describe="largest normal force of a sole",
            measure=_sole_force_max,
        ),
        Metric(
            name="sole_height_min",
            unit="m",
            subject="sole",
            takes_axis=False,
            describe="least height of a sole's centre above the ground",
            measure=_sole_height_min,
        ),
        Metric(
            name="residual_max",
            unit="",
            subject="level",
            takes_axis=False,
            describe="largest relative residual of a level, 1 is the physics",
            measure=_residual_max,
        ),
        Metric(
            name="zmp_margin_min",
            unit="m",
            subject="",
            takes_axis=False,
            describe="least distance of the ZMP from the edge of the support polygon",
            measure=_zmp_margin_min,
        ),
        Metric(
            name="zmp_error_max",
            unit="m",
            subject="",
            takes_axis=False,
            describe="largest distance of the ZMP from its reference",
            measure=_zmp_error_max,
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
            measure=_clearance_min,
        ),
        Metric(
            name="beyond_blocks_end",
            unit="m",
            subject="",
            takes_axis=False,
            describe="how far the hindmost heel ends ahead of the last block",
            measure=_beyond_blocks_end,
        ),
    )
}
"""The metrics by name."""
