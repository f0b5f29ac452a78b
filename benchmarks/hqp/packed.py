"""Hierarchical problems as a few flat arrays, in which what repeats stands once."""

from collections.abc import Mapping, Sequence

import numpy as np

from poise.errors import ProblemError
from poise.hqp import HierarchicalProblem

FLOATS = ("A", "lower", "upper", "weights", "H", "g")
"""Numbers of a problem; of each, problem `k` has what begins at `KEY_start[k]` in `KEY`."""

TEXTS = ("level_names", "label_names")
INTEGERS = (
    "n",
    "levels",
    "bounds_level",
    "labels",
    "rows",
    "rows_start",
    "level_names_start",
    "label_rows",
    "label_rows_start",
    "label_names_start",
    *(f"{key}_start" for key in FLOATS),
)


class _Pool:
    """Arrays laid end to end; one that is there already is not laid again."""

    def __init__(self) -> None:
        self.parts: list[np.ndarray] = []
        self.starts: list[int] = []
        self._length, self._known = 0, dict[tuple[str, bytes], int]()

    def add(self, array: np.ndarray) -> None:
        flat = np.ascontiguousarray(array).ravel()
        # Bytes tell -0.0 from 0.0, and texts of another width from each other.
        key = (flat.dtype.str, flat.tobytes())
        if key not in self._known:
            self._known[key] = self._length
            self.parts.append(flat)
            self._length += len(flat)
        self.starts.append(self._known[key])


def pack_problems(problems: Sequence[HierarchicalProblem]) -> dict[str, np.ndarray]:
    """The arrays of a file, without its header.

    Args:
        problems: at least one.
    """
    ragged = (*FLOATS, "rows", "level_names", "label_rows", "label_names")
    pools = {key: _Pool() for key in ragged}
    for problem in problems:
        for key in FLOATS:
            pools[key].add(getattr(problem, key))
        pools["rows"].add(np.array([len(view.lower) for view in problem.levels]))
        pools["level_names"].add(np.array([view.name for view in problem.levels]))
        pools["label_rows"].add(np.array([count for _, count in problem.labels]))
        pools["label_names"].add(np.array([name for name, _ in problem.labels]))
    packed = {
        "n": np.array([problem.n for problem in problems]),
        "levels": np.array([len(problem.levels) for problem in problems]),
        "bounds_level": np.array([problem.bounds_level for problem in problems]),
        "labels": np.array([len(problem.labels) for problem in problems]),
    }
    for key, pool in pools.items():
        packed[key] = np.concatenate(pool.parts)
        packed[f"{key}_start"] = np.array(pool.starts)
    return packed


def unpack_problems(arrays: Mapping[str, np.ndarray]) -> tuple[HierarchicalProblem, ...]:
    """The problems of a file whose integers and texts have been found to be there.

    Raises:
        ProblemError: numbers that are not there, do not fit each other or cannot be a problem.
    """
    for key in FLOATS:
        array = arrays.get(key)
        if array is None or array.dtype != np.float64 or array.ndim != 1:
            raise ProblemError(
                f"no usable {key!r}",
                got=None if array is None else f"{array.dtype} with {array.ndim} dimensions",
                wanted="float64 with 1 dimension",
            )
    count = len(arrays["n"])
    per_problem = [key for key in INTEGERS if key.endswith("_start")]
    for key in (*per_problem, "levels", "bounds_level", "labels"):
        if len(arrays[key]) != count:
            raise ProblemError(
                f"{key!r} has the wrong length", got=len(arrays[key]), wanted=f"{count}, as 'n'"
            )
    return tuple(_problem(arrays, k) for k in range(count))


def _problem(arrays: Mapping[str, np.ndarray], k: int) -> HierarchicalProblem:
    n, levels = int(arrays["n"][k]), int(arrays["levels"][k])
    rows = _part(arrays, "rows", k, levels).tolist()
    names = _part(arrays, "level_names", k, levels).tolist()
    problem = HierarchicalProblem.allocate(
        n, rows, names=names, bounds_level=int(arrays["bounds_level"][k])
    )
    for key in FLOATS:
        storage: np.ndarray = getattr(problem, key)
        storage[...] = _part(arrays, key, k, storage.size).reshape(storage.shape)
    labels = int(arrays["labels"][k])
    counts = _part(arrays, "label_rows", k, labels).tolist()
    if sum(counts) != n + problem.m or min(counts, default=0) < 0:
        raise ProblemError(
            f"labels of problem {k} do not add up to its rows",
            got=counts,
            wanted=f"counts that sum to {n + problem.m}",
        )
    texts = _part(arrays, "label_names", k, labels).tolist()
    problem.labels = list(zip(texts, counts, strict=True))
    problem.validate()
    return problem


def _part(arrays: Mapping[str, np.ndarray], key: str, k: int, size: int) -> np.ndarray:
    start = int(arrays[f"{key}_start"][k])
    if size < 0 or start < 0 or start + size > len(arrays[key]):
        raise ProblemError(
            f"{key!r} of problem {k} is not all there",
            got=f"{len(arrays[key])} entries",
            wanted=f"entries {start} to {start + size}",
        )
    return arrays[key][start : start + size]
