"""Configurations that put frames where they should be, by inverse kinematics; not for a loop."""

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

Level = tuple[Float64[np.ndarray, " _"], Float64[np.ndarray, "_ nv"]]
"""Errors of goals of one priority [m, rad], and the Jacobian whose motion removes them."""

Bounds = tuple[Float64[np.ndarray, " nq"], Float64[np.ndarray, " nq"]]
"""Lower and upper limits of a configuration [m, rad]."""


def inverse_kinematics(
    model: pin.Model,
    q: Float64[np.ndarray, " nq"],
    linearize: Callable[[Float64[np.ndarray, " nq"]], Sequence[Level]],
    free: Sequence[int],
    *,
    tolerance: float,
    damping: float,
    step_max: float,
    iterations: int,
    bounds: Bounds | None = None,
) -> tuple[Float64[np.ndarray, " nq"], Sequence[Level]]:
    """Solve goals in strict priority by damped least squares of the velocities `free`.

    `damping` keeps steps bounded where J loses rank, `step_max` where legs are nearly straight. A
    joint at one of its `bounds` does not move on (Siciliano and Slotine 1991).
    """
    columns, entries = np.asarray(free), np.asarray(free) + model.nq - model.nv
    low, high = (np.full(model.nq, s * np.inf) for s in (-1.0, 1.0)) if bounds is None else bounds
    levels = linearize(q)
    for _ in range(iterations):
        if all(np.abs(error).max() < tolerance for error, _ in levels):
            break
        place, moving, stuck = q[entries], np.ones(len(columns), dtype=bool), True
        step = np.zeros(model.nv)
        while np.any(stuck):
            step[:] = 0.0
            step[columns[moving]] = _step(levels, columns[moving], damping)
            on = step[columns]
            stuck = ((place <= low[entries]) & (on < 0.0)) | ((place >= high[entries]) & (on > 0.0))
            moving &= ~stuck
        size = float(np.abs(step).max())
        if size < tolerance:
            break
        q = np.clip(pin.integrate(model, q, step * min(1.0, step_max / size)), low, high)
        levels = linearize(q)
    return q, levels


def _step(
    levels: Sequence[Level], columns: Int64[np.ndarray, " k"], damping: float
) -> Float64[np.ndarray, " k"]:
    """Add dq = N (J N)^T (J N (J N)^T + damping I)^-1 (e - J dq) of each level in turn."""
    step, null = np.zeros(len(columns)), np.eye(len(columns))
    for error, jacobian in levels:
        J = jacobian[:, columns]
        JN = J @ null
        # With damping N is no projector: without the first factor more of a level would reach
        # those above it.
        inverse = null @ JN.T @ np.linalg.inv(JN @ JN.T + damping * np.eye(len(J)))
        step = step + inverse @ (error - J @ step)
        null = null - inverse @ JN
    return step


def frame_error(
    model: pin.Model, data: pin.Data, frame: int, goal: pin.SE3
) -> tuple[Float64[np.ndarray, "6"], Float64[np.ndarray, "6 nv"]]:
    """log6(frame_T_goal) [m, rad], and minus its derivative, after `pin.computeJointJacobians`."""
    placement = pin.updateFramePlacement(model, data, frame)
    error = pin.log6(placement.actInv(goal)).vector
    return error, pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
