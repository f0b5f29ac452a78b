"""`Level` and `HierarchicalProblem`: ordered levels of two-sided rows plus a final cost."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import index
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from poise._show import few
from poise.errors import ProblemError
from poise.hqp._tolerances import FACTOR_TOLERANCE, MET_TOLERANCE

Numbers = np.ndarray | Sequence[Any] | float | int
"""An array, nested sequences, or one number for all rows."""

Labels = str | Sequence[tuple[str, int]]
"""One name for all rows, or (name, number of rows) pairs that add up to the rows."""

_STORED = ("A", "lower", "upper", "weights", "H", "g")
"""Names of the arrays of a problem."""


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
        self.A = _check_matrix(A, f"A of {where}")
        rows = self.A.shape[0]
        self.lower = _check_bound(lower, rows, f"lower of {where}")
        self.upper = _check_bound(upper, rows, f"upper of {where}")
        _check_order(self.lower, self.upper, where)
        self.weights = _check_weights(1.0 if weights is None else weights, rows, where)
        self.labels = _expand_labels(labels, rows, name or "rows")

    def __repr__(self) -> str:
        return f"Level({self.name!r}, {self.A.shape[0]} rows, {self.A.shape[1]} variables)"


@dataclass(frozen=True, slots=True)
class LevelView:
    """Writable views of one level in a problem's storage."""

    name: str
    A: Float64[np.ndarray, "m n"]
    lower: Float64[np.ndarray, " m"]
    upper: Float64[np.ndarray, " m"]
    weights: Float64[np.ndarray, " m"]  # of the slack
    slice: slice  # of its rows in `problem.A`


