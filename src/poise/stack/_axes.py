"""Checks on what a user passes to tasks: gains, weights and targets.

Axis masks: which components of a task count, written as short words.
"""

from collections.abc import Mapping
from contextlib import suppress
from typing import TypeGuard

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise._checks import Numbers, all_finite, checked_kind
from poise.errors import ConfigurationError, TargetError

_NUMBER = np.dtype(np.float64)


def parse_axes(axes: str, groups: Mapping[str, int]) -> Int64[np.ndarray, " m"]:
    """Turn an axis mask into row indices.

    A mask is a group ("position"), a group with letters ("orientation_xy"), or several of these
    joined by "+" ("position_z+orientation"). Where there is one group its name may be left out
    ("xy").
    """
    rows: list[int] = []
    for term in checked_kind(axes, str, "an axis mask").split("+"):
        group, separator, letters = term.strip().partition("_")
        if not separator:
            if group in groups:
                letters = "xyz"
            elif len(groups) == 1:
                group, letters = next(iter(groups)), group
        if group not in groups or not letters or set(letters) - set("xyz"):
            raise ConfigurationError(
                "unknown axis mask",
                got=axes,
                wanted='a group, a group with letters such as "_xy", or several joined by "+"',
                choices=groups,
            )
        rows.extend(groups[group] + "xyz".index(c) for c in letters)
    if len(set(rows)) != len(rows):
        raise ConfigurationError("axis named twice in an axis mask", got=axes)
    return np.array(sorted(rows), dtype=np.int64)


def split_rows(index: np.ndarray) -> tuple[int, ...]:
    """Number of position rows and of orientation rows of a pose mask, those that are there."""
    linear = int(np.count_nonzero(index < 3))
    return tuple(size for size in (linear, len(index) - linear) if size)


LINEAR_SPEED, ANGULAR_SPEED, TRUNK_SPEED, COM_SPEED = 2.5, np.pi, 0.8, 0.35
"""Speeds that feedback asks for at most where a task has none of its own [m/s, rad/s].

Positions: what kp / kd = 5 1/s asks for half a metre away, which an arm reaches, so that plain
feedback is left as it is within reach. Orientations: half a turn in a second. Pelvis and torso turn
most of the mass: omega_lim of (17b) of Zhang and Kikuuwe. CoM: over a sole that reaches 0.1 m
ahead, sqrt(g / 0.8 m) times that takes the DCM to its edge."""


def usual_speeds(index: np.ndarray, angular: float) -> list[float]:
    """The usual speed of each block of rows of a pose mask, see `split_rows`."""
    linear = int(np.count_nonzero(index < 3))
    return [LINEAR_SPEED] * (linear > 0) + [angular] * (linear < len(index))


_ORTHOGONALITY_TOLERANCE = 1e-6
"""Largest deviation of R^T R from the identity that is accepted as a rotation."""


def checked_gain(
    value: Numbers, dim: int, what: str, *, positive: bool = False
) -> Float64[np.ndarray, " m"]:
    """A gain or weight per axis, from a scalar or a vector; a copy."""
    array = _spread(value, dim, what, f"a number or {dim} numbers")
    if not np.all(np.isfinite(array)) or np.any(array <= 0.0 if positive else array < 0.0):
        raise ConfigurationError(
            f"{what} is out of range",
            got=value,
            wanted=f"finite numbers {'>' if positive else '>='} 0",
        )
    return array


def checked_speed(value: Numbers, blocks: int, what: str) -> Float64[np.ndarray, " b"]:
    """A largest speed per block of rows, from a scalar or a vector; a copy."""
    array = _spread(value, blocks, what, f"a number or {blocks} numbers, one a block of rows")
    if not np.all(array > 0.0):
        raise ConfigurationError(f"{what} is out of range", got=value, wanted="numbers > 0, or inf")
    return array


def _spread(value: Numbers, size: int, what: str, wanted: str) -> Float64[np.ndarray, " m"]:
    array = _as_array(value, what, ConfigurationError)
    if array.shape not in ((), (size,)):
        raise ConfigurationError(f"{what} has the wrong shape", got=array.shape, wanted=wanted)
    return np.array(np.broadcast_to(array, (size,)), dtype=np.float64, order="C")


def checked_target(value: Numbers, dim: int, what: str) -> Float64[np.ndarray, " m"]:
    """A target vector of known length: the same array where it is one already, to be copied."""
    if not _is_finite_array(value, (dim,)):
        value = _checked_array(value, (dim,), what)
    return value


