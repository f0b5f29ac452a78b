"""Measure a checkout: rows and files by package, numeric constants, docstrings, repeated names.

python docs/measure_house.py [FOLDER ...]

Prints one JSON object a checkout, this one by default. design.md quotes figures of it.
"""

import ast
import io
import json
import sys
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

SMALL = 60
"""Files of fewer lines that one other file imports are counted as fragments."""

TEMPLATES = frozenset({".html", ".js", ".css", ".jinja", ".jinja2", ".j2"})
"""Suffixes of templates, scripts and style sheets: rows of the package in which they lie."""

BUNDLED = "*.min.*"
"""Names of bundled third-party files, which are not counted: minified ones."""

PACKAGES = {
    "_compiled": "root and _compiled",
    "robots": "robots and onboarding",
    "apps": "apps and cli",
    "cli": "apps and cli",
}
"""Packages that are counted under another name than their own."""

LABORATORY = ("studies", "benchmarks", "bundled_robots")
"""Folders of Python beside the library that are counted with the studies."""

ONBOARDING = ("apps/onboarding",)
"""Folders below `src/poise` that propose, try and show descriptions of new robots."""

OPENINGS = frozenset({"What", "Whether", "Where", "How"})
"""First words of docstrings that describe a question in place of a thing or an action."""

Named = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def source_files(folder: Path, *suffixes: str) -> list[Path]:
    """Own files below a folder with one of these suffixes; none where there is no such folder."""
    found = folder.rglob("*") if folder.is_dir() else []
    return sorted(p for p in found if p.suffix in suffixes and not p.match(BUNDLED))


@cache
def text(path: Path) -> str:
    """Content of a file."""
    return path.read_text(encoding="utf-8")


@cache
def tree(path: Path) -> ast.Module:
    """Syntax tree of a module."""
    return ast.parse(text(path))


def rows(files: Iterable[Path]) -> int:
    """Lines of all files."""
    return sum(len(text(path).splitlines()) for path in files)


def code_lines(path: Path) -> int:
    """Lines that hold code: no comment, no docstring, not empty."""
    strings = {
        line
        for node in ast.walk(tree(path))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    skipped = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text(path)).readline):
        if token.type not in skipped and token.type != tokenize.ENDMARKER:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - strings)


def package(path: Path) -> str:
    """Name under which a file is counted, by its path below `src/poise`."""
    if any(path.is_relative_to(part) for part in ONBOARDING):
        return PACKAGES["robots"]
    first = path.parts[0] if len(path.parts) > 1 else "_compiled"
    return PACKAGES.get(first, first)


def sizes(folder: Path) -> dict[str, dict[str, int]]:
    """Rows and files of each package, of docs, of tests, and of `LABORATORY`."""
    groups: defaultdict[str, list[Path]] = defaultdict(list)
    library = folder / "src/poise"
    for path in source_files(library, ".py", *TEMPLATES):
        groups[package(path.relative_to(library))].append(path)
    groups["docs"] = source_files(folder / "docs", ".py", ".md", *TEMPLATES)
    groups["tests"] = source_files(folder / "tests", ".py", *TEMPLATES)
    for name in LABORATORY:
        groups["studies and benchmarks"] += source_files(folder / name, ".py", *TEMPLATES)
    return {name: {"rows": rows(files), "files": len(files)} for name, files in groups.items()}


def listed_names(library: Path, *, private: bool) -> set[str]:
    """Names in the `__all__` of all packages of the library, or of those that are not private."""
    found: set[str] = set()
    for path in source_files(library, ".py"):
        hidden = any(part.startswith("_") for part in path.relative_to(library).parent.parts)
        if path.name != "__init__.py" or (hidden and not private):
            continue
        for node in tree(path).body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                found |= set(ast.literal_eval(node.value))
    return found


def numeric_constants(path: Path) -> int:
    """Upper-case names that a module assigns at its top, with a number in their value.

    A leading underscore changes nothing, and each name of a tuple counts. True and False are no
    numbers.
    """
    count = 0
    for node in tree(path).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        parts = [p for t in targets for p in (t.elts if isinstance(t, ast.Tuple) else [t])]
        values = (n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant))
        if any(type(value) in (int, float) for value in values):
            count += sum(isinstance(part, ast.Name) and part.id.isupper() for part in parts)
    return count


def docstring(node: ast.AST) -> ast.Constant | None:
    """Docstring of a module, class or function."""
    if not isinstance(node, ast.Module | Named) or ast.get_docstring(node) is None:
        return None
    first = node.body[0]
    assert isinstance(first, ast.Expr)
    assert isinstance(first.value, ast.Constant)
    return first.value