class HierarchicalProblem:
    """Levels in strict order, then a final cost `x^T H x / 2 + g^T x` over what is left.

    Level by level, with every earlier level's optimal slack held, `|W w_i|^2` is minimal subject
    to `l_i - w_i <= A_i x <= u_i + w_i`. Storage is stacked and contiguous; `problem.lower`,
    `upper` and `weights` have the n simple bounds on x first and the rows of all levels after
    them, and `row_index` counts in the same order. Arrays are filled, never replaced: solvers keep
    them.

    Args:
        levels: at least one `Level`, highest priority first, all with the same number of variables.
        H: symmetric positive semidefinite final cost; the identity by default (minimum norm).
        g: linear final cost; zero by default.
        x_lower: simple lower bounds on x; none by default.
        x_upper: simple upper bounds on x; none by default.
        bounds_level: the level to whose slack the simple bounds count.

    Raises:
        ProblemError: anything that cannot be right, see `Level`.
    """

    levels: tuple[LevelView, ...]

    def __init__(
        self,
        levels: Sequence[Level],
        H: Numbers | None = None,
        g: Numbers | None = None,
        x_lower: Numbers | None = None,
        x_upper: Numbers | None = None,
        bounds_level: int = 0,
    ) -> None:
        levels = list(levels)
        if not levels:
            raise ProblemError("no levels", got=0, wanted="at least one Level")
        n = levels[0].A.shape[1]
        for i, level in enumerate(levels):
            if level.A.shape[1] != n:
                raise ProblemError(
                    f"level {i} has another number of variables than level 0",
                    got=level.A.shape[1],
                    wanted=f"{n} columns",
                )
        self._allocate(
            n,
            [level.A.shape[0] for level in levels],
            [level.name for level in levels],
            [level.labels for level in levels],
            bounds_level,
        )
        for view, level in zip(self.levels, levels, strict=True):
            view.A[:] = level.A
            view.lower[:] = level.lower
            view.upper[:] = level.upper
            view.weights[:] = level.weights
        if H is not None:
            H = _check_matrix(H, "H")
            if H.shape != (n, n):
                raise ProblemError("H has the wrong shape", got=H.shape, wanted=str((n, n)))
            self.H[:] = H
        if g is not None:
            self.g[:] = _check_bound(g, n, "g")
        if x_lower is not None:
            self.x_lower[:] = _check_bound(x_lower, n, "x_lower")
        if x_upper is not None:
            self.x_upper[:] = _check_bound(x_upper, n, "x_upper")
        self.validate()

    @classmethod
    def allocate(
        cls,
        n: int,
        rows_per_level: Sequence[int],
        names: Sequence[str] | None = None,
        labels: Sequence[Labels | None] | None = None,
        bounds_level: int = 0,
    ) -> "HierarchicalProblem":
        """Make a workspace of zeros that a controller fills in place every tick.

        Simple bounds start infinite, H as the identity, weights as one, the rest as zero.

        Args:
            n: number of variables.
            rows_per_level: number of rows of each level.
            names: name of each level.
            labels: labels of each level's rows, as in `Level`.
            bounds_level: the level to whose slack the simple bounds count.

        Raises:
            ProblemError: no variables, no levels, negative row counts, lists of unequal length.
        """
        count = len(rows_per_level)
        if n < 1 or count < 1 or min(rows_per_level) < 0:
            raise ProblemError(
                "not a problem's size",
                got=(n, list(rows_per_level)),
                wanted="n >= 1, at least one level, no negative row count",
            )
        names = [""] * count if names is None else names
        labels = [None] * count if labels is None else labels
        if len(names) != count or len(labels) != count:
            raise ProblemError(
                "names and labels must have one entry a level",
                got=(len(names), len(labels)),
                wanted=str(count),
            )
        pairs = [
            _expand_labels(label, rows, names[i] or f"level {i}")
            for i, (label, rows) in enumerate(zip(labels, rows_per_level, strict=True))
        ]
        problem = cls.__new__(cls)
        problem._allocate(n, list(rows_per_level), list(names), pairs, bounds_level)
        return problem

    def _allocate(
        self,
        n: int,
        rows: list[int],
        names: list[str],
        labels: list[list[tuple[str, int]]],
        bounds_level: int,
    ) -> None:
        if not 0 <= bounds_level < len(rows):
            raise ProblemError(
                "bounds_level is not a level", got=bounds_level, wanted=f"0 to {len(rows) - 1}"
            )
        m = sum(rows)
        self.n, self.m, self.bounds_level = n, m, bounds_level
        self.A: Float64[np.ndarray, "m n"] = np.zeros((m, n))
        self.lower: Float64[np.ndarray, " nm"] = np.zeros(n + m)
        self.upper: Float64[np.ndarray, " nm"] = np.zeros(n + m)
        self.weights: Float64[np.ndarray, " nm"] = np.ones(n + m)
        self.H: Float64[np.ndarray, "n n"] = np.eye(n)
        self.g: Float64[np.ndarray, " n"] = np.zeros(n)
        self.x_lower, self.x_upper = self.lower[:n], self.upper[:n]
        self.x_lower[:], self.x_upper[:] = -np.inf, np.inf
        starts = np.concatenate([[0], np.cumsum(rows, dtype=np.intp)])
        self.level_of: Int64[np.ndarray, " nm"] = np.empty(n + m, dtype=np.int64)
        self.level_of[:n] = bounds_level
        self.labels = [("bounds on x", n)]
        views: list[LevelView] = []
        for i, name in enumerate(names):
            a, b = int(starts[i]), int(starts[i + 1])
            self.level_of[n + a : n + b] = i
            self.labels += labels[i]
            stacked = slice(n + a, n + b)
            views.append(
                LevelView(
                    name=name or f"level {i}",
                    A=self.A[a:b],
                    lower=self.lower[stacked],
                    upper=self.upper[stacked],
                    weights=self.weights[stacked],
                    slice=slice(a, b),
                )
            )
        self.levels = tuple(views)

    def __setattr__(self, name: str, value: object) -> None:
        # An addition in place assigns the array itself.
        present = getattr(self, name, value)
        if isinstance(present, np.ndarray) and present is not value:
            raise AttributeError(
                f"{name} of a problem is filled, not replaced: problem.{name}[:] = ..."
            )
        super().__setattr__(name, value)

    def __getstate__(self) -> dict[str, Any]:
        """Return the parts of a copy, whose levels are views of its own arrays."""
        rows = [view.A.shape[0] for view in self.levels]
        sizes = (self.n, rows, [view.name for view in self.levels], self.bounds_level)
        arrays = {name: getattr(self, name).copy() for name in _STORED}
        return {"sizes": sizes, "labels": list(self.labels), "arrays": arrays}

    def __setstate__(self, state: dict[str, Any]) -> None:
        n, rows, names, bounds_level = state["sizes"]
        self._allocate(n, rows, names, [[] for _ in rows], bounds_level)
        self.labels[:] = state["labels"]
        for name, array in state["arrays"].items():
            getattr(self, name)[:] = array

    def level(self, index: int) -> LevelView:
        """Return writable views of level `index`, highest priority 0."""
        return self.levels[index]

    @property
    def equality(self) -> Bool[np.ndarray, " nm"]:
        """Mask of the bounds and rows whose lower and upper bound are equal."""
        return self.lower == self.upper

    @property
    def shape(self) -> tuple[int, int]:
        """Number of variables and number of rows."""
        return self.n, self.m

    @property
    def size(self) -> tuple[int, int]:
        """Number of variables and of rows, finite bounds on single variables among them."""
        bounded = np.isfinite(self.x_lower) | np.isfinite(self.x_upper)
        return self.n, self.m + int(np.count_nonzero(bounded))

    def label(self, row_index: int) -> str:
        """Return the label of a stacked row: the first n are the simple bounds."""
        left = row_index
        for name, count in self.labels:
            if 0 <= left < count:
                return name
            left -= count
        raise ProblemError("no such row", got=row_index, wanted=f"0 to {self.n + self.m - 1}")

    def rows_shared_with(
        self, other: "HierarchicalProblem"
    ) -> tuple[Int64[np.ndarray, " s"], Int64[np.ndarray, " s"]]:
        """Return the bounds and rows that another problem has under the same labels.

        Args:
            other: a problem, such as that of another set of contacts.

        Returns:
            Their stacked indices in this problem, and in the other.
        """
        theirs = {name: row for row, name in enumerate(_row_names(other.labels))}
        ours = enumerate(_row_names(self.labels))
        shared = [(row, theirs[name]) for row, name in ours if name in theirs]
        here, there = np.array(shared, dtype=np.int64).reshape(-1, 2).T
        return here, there

    def validate(self) -> None:
        """Raise `ProblemError` where the numbers are no problem; not for control loops."""
        for view in self.levels:
            Level(view.A, view.lower, view.upper, view.weights, name=view.name)
        _check_weights(self.weights[: self.n], self.n, "the bounds on x")
        _check_bound(self.x_lower, self.n, "x_lower")
        _check_bound(self.x_upper, self.n, "x_upper")
        _check_order(self.x_lower, self.x_upper, "x")
        _check_cost(self)


