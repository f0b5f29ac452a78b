"""`inverse_kinematics`: the configuration that puts frames where they should be; not for a loop.

`frame_error`: how far a frame is from its goal, with the Jacobian that brings it there.
"""

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

Linearize = Callable[
    [Float64[np.ndarray, " nq"]], tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, "m nv"]]
]
"""From a configuration what is missing to the goals [m, rad], and its Jacobian."""


def inverse_kinematics(
    model: pin.Model,
    q: Float64[np.ndarray, " nq"],
    linearize: Linearize,
    free: Sequence[int],
    *,
    tolerance: float,
    damping: float,
    step_max: float,
    iterations: int,
) -> tuple[Float64[np.ndarray, " nq"], Float64[np.ndarray, " m"]]:
    """Goes to the goals by damped least-squares steps (Wampler 1986; Nakamura and Hanafusa 1986).

        dq = J^T (J J^T + damping I)^-1 e

    Args:
        model: whose configuration.
        q: where to begin.
        linearize: e and J at a configuration.
        free: indices in the velocity vector that may move.
        tolerance: the largest entry of e that counts as none [m, rad].
        damping: keeps steps bounded where J loses rank [m^2, rad^2].
        step_max: longest step of one velocity [m, rad]; near-straight legs make it too long.
        iterations: steps at most.

    Returns:
        The configuration, and what is still missing there [m, rad].
    """
    error, jacobian = linearize(q)
    for _ in range(iterations):
        if float(np.abs(error).max()) < tolerance:
            break
        J = jacobian[:, free]
        step = J.T @ np.linalg.solve(J @ J.T + damping * np.eye(len(J)), error)
        dq = np.zeros(model.nv)
        dq[free] = step * min(1.0, step_max / float(np.abs(step).max()))
        q = pin.integrate(model, q, dq)
        error, jacobian = linearize(q)
    return q, error


def frame_error(
    model: pin.Model, data: pin.Data, frame: int, goal: pin.SE3
) -> tuple[Float64[np.ndarray, "6"], Float64[np.ndarray, "6 nv"]]:
    """The motion that is missing to a goal, in the frame's own axes, and the frame's Jacobian.

    Args:
        model: of the robot.
        data: after `pin.computeJointJacobians`.
        frame: its index.
        goal: world_T_goal.

    Returns:
        log6(frame_T_goal), linear part first [m, rad], and the frame's Jacobian in its own axes,
        which is minus the derivative of that where the error is small.
    """
    placement = pin.updateFramePlacement(model, data, frame)
    error = pin.log6(placement.actInv(goal)).vector
    return error, pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