def asks(node: ast.AST) -> bool:
    """True where the first word of a docstring is one of `OPENINGS`, a comma aside."""
    string = docstring(node)
    words = str(string.value).split(maxsplit=1) if string else []
    return bool(words) and words[0].rstrip(",") in OPENINGS


def definitions(node: ast.AST, listed: set[str] | None) -> Iterator[tuple[Named, bool]]:
    """Classes and functions below a node, with True for those that are public.

    Args:
        node: a module, or what stands in one.
        listed: public names at the top of a module; None within a class that is public, where
            all names without a leading underscore are. Nothing within a function is public.
    """
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, Named):
            yield from definitions(child, listed)
            continue
        public = not child.name.startswith("_") if listed is None else child.name in listed
        yield child, public
        yield from definitions(child, None if public and isinstance(child, ast.ClassDef) else set())


def further_lines(files: Iterable[Path], listed: set[str]) -> tuple[int, int]:
    """Docstring lines after the first on classes and functions: public ones, and others."""
    count = {True: 0, False: 0}
    for path in files:
        for node, public in definitions(tree(path), listed):
            string = docstring(node)
            if string is not None:
                count[public] += (string.end_lineno or string.lineno) - string.lineno
    return count[True], count[False]


def repeated_classes(files: Iterable[Path]) -> int:
    """Names that more than one class has."""
    nodes = (node for path in files for node in ast.walk(tree(path)))
    names = Counter(node.name for node in nodes if isinstance(node, ast.ClassDef))
    return sum(count > 1 for count in names.values())


def calls(files: Iterable[Path], owner: str, method: str) -> Iterator[str]:
    """Files that call a method of a variable of that name, or of an attribute that ends so."""
    for path in files:
        for node in ast.walk(tree(path)):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and node.func.attr == method
                and ast.unparse(node.func.value).split(".")[-1].strip("_") == owner
            ):
                yield str(path)


def fragments(files: list[Path], root: Path) -> int:
    """Files under `SMALL` lines with one importer."""
    importers: defaultdict[str, set[Path]] = defaultdict(set)
    for path in files:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom) and node.module:
                importers[node.module].add(path)
    count = 0
    for path in files:
        name = ".".join(path.relative_to(root).with_suffix("").parts)
        short = rows([path]) < SMALL
        count += short and path.name != "__init__.py" and len(importers[name]) == 1
    return count


def longest(folder: Path) -> dict[str, int]:
    """Longest file of the library and its rows."""
    files = source_files(folder / "src/poise", ".py", *TEMPLATES)
    found = max(files, key=lambda path: rows([path]))
    return {found.relative_to(folder).as_posix(): rows([found])}


def docstring_figures(library: Path) -> dict[str, int]:
    """Figures of docstrings: openings, and lines after the first by who lists the name."""
    files = source_files(library, ".py")
    public, _ = further_lines(files, listed_names(library, private=False))
    listed, unlisted = further_lines(files, listed_names(library, private=True))
    return {
        "docstrings that open with What, Whether, Where, How": sum(
            asks(node) for path in files for node in ast.walk(tree(path))
        ),
        "docstring lines after the first: names in an __all__ of a public package": public,
        "docstring lines after the first: names in an __all__ of a private package": listed
        - public,
        "docstring lines after the first: names in no __all__": unlisted,
    }


def measure(folder: Path) -> dict[str, object]:
    """Figures of one checkout; files and lines of the library are those of Python alone."""
    root = folder / "src/poise"
    library = source_files(root, ".py")
    laboratory = [p for name in LABORATORY for p in source_files(folder / name, ".py")]
    both = [*library, *laboratory]
    return {
        "sizes": sizes(folder),
        "longest file": longest(folder),
        "library: files": len(library),
        "library: lines": rows(library),
        "library: lines of code": sum(map(code_lines, library)),
        "library and laboratory: files": len(both),
        "library and laboratory: lines": rows(both),
        "library and laboratory: lines of code": sum(map(code_lines, both)),
        "public names": len(listed_names(root, private=False)),
        "numeric constants": sum(map(numeric_constants, library)),
        "class names used more than once": repeated_classes(library),
        **docstring_figures(root),
        "files that join plant and controller": len(Counter(calls(both, "plant", "step"))),
        "files that evaluate tasks": len(Counter(calls(library, "task", "evaluate"))),
        "small files with one importer": fragments(library, folder / "src"),
    }


if __name__ == "__main__":
    for argument in sys.argv[1:] or ["."]:
        print(json.dumps({"checkout": argument, **measure(Path(argument))}, indent=1))