def faults(problem: HierarchicalProblem) -> list[str]:
    """Describe invalid numbers by the labels of their rows, without an error in a control loop."""
    lower, upper, weights = problem.lower, problem.upper, problem.weights
    wrong = np.isnan(lower) | np.isnan(upper) | (lower == np.inf) | (upper == -np.inf)
    wrong |= ~(np.isfinite(weights) & (weights > 0.0))
    wrong[problem.n :] |= ~np.isfinite(problem.A).all(axis=1)
    found: list[str] = []
    for rows, text in (
        (wrong, "numbers that are not finite"),
        (lower > upper, "bounds that cross"),
    ):
        if names := dict.fromkeys(problem.label(row) for row in np.flatnonzero(rows).tolist()):
            found.append(f"{text} in {few(list(names))}")
    if not (np.isfinite(problem.H).all() and np.isfinite(problem.g).all()):
        found.append("a final cost that is not finite")
    return found


def _check_cost(problem: HierarchicalProblem) -> None:
    H, g = problem.H, problem.g
    _check_matrix(H, "H")
    if not np.isfinite(g).all():
        raise ProblemError("g is not finite", got=g, wanted="finite coefficients")
    size = float(np.abs(H).max())
    if float(np.abs(H - H.T).max()) > MET_TOLERANCE * size:
        raise ProblemError("H is not symmetric", got=H, wanted="H == H^T")
    values, vectors = np.linalg.eigh(H)
    if values[0] < -FACTOR_TOLERANCE * size:
        raise ProblemError(
            "H is not positive semidefinite", got=float(values[0]), wanted="eigenvalues >= 0"
        )
    flat = vectors[:, values <= FACTOR_TOLERANCE * size]
    if flat.shape[1] and _falls_for_ever(problem, flat):
        raise ProblemError(
            "g falls along a direction that neither H nor a level holds: the final cost has no "
            "minimum",
            got=g,
            wanted="g in the range of H, or bounds where it falls",
        )


