"""Seeded mistakes: mutants of the core, and whether the tests beside them notice.

    pip install cosmic-ray
    python -m tests.mutants --count 200 --seed 0 --out mutants.jsonl

Mutants are drawn from what Cosmic Ray's operators can make of a package: a sign, an operator, a
comparison, a number, a condition turned round. Each is put into a copy of the project, where the
tests of its own package run until the first one fails: those in files named like its module first,
then the quick ones, and no more than `--seconds` of them; long simulations do not count. A line of
JSON a mutant is written as it is done, and a run that was interrupted goes on where it stopped.
"""

import argparse
import ast
import difflib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Queue
from xml.etree import ElementTree

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

ROOT = Path(__file__).parents[1]
PACKAGES = ("hqp", "control", "dynamics", "stack", "locomotion")
"""What is mutated, under `src/poise`; its tests are in the folder of `tests` with that name."""

LEFT_OUT = ("core/NoOp", "core/RemoveDecorator", "core/ExceptionReplacer")
"""Operators that make no mistake a person would make: compiled or not, a function does the same."""

ARITHMETIC = {"Add", "Sub", "Mul", "Div", "USub", "UAdd"}
"""What an arithmetic operator is mistaken for: a shift in place of a sum fails the first call."""

TIMEOUT = 900.0
"""Longest that the tests of one mutant may take [s]; a mutant that never ends counts as noticed."""

PYTEST = ("-m", "pytest", "-q", "-p", "no:cacheprovider")

Durations = dict[str, float]
"""Tests that pass without a mistake, by the name that pytest takes, and how long they take [s]."""


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """One seeded mistake.

    Attributes:
        module: file, relative to the project.
        operator: name of Cosmic Ray's operator.
        occurrence: which of the places that the operator could change.
        line: where it is.
    """

    module: str
    operator: str
    occurrence: int
    line: int

    def code(self) -> str:
        """The module's text with the mistake in it."""
        text = (ROOT / self.module).read_text(encoding="utf-8")
        mutated = mutate_code(text, get_operator(self.operator)(), self.occurrence)
        assert mutated is not None
        return mutated

    def diff(self) -> list[str]:
        """The lines that differ."""
        before = (ROOT / self.module).read_text(encoding="utf-8").splitlines()
        lines = difflib.unified_diff(before, self.code().splitlines(), lineterm="", n=0)
        return [line for line in lines if line[:3] not in ("---", "+++", "@@ ")]


def mutants_of(module: Path) -> Iterator[Mutant]:
    """Every mistake that can be seeded into a module, annotations and `__all__` left alone."""
    text = module.read_text(encoding="utf-8")
    nodes, spared = list(ast_nodes(get_ast(text))), spared_places(text)
    for name in operator_names():
        operator_class = get_operator(name)
        if name in LEFT_OUT or operator_class.arguments() or not is_plausible(name):
            continue
        operator = operator_class()
        places = ((start, node) for node in nodes for start, _ in operator.mutation_positions(node))
        for occurrence, (start, node) in enumerate(places):
            # The star before arguments by name is taken for a product.
            star = node.parent is not None and node.parent.type == "parameters"
            if not star and not any(low <= start < high for low, high in spared):
                yield Mutant(
                    module=str(module.relative_to(ROOT)),
                    operator=name,
                    occurrence=occurrence,
                    line=start[0],
                )


def is_plausible(operator: str) -> bool:
    """Whether a person might make this mistake and Python would run it."""
    kind, _, change = operator.partition("_")
    arithmetic = kind in ("core/ReplaceBinaryOperator", "core/ReplaceUnaryOperator")
    return not arithmetic or set(change.split("_")) <= ARITHMETIC


