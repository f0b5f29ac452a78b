"""Checks of the numbers and labels of a problem, and their conversion to arrays."""

from collections.abc import Iterator, Sequence
from operator import index
from typing import Any

import numpy as np
from jaxtyping import Float, Float64

from poise.errors import ProblemError

Numbers = np.ndarray | Sequence[Any] | float | int
"""An array, nested sequences, or one number for all rows."""

Labels = str | Sequence[tuple[str, int]]
"""One name for all rows, or (name, number of rows) pairs that add up to the rows."""


def check_matrix(values: Numbers, what: str) -> Float64[np.ndarray, "m n"]:
    """Return `values` as a finite C-ordered matrix of floats, or raise `ProblemError`."""
    matrix = _as_floats(values, what)
    if matrix.ndim != 2:
        raise ProblemError(f"{what} is not a matrix", got=matrix.shape, wanted="two dimensions")
    if not np.isfinite(matrix).all():
        row, column = np.argwhere(~np.isfinite(matrix))[0]
        raise ProblemError(
            f"{what} is not finite at row {row}, column {column}",
            got=float(matrix[row, column]),
            wanted="finite coefficients",
        )
    return np.ascontiguousarray(matrix)


def check_bound(values: Numbers, rows: int, what: str) -> Float64[np.ndarray, " m"]:
    """Return `values` as `rows` bounds without NaN, or raise `ProblemError`."""
    bound = _as_vector(values, rows, what)
    if np.isnan(bound).any():
        row = int(np.isnan(bound).argmax())
        raise ProblemError(f"{what} is NaN at row {row}", got="nan", wanted="numbers, -inf or inf")
    return bound


def check_order(lower: Float[np.ndarray, " m"], upper: Float[np.ndarray, " m"], where: str) -> None:
    """Raise `ProblemError` where `lower > upper`, or where no finite number fits between them."""
    bad = (lower > upper) | (lower == np.inf) | (upper == -np.inf)
    if bad.any():
        row = int(bad.argmax())
        raise ProblemError(
            f"bounds of {where} cross at row {row}",
            got=(float(lower[row]), float(upper[row])),
            wanted="lower <= upper, lower < inf and upper > -inf",
        )


def check_weights(values: Numbers, rows: int, where: str) -> Float64[np.ndarray, " m"]:
    """Return `values` as `rows` positive finite weights, or raise `ProblemError`."""
    weights = _as_vector(values, rows, f"weights of {where}")
    bad = ~(np.isfinite(weights) & (weights > 0.0))
    if bad.any():
        row = int(bad.argmax())
        raise ProblemError(
            f"weights of {where} are wrong at row {row}",
            got=float(weights[row]),
            wanted="positive finite weights",
        )
    return weights


def row_names(labels: list[tuple[str, int]]) -> Iterator[tuple[str, int]]:
    """Return a name for each row: its label, and its number among the label's rows."""
    return ((name, k) for name, count in labels for k in range(count))


def expand_labels(labels: Labels | None, rows: int, default: str) -> list[tuple[str, int]]:
    """Return labels as (name, row count) pairs that add up to `rows`, or raise `ProblemError`."""
    if labels is None:
        return [(default, rows)]
    if isinstance(labels, str):
        return [(labels, rows)]
    wanted = f"a text, or (text, number of rows) pairs that sum to {rows}"
    try:
        pairs = [(str(label), index(count)) for label, count in labels]
    except (TypeError, ValueError) as error:
        raise ProblemError("labels of a level", got=labels, wanted=wanted) from error
    if any(count < 0 for _, count in pairs) or sum(count for _, count in pairs) != rows:
        raise ProblemError("labels do not add up to the rows", got=pairs, wanted=wanted)
    return pairs


def _as_vector(values: Numbers, rows: int, what: str) -> Float64[np.ndarray, " m"]:
    vector = _as_floats(values, what)
    if vector.ndim == 0:
        return np.full(rows, float(vector))
    if vector.shape != (rows,):
        raise ProblemError(
            f"{what} has the wrong shape", got=vector.shape, wanted=f"({rows},) or a number"
        )
    return vector


def _as_floats(values: Numbers, what: str) -> Float64[np.ndarray, "..."]:
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ProblemError(
            f"{what} is not an array of numbers", got=values, wanted="real numbers"
        ) from error
