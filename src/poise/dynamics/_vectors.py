"""How far apart two orientations are, as a vector.

`saturate`: shortens a vector without turning it.
"""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64


def saturate(limit: float, value: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Eq. (18) of Zhang and Kikuuwe: limit value / max(limit, |value|).

    Args:
        limit: largest norm of the answer, positive [unit of `value`].
        value: the vector.
    """
    return value * (limit / max(limit, math.sqrt(float(value.dot(value)))))


def rotation_vector(
    target: Float64[np.ndarray, "3 3"], actual: Float64[np.ndarray, "3 3"]
) -> Float64[np.ndarray, "3"]:
    """Rotation that takes one orientation to another: (ln target actual^T)^vee.

    Equation (A1) of Zhang and Kikuuwe, "COM Shifter and Body Rotator for Step-by-Step
    Teleoperation of Bipedal Robots". At an angle of pi, where the axis has two signs, either is
    returned; it never becomes zero or NaN there, as it does when the axis is taken from the
    antisymmetric part alone.

    Args:
        target: world_R_target.
        actual: world_R_actual.

    Returns:
        Axis times angle along the world's axes, angle in [0, pi] [rad].
    """
    return pin.log3(target.dot(actual.T))


def rotation_sine(
    target: Float64[np.ndarray, "3 3"], actual: Float64[np.ndarray, "3 3"]
) -> Float64[np.ndarray, "3"]:
    """Axis times the sine of the angle that takes one orientation to another.

    Equation (63) of (Park, Jin, Kang 2022), e_o = r sin(phi), meant for small errors: beyond a
    right angle it shrinks again, and at pi it is zero.

    Args:
        target: world_R_target.
        actual: world_R_actual.

    Returns:
        Axis times sine along the world's axes.
    """
    turn = target @ actual.T
    return 0.5 * np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