def spared_places(text: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where no mistake is seeded: annotations do nothing, and their `|` is no operator."""
    found: list[ast.expr] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            found += [node.returns] if node.returns is not None else []
        elif isinstance(node, ast.arg | ast.AnnAssign):
            found += [node.annotation] if node.annotation is not None else []
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Subscript | ast.BinOp):
            # An alias of a type, such as `Rows = tuple[Float64[np.ndarray, "m"], ...]`.
            names = {n.id for n in ast.walk(node.value) if isinstance(n, ast.Name)}
            found += [node.value] if names & {"Float64", "Int64", "Bool", "Callable"} else []
    return [
        ((e.lineno, e.col_offset), (e.end_lineno or e.lineno, e.end_col_offset or 0)) for e in found
    ]


def draw(count: int, seed: int, packages: tuple[str, ...]) -> list[Mutant]:
    """A random sample of all mutants of the packages."""
    files = [p for name in packages for p in sorted((ROOT / "src/poise" / name).rglob("*.py"))]
    everything = [mutant for file in files for mutant in mutants_of(file)]
    return random.Random(seed).sample(everything, min(count, len(everything)))


def measure(package: str) -> Durations:
    """Runs a package's tests once, without a mistake."""
    with tempfile.TemporaryDirectory() as place:
        report = Path(place) / "report.xml"
        options = [f"--junitxml={report}", "-o", "junit_family=xunit1", f"tests/{package}"]
        subprocess.run([sys.executable, *PYTEST, *options], cwd=ROOT, check=False)
        cases = ElementTree.parse(report).iter("testcase")
        # A case that failed or was skipped says so in an element of its own.
        passed = [case for case in cases if len(case) == 0]
        return {f"{c.get('file')}::{c.get('name')}": float(c.get("time", 0.0)) for c in passed}


def tests_of(mutant: Mutant, durations: Durations, seconds: float) -> list[str]:
    """The tests beside a module: files named like it first, then those that are soon through."""
    module = Path(mutant.module)
    words, folder = set(module.stem.strip("_").split("_")), module.parent.name.strip("_")
    files: dict[str, list[str]] = {}
    for test in durations:
        files.setdefault(test.partition("::")[0], []).append(test)

    def cost(file: str) -> float:
        path = Path(file)
        alike = len(words & set(path.stem.split("_"))) + 0.5 * (path.parent.name == folder)
        return (2.0 + sum(durations[test] for test in files[file])) / (1.0 + 20.0 * alike)

    chosen: list[str] = []
    for test in (test for file in sorted(files, key=cost) for test in files[file]):
        if durations[test] <= seconds:
            seconds -= durations[test]
            chosen.append(test)
    return chosen


def judge(mutant: Mutant, copy: Path, tests: list[str]) -> str:
    """Runs tests on a copy with the mistake in it: killed, survived or timeout."""
    (copy / mutant.module).write_text(mutant.code(), encoding="utf-8")
    paths = os.pathsep.join([str(copy / "src"), str(copy)])
    environment = {**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, *PYTEST, "-x", *tests]
    try:
        done = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, timeout=TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired:
        return "timeout"
    finally:
        # The machine code, too: that of the mistake has taken the place of what was kept.
        shutil.copytree(ROOT / "src", copy / "src", dirs_exist_ok=True)
    return "survived" if done.returncode == 0 else "killed"


def copy_of_the_project(folder: Path) -> Path:
    """A copy to make mistakes in, machine code that is kept included."""
    ignored = shutil.ignore_patterns(".git", ".venv", "runs", ".hypothesis", ".pytest_cache")
    return Path(shutil.copytree(ROOT, folder / "poise", ignore=ignored))


def run(
    count: int, seed: int, packages: tuple[str, ...], out: Path, workers: int, seconds: float
) -> None:
    """Judges a sample, two at a time or more, and writes each verdict as it comes."""
    durations = {package: measure(package) for package in packages}
    known = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    done = {(k["module"], k["operator"], k["occurrence"]) for k in known}
    left = [
        m for m in draw(count, seed, packages) if (m.module, m.operator, m.occurrence) not in done
    ]
    with (
        tempfile.TemporaryDirectory() as place,
        ThreadPoolExecutor(workers) as pool,
        out.open("a", encoding="utf-8") as file,
    ):
        copies: Queue[Path] = Queue()
        for number in range(workers):
            copies.put(copy_of_the_project(Path(place) / str(number)))

        def one(mutant: Mutant) -> tuple[Mutant, str]:
            tests = tests_of(mutant, durations[Path(mutant.module).parts[2]], seconds)
            copy = copies.get()
            try:
                return mutant, judge(mutant, copy, tests)
            finally:
                copies.put(copy)

        for number, (mutant, verdict) in enumerate(pool.map(one, left), 1):
            line = {**asdict(mutant), "verdict": verdict, "diff": mutant.diff()}
            file.write(json.dumps(line) + "\n")
            file.flush()
            print(f"{number}/{len(left)} {verdict} {mutant.module}:{mutant.line}", file=sys.stderr)


def summary(out: Path) -> Counter[tuple[str, str]]:
    """How many of each package came to each verdict."""
    lines = [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]
    return Counter((Path(k["module"]).parts[2], k["verdict"]) for k in lines)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200, help="how many (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (default: %(default)s)")
    parser.add_argument("--packages", default=",".join(PACKAGES), help="(default: %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("mutants.jsonl"), help="where verdicts go")
    parser.add_argument("--workers", type=int, default=2, help="copies (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=40.0, help="of tests a mutant, at most")
    options = parser.parse_args()
    packages = tuple(options.packages.split(","))
    run(options.count, options.seed, packages, options.out, options.workers, options.seconds)
    for (package, verdict), number in sorted(summary(options.out).items()):
        print(f"{package} {verdict} {number}")


if __name__ == "__main__":
    main()
