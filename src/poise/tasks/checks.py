"""Checks on what a user passes to tasks: gains, weights and targets."""

import math

import numpy as np
from jaxtyping import Float64

from poise.checks import Numbers
from poise.errors import ConfigurationError, TargetError

_IDENTITY = np.eye(3)

_ORTHOGONALITY_TOLERANCE = 1e-6
"""How far R^T R may be from the identity before R was hardly meant to be a rotation."""


def checked_gain(value: Numbers, dim: int, what: str) -> Float64[np.ndarray, " m"]:
    """A gain or weight per axis, from a scalar or a vector.

    Raises:
        ConfigurationError: wrong length, not a number, negative or not finite.
    """
    array = _as_array(value, what, ConfigurationError)
    if array.shape not in ((), (dim,)):
        raise ConfigurationError(
            f"{what} has the wrong shape", got=array.shape, wanted=f"a number or {dim} numbers"
        )
    if not np.all(np.isfinite(array)) or np.any(array < 0.0):
        raise ConfigurationError(
            f"{what} must not be negative or infinite", got=value, wanted="finite numbers >= 0"
        )
    return np.ascontiguousarray(np.broadcast_to(array, (dim,)), dtype=np.float64)


def checked_target(value: Numbers, dim: int, what: str) -> Float64[np.ndarray, " m"]:
    """A target vector of known length, copied.

    Raises:
        TargetError: wrong shape, not numbers, NaN or infinite.
    """
    array = _as_array(value, what, TargetError)
    if array.shape != (dim,):
        raise TargetError(f"{what} has the wrong shape", got=array.shape, wanted=f"({dim},)")
    if not _all_finite(array):
        raise TargetError(f"{what} holds NaN or infinity", got=value, wanted="finite numbers")
    return array


def checked_rotation(value: Numbers, what: str) -> Float64[np.ndarray, "3 3"]:
    """A rotation matrix, copied.

    Raises:
        TargetError: wrong shape, NaN, or not orthogonal with determinant one.
    """
    array = _as_array(value, what, TargetError)
    if array.shape != (3, 3):
        raise TargetError(f"{what} has the wrong shape", got=array.shape, wanted="(3, 3)")
    if not _all_finite(array.ravel()):
        raise TargetError(f"{what} holds NaN or infinity", got=value, wanted="finite numbers")
    off = array.T @ array
    off -= _IDENTITY
    if np.abs(off).max() > _ORTHOGONALITY_TOLERANCE or _determinant(array) < 0.0:
        raise TargetError(
            f"{what} is not a rotation", got=array.tolist(), wanted="R^T R = I and det R = 1"
        )
    return array


def _all_finite(vector: Float64[np.ndarray, " m"]) -> bool:
    # Targets are short and set each tick: plain numbers take a fifth of what arrays do.
    return all(map(math.isfinite, vector.tolist()))


def _determinant(matrix: Float64[np.ndarray, "3 3"]) -> float:
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def _as_array(
    value: Numbers, what: str, error: type[ConfigurationError] | type[TargetError]
) -> Float64[np.ndarray, "..."]:
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise error(f"{what} is not made of numbers", got=value, wanted="numbers") from None