def _falls_for_ever(problem: HierarchicalProblem, flat: Float64[np.ndarray, "n k"]) -> bool:
    """Return whether the final cost falls along a direction that no row and no bound ends."""
    slope = problem.g @ flat
    least = MET_TOLERANCE * max(1.0, float(np.abs(problem.g).max()))
    if float(np.abs(slope).max()) <= least:
        return False
    # SciPy's optimizers take a tenth of a second to import, and few problems need them.
    from scipy.optimize import linprog

    rows = np.vstack([flat, problem.A @ flat])
    # Strategies need curvature elsewhere to reach the end; without any only equalities hold.
    held = problem.equality if not problem.H.any() else np.ones(len(rows), dtype=np.bool_)
    above, below = held & np.isfinite(problem.upper), held & np.isfinite(problem.lower)
    ends = np.vstack([rows[above], -rows[below]])
    found = linprog(slope, A_ub=ends, b_ub=np.zeros(len(ends)), bounds=(-1.0, 1.0))
    return bool(found.fun < -least)


# --- checks of numbers and labels -----------------------------------------------------------------


def _check_matrix(values: Numbers, what: str) -> Float64[np.ndarray, "m n"]:
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


def _check_bound(values: Numbers, rows: int, what: str) -> Float64[np.ndarray, " m"]:
    """Return `values` as `rows` bounds without NaN, or raise `ProblemError`."""
    bound = _as_vector(values, rows, what)
    if np.isnan(bound).any():
        row = int(np.isnan(bound).argmax())
        raise ProblemError(f"{what} is NaN at row {row}", got="nan", wanted="numbers, -inf or inf")
    return bound


def _check_order(
    lower: Float[np.ndarray, " m"], upper: Float[np.ndarray, " m"], where: str
) -> None:
    """Raise `ProblemError` where `lower > upper`, or where no finite number fits between them."""
    bad = (lower > upper) | (lower == np.inf) | (upper == -np.inf)
    if bad.any():
        row = int(bad.argmax())
        raise ProblemError(
            f"bounds of {where} cross at row {row}",
            got=(float(lower[row]), float(upper[row])),
            wanted="lower <= upper, lower < inf and upper > -inf",
        )


def _check_weights(values: Numbers, rows: int, where: str) -> Float64[np.ndarray, " m"]:
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


def _row_names(labels: list[tuple[str, int]]) -> Iterator[tuple[str, int]]:
    """Return a name for each row: its label, and its number among the label's rows."""
    return ((name, k) for name, count in labels for k in range(count))


def _expand_labels(labels: Labels | None, rows: int, default: str) -> list[tuple[str, int]]:
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
