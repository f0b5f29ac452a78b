"""Differences of orientations as vectors, and saturation of a vector."""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._compiled import part


def saturate(limit: float, value: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Shorten a vector by (18) of Zhang and Kikuuwe: limit value / max(limit, |value|)."""
    return value * (limit / max(limit, math.hypot(*value.tolist())))


def rotation_vector(
    target: Float64[np.ndarray, "3 3"], actual: Float64[np.ndarray, "3 3"]
) -> Float64[np.ndarray, "3"]:
    """Return the rotation from one orientation to another: (ln target actual^T)^vee.

    Equation (A1) of Zhang and Kikuuwe, "COM Shifter and Body Rotator for Step-by-Step
    Teleoperation of Bipedal Robots". At an angle of pi, where the axis has two signs, either is
    returned; it never becomes zero or NaN there, as it does when the axis is taken from the
    antisymmetric part alone.
    """
    return pin.log3(target.dot(actual.T))


@part
def turn_between(
    target: Float64[np.ndarray, " t"],
    t: int,
    actual: Float64[np.ndarray, " a"],
    a: int,
    out: Float64[np.ndarray, " k"],
    at: int,
) -> None:
    """Write the `rotation_vector` of matrices that stand row by row in longer arrays."""
    # By the unit quaternion of target actual^T, with its largest component first, so that no angle
    # loses digits.
    xx, xy, xz = _row_products(target, t, actual, a)
    yx, yy, yz = _row_products(target, t + 3, actual, a)
    zx, zy, zz = _row_products(target, t + 6, actual, a)
    # The quaternion times four times its largest component.
    if xx + yy + zz > 0.0:
        w, x, y, z = 1.0 + xx + yy + zz, zy - yz, xz - zx, yx - xy
    elif xx >= yy and xx >= zz:
        w, x, y, z = zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx
    elif yy >= zz:
        w, x, y, z = xz - zx, xy + yx, 1.0 + yy - xx - zz, yz + zy
    else:
        w, x, y, z = yx - xy, xz + zx, yz + zy, 1.0 + zz - xx - yy
    sine = math.sqrt(x * x + y * y + z * z)
    ratio = 2.0 / w if sine < _SMALL_TURN * abs(w) else 2.0 * math.atan2(sine, abs(w)) / sine
    if w < 0.0:
        ratio = -abs(ratio)
    out[at], out[at + 1], out[at + 2] = ratio * x, ratio * y, ratio * z


_SMALL_TURN = 1e-8
"""Tangents below this are their angles, to the last bit."""


@part
def _row_products(
    one: Float64[np.ndarray, " t"], i: int, other: Float64[np.ndarray, " a"], k: int
) -> tuple[float, float, float]:
    """Multiply a row of one 3x3 matrix by each row of another."""
    x, y, z = one[i], one[i + 1], one[i + 2]
    return (
        x * other[k] + y * other[k + 1] + z * other[k + 2],
        x * other[k + 3] + y * other[k + 4] + z * other[k + 5],
        x * other[k + 6] + y * other[k + 7] + z * other[k + 8],
    )


@part
def sine_between(
    target: Float64[np.ndarray, " t"],
    t: int,
    actual: Float64[np.ndarray, " a"],
    a: int,
    out: Float64[np.ndarray, " k"],
    at: int,
) -> None:
    """Write the axis times the sine of the angle from one orientation to another, world axes.

    Equation (63) of (Park, Jin, Kang 2022), e_o = r sin(phi), meant for small errors: beyond a
    right angle it shrinks again, and at pi it is zero.
    """
    _, xy, xz = _row_products(target, t, actual, a)
    yx, _, yz = _row_products(target, t + 3, actual, a)
    zx, zy, _ = _row_products(target, t + 6, actual, a)
    out[at], out[at + 1], out[at + 2] = 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)
