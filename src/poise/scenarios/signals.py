"""`RunSignals`: what was recorded of a run, as arrays with one row a tick."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from poise.report import SupportPhase


@dataclass(frozen=True, kw_only=True, eq=False)
class RunSignals:
    """Recorded signals of one run, T ticks.

    Attributes:
        time: time of each tick [s].
        q: true configuration [m, rad].
        torque: torque as applied [N m].
        torque_max: torque limits [N m].
        com: true centre of mass [m].
        com_reference: where it should be, NaN where nothing asks [m].
        zmp: zero moment point [m].
        zmp_reference: where it should be, NaN where nothing asks [m].
        zmp_margin: distance of the ZMP from the edge of the support polygon, negative outside [m].
        support: support polygons over time.
        sole_forces: normal force of each sole [N].
        sole_positions: each sole's centre [m].
        sole_planned: whether the controller counted on the sole, 0 or 1.
        wrenches: measured wrench of each sole, in the sole's frame [N, N m].
        targets: where each point that a task moves should be, NaN where nothing asks [m].
        task_errors: norm of each task's error, NaN while it did not act [unit].
        residuals: relative residual of each level.
        status: status of each tick.
        tick_us: time of each tick by phase [us].
        clearance: distance of the robot from the nearest block, NaN without blocks [m].
        beyond: how far the hindmost heel is ahead of the last block, NaN without blocks [m].
        modes: when a robot that is walked by hand changed its mode [s], or a walk its status, and
            to which.
    """

    time: Float64[np.ndarray, " T"]
    q: Float64[np.ndarray, "T nq"] = field(repr=False)
    torque: Float64[np.ndarray, "T nj"] = field(repr=False)
    torque_max: Float64[np.ndarray, " nj"] = field(repr=False)
    com: Float64[np.ndarray, "T 3"] = field(repr=False)
    com_reference: Float64[np.ndarray, "T 3"] = field(repr=False)
    zmp: Float64[np.ndarray, "T 2"] = field(repr=False)
    zmp_reference: Float64[np.ndarray, "T 2"] = field(repr=False)
    zmp_margin: Float64[np.ndarray, " T"] = field(repr=False)
    support: tuple[SupportPhase, ...] = field(repr=False)
    sole_forces: dict[str, Float64[np.ndarray, " T"]] = field(repr=False)
    sole_positions: dict[str, Float64[np.ndarray, "T 3"]] = field(repr=False)
    sole_planned: dict[str, Float64[np.ndarray, " T"]] = field(repr=False)
    wrenches: dict[str, Float64[np.ndarray, "T 6"]] = field(repr=False)
    targets: dict[str, Float64[np.ndarray, "T 3"]] = field(repr=False)
    task_errors: dict[str, Float64[np.ndarray, " T"]] = field(repr=False)
    residuals: Float64[np.ndarray, "T nl"] = field(repr=False)
    status: tuple[str, ...] = field(repr=False)
    tick_us: dict[str, Float64[np.ndarray, " T"]] = field(repr=False)
    clearance: Float64[np.ndarray, " T"] = field(repr=False)
    beyond: Float64[np.ndarray, " T"] = field(repr=False)
    modes: tuple[tuple[float, str], ...] = field(repr=False)