def checked_rates(value: Numbers, alone: slice | None, what: str) -> Float64[np.ndarray, "6"]:
    """Return rates of a pose, linear then angular; an array is not copied."""
    if _is_finite_array(value, (6,)):
        return value
    wanted, array = "(6,), linear then angular", _as_array(value, what, TargetError)
    if alone is not None:
        wanted += f", or (3,), {'angular' if alone.start else 'linear'} alone"
        if array.shape == (3,):
            rates = np.zeros(6)
            rates[alone] = array
            array = rates
    return _checked_array(array, (6,), what, wanted)


def checked_rotation(value: Numbers, what: str) -> Float64[np.ndarray, "3 3"]:
    """A rotation matrix: the same array where it is one already, to be copied."""
    if not _is_finite_array(value, (3, 3)):
        value = _checked_array(_from_quaternion(value, what), (3, 3), what)
    (a, b, c), (d, e, f), (g, h, i) = value.tolist()
    # R^T R - I, and the determinant of a matrix for which that is small: one or minus one.
    off = (
        a * a + d * d + g * g - 1.0,
        b * b + e * e + h * h - 1.0,
        c * c + f * f + i * i - 1.0,
        a * b + d * e + g * h,
        a * c + d * f + g * i,
        b * c + e * f + h * i,
    )
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if not max(map(abs, off)) <= _ORTHOGONALITY_TOLERANCE or determinant < 0.0:
        raise TargetError(
            f"{what} is not a rotation", got=value.tolist(), wanted="R^T R = I and det R = 1"
        )
    return value


Pose = pin.SE3 | Numbers
"""A pose as an argument: a `pinocchio.SE3`, a 4 x 4 matrix, or a pair of position and
orientation."""


def split_pose(value: Pose, what: str) -> tuple[Numbers, Numbers] | None:
    """Position and orientation of a pose; None for anything else, such as a position."""
    if isinstance(value, pin.SE3):
        return value.translation, value.rotation
    if (
        isinstance(value, list | tuple)
        and len(value) == 2
        and not isinstance(value[0], int | float | np.generic)
    ):
        return value[0], value[1]
    # Rows in a list are looked at once they are an array.
    matrix = _as_array(value, what, TargetError) if isinstance(value, list | tuple) else value
    if not isinstance(matrix, np.ndarray) or matrix.shape != (4, 4):
        return None
    if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise TargetError(
            f"{what} is no pose", got=matrix[3].tolist(), wanted="a last row of 0, 0, 0, 1"
        )
    return matrix[:3, 3], np.ascontiguousarray(matrix[:3, :3])


UNIT_TOLERANCE = 1e-3
"""Largest deviation of a quaternion's length from one that is accepted."""


def _from_quaternion(value: Numbers, what: str) -> Numbers:
    """The rotation matrix of a quaternion (x, y, z, w); anything else as it is."""
    if _as_array(value, what, TargetError).shape != (4,):
        return value
    quaternion = _checked_array(value, (4,), what)
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > UNIT_TOLERANCE:
        raise TargetError(
            f"{what} is no rotation: a quaternion that is not of length one",
            got=norm,
            wanted="x, y, z, w of length 1",
        )
    return np.ascontiguousarray(pin.Quaternion(quaternion / norm).toRotationMatrix())


def _is_finite_array(
    value: object, shape: tuple[int, ...]
) -> TypeGuard[Float64[np.ndarray, "..."]]:
    """Return True where a value needs no conversion, checked by plain numbers."""
    return (
        type(value) is np.ndarray
        and value.dtype == _NUMBER
        and value.shape == shape
        and all_finite(value)
    )


def _checked_array(
    value: Numbers, shape: tuple[int, ...], what: str, wanted: str | None = None
) -> Float64[np.ndarray, "..."]:
    array = _as_array(value, what, TargetError)
    if array.shape != shape:
        raise TargetError(
            f"{what} has the wrong shape", got=array.shape, wanted=wanted or str(shape)
        )
    if not all_finite(array):
        raise TargetError(f"{what} holds NaN or infinity", got=value, wanted="finite numbers")
    return array


def _as_array(
    value: Numbers, what: str, error: type[ConfigurationError] | type[TargetError]
) -> Float64[np.ndarray, "..."]:
    with suppress(TypeError, ValueError, OverflowError):
        # Texts of numbers are none.
        if np.asarray(value).dtype.kind not in "US":
            return np.array(value, dtype=np.float64)
    raise error(f"{what} is not made of numbers", got=value, wanted="numbers")
