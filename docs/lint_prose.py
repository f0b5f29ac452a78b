"""Refuse phrases of the list below in docstrings and comments on added lines.

python docs/lint_prose.py [--base REVISION]

Looks at Python files of the repository in the current folder, uncommitted ones included, and prints
`file:line: phrase`. Without a base it compares with where the branch left `origin/main` or `main`,
on that branch itself with the commit before. Exit status: 0 none found or nothing to compare with,
1 some found, 2 an unknown base. Names in backticks are no prose.
"""

import argparse
import ast
import io
import re
import subprocess
import sys
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

FOLDERS = ("src", "studies", "benchmarks", "bundled_robots", "tests")
MAIN = ("origin/main", "main")

PHRASES = (
    "is told",
    "are told",
    "is said",
    "is asked for",
    "gives back",
    "what carries",
    "what is left",
    "somebody",
    "of one's own",
    "of a user's own",
    "at once",
    "likewise",
    "felt",
    "borrowed",
    "led",
    "the divergent component",
    "the foot in the air",
    "the foot that stands",
    "comes down",
    "fell after",
)
"""Whole words in lower or upper case, on one line or wrapped."""

_WRAPPED = "|".join(re.escape(phrase).replace(r"\ ", r"\s+") for phrase in PHRASES)
_PHRASE = re.compile(
    rf"\b(?:{_WRAPPED})\b".replace("'", "['\N{RIGHT SINGLE QUOTATION MARK}]"), re.I
)
_OPENING = re.compile(r"\A[rRuU]?(?:\"{3}|'{3}|\"|')\s*(?P<word>What|Whether|Where|How)\b")
_CODE = re.compile(r"`[^`\n]*`")
_HUNK = re.compile(r"@@ -\S+ \+(\d+)(?:,(\d+))? @@")


class GitError(Exception):
    """Git's own message."""


def git(*arguments: str, folder: Path | None = None) -> str:
    """Output of a git command."""
    command = ["git", "-c", "core.quotePath=false", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, encoding="utf-8", check=False)
    if done.returncode:
        raise GitError(done.stderr.strip() or f"git {arguments[0]} failed")
    return done.stdout


def find_base() -> str | None:
    """Commit to compare with; None where history does not go back to one."""
    head = git("rev-parse", "HEAD").strip()
    for arguments in (*(("merge-base", "HEAD", main) for main in MAIN), ("rev-parse", "HEAD~1")):
        try:
            base = git(*arguments).strip()
        except GitError:
            continue
        if base != head:
            return base
    return None


def added_lines(base: str, root: Path) -> dict[str, set[int]]:
    """Numbers of the lines that each Python file has more than in a commit."""
    paths = [f":(glob){folder}/**/*.py" for folder in FOLDERS]
    added: defaultdict[str, set[int]] = defaultdict(set)
    # Options, because a user's settings may name other tools, colours and prefixes.
    form = ("--no-ext-diff", "--no-color", "--diff-filter=d", "--find-renames", "--unified=0")
    name = ""
    for line in git("diff", *form, "--dst-prefix=b/", base, "--", *paths, folder=root).splitlines():
        if line.startswith("+++ b/"):
            name = line.removeprefix("+++ b/").rstrip("\t")
        elif hunk := _HUNK.match(line):
            first, count = int(hunk[1]), int(hunk[2] or 1)
            added[name] |= set(range(first, first + count))
    untracked = git("ls-files", "--others", "--exclude-standard", "--", *paths, folder=root)
    for name in untracked.splitlines():
        added[name] = set(range(1, len((root / name).read_bytes().splitlines()) + 1))
    return added


def docstrings(text: str, lines: set[int]) -> Iterator[tuple[int, str]]:
    """First line and source of each docstring on some of these lines, those of values included."""
    for node in ast.walk(ast.parse(text)):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
            and not lines.isdisjoint(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        ):
            yield node.lineno, ast.get_source_segment(text, node) or ""


def comments(text: str) -> Iterator[tuple[int, str]]:
    """First line and words of each comment; those on lines in a row are one."""
    first, block = 0, list[str]()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type != tokenize.COMMENT:
            continue
        if block and token.start[0] != first + len(block):
            yield first, "\n".join(block)
            block = []
        if not block:
            first = token.start[0]
        block.append(token.string.lstrip("#"))
    if block:
        yield first, "\n".join(block)


def faults(text: str, lines: set[int]) -> list[tuple[int, str]]:
    """Line and phrase of each that stands on one of these lines, whole or in part."""
    found: set[tuple[int, str]] = set()
    prose = [*docstrings(text, lines), *comments(text)]
    for first, words in prose:
        without_code = _CODE.sub(lambda code: "`" * len(code[0]), words)
        matches = [*_PHRASE.finditer(without_code)]
        if opening := _OPENING.match(without_code):
            matches.append(opening)
        for match in matches:
            opens = "word" in match.groupdict()
            begin, end = match.span("word" if opens else 0)
            place = range(
                first + words.count("\n", 0, begin), first + words.count("\n", 0, end) + 1
            )
            if lines.isdisjoint(place):
                continue
            phrase = " ".join(words[begin:end].split())
            found.add((place.start, f"docstring opens with {phrase}" if opens else phrase))
    return sorted(found)


def main(arguments: list[str] | None = None) -> int:
    """Print what is found, and return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--base", metavar="REVISION", help="compare with this commit")
    base: str | None = parser.parse_args(arguments).base
    try:
        root = Path(git("rev-parse", "--show-toplevel").strip())
        base = base or find_base()
    except GitError as error:
        print(f"nothing to compare: {error}")
        return 0
    if base is None:
        print("nothing to compare: HEAD has no parent here")
        return 0
    try:
        added = added_lines(base, root)
    except GitError as error:
        print(error, file=sys.stderr)
        return 2
    count = 0
    for name, lines in sorted(added.items()):
        for line, phrase in faults((root / name).read_text(encoding="utf-8"), lines):
            print(f"{name}:{line}: {phrase}")
            count += 1
    return min(count, 1)


if __name__ == "__main__":
    sys.exit(main())
