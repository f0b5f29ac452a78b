"""Rotation vectors: the logarithm of a rotation, right at zero and at pi."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64


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
    return pin.log3(target @ actual.T)
