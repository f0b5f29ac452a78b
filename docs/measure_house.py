"""How big the house is: the figures of the table in design.md, for this or any other checkout.

python docs/measure_house.py [FOLDER ...]
"""

import ast
import io
import json
import sys
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

SMALL = 60
"""Files of fewer lines are crumbs where only one other file imports them."""


def python_files(folder: Path) -> list[Path]:
    """All modules below a folder; none where there is no such folder."""
    return sorted(folder.rglob("*.py")) if folder.is_dir() else []


def code_lines(path: Path) -> int:
    """Lines that hold code: no comment, no docstring, not empty."""
    text = path.read_text(encoding="utf-8")
    strings = {
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    skipped = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in skipped and token.type != tokenize.ENDMARKER:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - strings)


def public_names(files: list[Path]) -> set[str]:
    """Names in the `__all__` of packages that are not private."""
    found: set[str] = set()
    for path in files:
        if path.name != "__init__.py" or any(part.startswith("_") for part in path.parent.parts):
            continue
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                found |= set(ast.literal_eval(node.value))
    return found


def calls(files: list[Path], owner: str, method: str) -> Iterator[str]:
    """Files that call a method of a variable of that name, or of an attribute that ends so."""
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and node.func.attr == method
                and ast.unparse(node.func.value).split(".")[-1].strip("_") == owner
            ):
                yield str(path)


def crumbs(files: list[Path], root: Path) -> int:
    """Files under `SMALL` lines with one importer."""
    importers: defaultdict[str, set[Path]] = defaultdict(set)
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                importers[node.module].add(path)
    count = 0
    for path in files:
        name = ".".join(path.relative_to(root).with_suffix("").parts)
        short = len(path.read_text(encoding="utf-8").splitlines()) < SMALL
        count += short and path.name != "__init__.py" and len(importers[name]) == 1
    return count


def measure(folder: Path) -> dict[str, int]:
    """The figures of one checkout."""
    library = python_files(folder / "src/poise")
    laboratory = [*python_files(folder / "benchmarks"), *python_files(folder / "studies")]
    both = [*library, *laboratory]

    def lines(files: list[Path]) -> int:
        return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)

    return {
        "library: files": len(library),
        "library: lines": lines(library),
        "library: lines of code": sum(code_lines(path) for path in library),
        "library and laboratory: files": len(both),
        "library and laboratory: lines": lines(both),
        "library and laboratory: lines of code": sum(code_lines(path) for path in both),
        "public names": len(public_names(library)),
        "files that join plant and controller": len(Counter(calls(both, "plant", "step"))),
        "files that evaluate tasks": len(Counter(calls(library, "task", "evaluate"))),
        "small files with one importer": crumbs(library, folder / "src"),
    }


if __name__ == "__main__":
    for argument in sys.argv[1:] or ["."]:
        print(json.dumps({"checkout": argument, **measure(Path(argument))}, indent=1))
