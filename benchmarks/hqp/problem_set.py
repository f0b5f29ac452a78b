"""`ProblemSequence`: hierarchical problems with a name, and the files that they are kept in.

One compressed `.npz` a sequence, which NumPy alone reads with `allow_pickle=False`: a few flat
arrays, in which what repeats stands once; what every key means stands in `docs/problem_set.md`.

`Source`: a sequence that can be made. `copy_problem`: a problem of its own, from a controller that
fills one storage every tick.
"""

import re
import zipfile
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import islice
from pathlib import Path

import numpy as np

from poise.errors import ConfigurationError, ProblemError, UnknownNameError
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
    """The arrays of a file, without its header."""
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
    """The problems of a file whose integers and texts have been found to be there."""
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


FAMILIES = ("recorded", "random", "inverse kinematics")
"""Where problems come from."""

FORMAT = 1
"""Number of the file format: raised when a key changes its meaning."""

_NAME = re.compile(r"[a-z0-9]+(?:-[a-z0-9]+)*")
"""Names are stems of file names."""

_HEADER = {"name": "U", "family": "U", "description": "U", "poise": "U", "consecutive": "b"}
"""Keys that say something about the whole file, and their kinds of array."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProblemSequence:
    """Problems of one origin, in order."""

    name: str  # unique, in small letters, digits and single hyphens; stem of the file's name
    family: str  # one of `FAMILIES`
    description: str  # one sentence for tables and files
    consecutive: bool  # whether neighbours are one tick apart, so that warm starts make sense
    # At least one; all of the same shape where they are consecutive
    problems: tuple[HierarchicalProblem, ...]

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise ConfigurationError(
                "not a name for a problem sequence",
                got=self.name,
                wanted="small letters, digits and single hyphens",
            )
        if self.family not in FAMILIES:
            raise UnknownNameError("unknown family of problems", got=self.family, choices=FAMILIES)
        if not self.problems:
            raise ConfigurationError(f"sequence {self.name!r} has no problems", got=0, wanted="1")
        shapes = {shape_of(problem) for problem in self.problems}
        if self.consecutive and len(shapes) > 1:
            raise ConfigurationError(
                f"consecutive problems of {self.name!r} differ in shape",
                got=sorted(shapes),
                wanted="one number of variables, and one of rows for each level",
            )

    def __len__(self) -> int:
        return len(self.problems)


def save_sequence(sequence: ProblemSequence, folder: Path) -> Path:
    """Writes a sequence to `folder/NAME.npz`; two saves of equal numbers give equal bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{sequence.name}.npz"
    arrays = {
        "format": np.array(FORMAT),
        "name": np.array(sequence.name),
        "family": np.array(sequence.family),
        "description": np.array(sequence.description),
        "poise": np.array(version("poise")),
        "consecutive": np.array(sequence.consecutive),
        **pack_problems(sequence.problems),
    }
    # What np.savez_compressed does, with nothing pickled and the smallest size.
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
        for key, array in arrays.items():
            with file.open(f"{key}.npy", "w") as part:
                np.lib.format.write_array(part, array, allow_pickle=False)
    return path


def load_sequence(path: Path) -> ProblemSequence:
    """Reads what `save_sequence` wrote; the numbers are the same bit for bit."""
    arrays = _read(path)
    _check_keys(arrays, path)
    try:
        return ProblemSequence(
            name=str(arrays["name"]),
            family=str(arrays["family"]),
            description=str(arrays["description"]),
            consecutive=bool(arrays["consecutive"]),
            problems=unpack_problems(arrays),
        )
    except (ProblemError, ConfigurationError, UnknownNameError) as error:
        raise ProblemError(
            f"{path} is not a problem sequence: {error.what}", got=error.got, wanted=error.wanted
        ) from error


def load_folder(folder: Path) -> tuple[ProblemSequence, ...]:
    """Reads every `.npz` of a folder, in the order of their names."""
    paths = sorted(folder.glob("*.npz"))
    if not paths:
        raise ProblemError(
            "no problem sequences", got=str(folder), wanted="a folder with .npz files"
        )
    return tuple(load_sequence(path) for path in paths)


def _read(path: Path) -> dict[str, np.ndarray]:
    wanted = "an .npz file written by save_sequence"
    try:
        with path.open("rb") as stream:
            file = np.load(stream, allow_pickle=False)
            if isinstance(file, np.ndarray):
                raise ProblemError("not a problem sequence", got=str(path), wanted=wanted)
            return {key: file[key] for key in file.files}
    # What NumPy and zipfile raise on a file that is missing, cut short, or something else.
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise ProblemError(
            f"cannot read a problem sequence: {error}", got=str(path), wanted=wanted
        ) from error


def _check_keys(arrays: dict[str, np.ndarray], path: Path) -> None:
    number = arrays.get("format")
    if number is None or number.shape != () or number.dtype.kind != "i" or number != FORMAT:
        raise ProblemError(
            f"{path} has another format",
            got=None if number is None else number.tolist(),
            wanted=f"format {FORMAT}",
        )
    kinds = _HEADER | dict.fromkeys(TEXTS, "U") | dict.fromkeys(INTEGERS, "i")
    for key, kind in kinds.items():
        array = arrays.get(key)
        dimensions = 0 if key in _HEADER else 1
        if array is None or array.dtype.kind != kind or array.ndim != dimensions:
            raise ProblemError(
                f"{path} has no usable {key!r}",
                got=None if array is None else f"{array.dtype} with {array.ndim} dimensions",
                wanted=f"an array of kind {kind!r} with {dimensions} dimensions",
            )


Progress = Callable[[int, int], None]
"""Called with what is done and what there is in all."""

Make = Callable[[int, Progress | None], Iterable[HierarchicalProblem]]
"""Makes up to so many problems; each call makes the same ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A sequence and its origin."""

    name: str  # of the sequence
    family: str  # one of `FAMILIES`
    description: str  # one sentence
    consecutive: bool  # whether neighbours are one tick apart
    make: Make  # makes its problems

    def sequence(self, count: int, progress: Progress | None = None) -> ProblemSequence:
        """Makes the sequence."""
        if count < 1:
            raise ConfigurationError("no problems to make", got=count, wanted="count >= 1")
        return ProblemSequence(
            name=self.name,
            family=self.family,
            description=self.description,
            consecutive=self.consecutive,
            problems=tuple(islice(self.make(count, progress), count)),
        )


def copy_problem(problem: HierarchicalProblem) -> HierarchicalProblem:
    """The same problem in a storage of its own; its views look into that storage."""
    copy = HierarchicalProblem.allocate(
        problem.n,
        [len(view.lower) for view in problem.levels],
        names=[view.name for view in problem.levels],
        bounds_level=problem.bounds_level,
    )
    for key in FLOATS:
        getattr(copy, key)[...] = getattr(problem, key)
    copy.labels = list(problem.labels)
    return copy


def shape_of(problem: HierarchicalProblem) -> tuple[int, ...]:
    """Number of variables, and of rows of each level."""
    return (problem.n, *(len(view.lower) for view in problem.levels))
