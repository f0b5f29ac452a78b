"""`Level`: rows of one priority, as a user writes them down, validated when made."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Float64

from poise.errors import ProblemError

Numbers = np.ndarray | Sequence[Any] | float | int
"""What becomes an array of floats: an array, nested sequences, or one number for all rows."""

Labels = str | Sequence[tuple[str, int]]
"""One name for all rows, or (name, number of rows) pairs that add up to the rows."""


class Level:
    """Rows `lower <= A x <= upper` of one priority. Rows with `lower == upper` are equalities.

    Zero rows, duplicate rows, an empty level and infinite bounds are legal.

    Args:
        A: coefficients, one row a constraint.
        lower: lower bounds, `-inf` where there is none. A number stands for all rows.
        upper: upper bounds, `inf` where there is none. A number stands for all rows.
        weights: positive weight of each row in the norm of the level's slack; 1 by default.
        labels: names of the rows for `explain()`: one string, or (name, row count) pairs.
        name: name of the level; "level i" by default.

    Raises:
        ProblemError: shapes that do not fit, NaN, infinite coefficients, crossing bounds,
            weights that are not positive and finite, labels that do not add up.
    """

    def __init__(
        self,
        A: Numbers,
        lower: Numbers,
        upper: Numbers,
        weights: Numbers | None = None,
        labels: Labels | None = None,
        name: str = "",
    ) -> None:
        where = f"level {name!r}" if name else "level"
        self.name = name
        self.A = check_matrix(A, f"A of {where}")
        rows = self.A.shape[0]
        self.lower = check_bound(lower, rows, f"lower of {where}")
        self.upper = check_bound(upper, rows, f"upper of {where}")
        check_order(self.lower, self.upper, where)
        self.weights = check_weights(1.0 if weights is None else weights, rows, where)
        self.labels = expand_labels(labels, rows, name or "rows")

    def __repr__(self) -> str:
        return f"Level({self.name!r}, {self.A.shape[0]} rows, {self.A.shape[1]} variables)"


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
        raise ProblemError(
            f"{what} is NaN at row {int(np.flatnonzero(np.isnan(bound))[0])}",
            got="nan",
            wanted="numbers, -inf or inf",
        )
    return bound


def check_order(lower: Float[np.ndarray, " m"], upper: Float[np.ndarray, " m"], where: str) -> None:
    """Raise `ProblemError` where `lower > upper`, or where no finite number fits between them."""
    bad = (lower > upper) | (lower == np.inf) | (upper == -np.inf)
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
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
        row = int(np.flatnonzero(bad)[0])
        raise ProblemError(
            f"weights of {where} are wrong at row {row}",
            got=float(weights[row]),
            wanted="positive finite weights",
        )
    return weights


def expand_labels(labels: Labels | None, rows: int, default: str) -> list[tuple[str, int]]:
    """Return labels as (name, row count) pairs that add up to `rows`, or raise `ProblemError`."""
    if labels is None:
        return [(default, rows)]
    if isinstance(labels, str):
        return [(labels, rows)]
    pairs = [(str(label), int(count)) for label, count in labels]
    if any(count < 0 for _, count in pairs) or sum(count for _, count in pairs) != rows:
        raise ProblemError(
            "labels do not add up to the rows", got=pairs, wanted=f"counts that sum to {rows}"
        )
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
