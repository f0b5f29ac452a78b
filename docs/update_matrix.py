"""Resolves Poise from wheels for each platform and Python, and puts the table into install.md.

    python docs/update_matrix.py [--check]

Versions are those of requirements.lock; Pythons are those of the classifiers in pyproject.toml.
`--check` writes nothing and exits 1 where the page has another table.
"""

import argparse
import re
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "install.md"
TABLE = re.compile(r"(<!-- begin of the table -->\n).*(<!-- end of the table -->)", re.DOTALL)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

PLATFORMS = {
    "Linux x86_64": "x86_64-manylinux_2_28",
    "Linux aarch64": "aarch64-manylinux_2_28",
    "macOS arm64": "aarch64-apple-darwin",
}
"""Names in the table, and those of uv. glibc 2.28 is the oldest that Pinocchio's wheels take."""

_PYTHON = re.compile(r"Programming Language :: Python :: (3\.\d+)$")
_NO_WHEEL = re.compile(
    r"(?:Because |and )([\w.-]+?)(?:\{[^}]*\})?[=<>~!,.\d]* has no (?:usable )?wheels"
)


def main() -> int:
    """Resolve every cell, then compare the table or write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    check = parser.parse_args().check
    cells = [*product(PLATFORMS, pythons())]
    # Resolving waits for the index most of the time.
    with ThreadPoolExecutor(len(cells)) as threads:
        found = threads.map(lambda cell: missing(PLATFORMS[cell[0]], cell[1]), cells)
    page = PAGE.read_text(encoding="utf-8")
    made = table(dict(zip(cells, found, strict=True)))
    wanted = TABLE.sub(lambda m: f"{m[1]}{made}{m[2]}", page)
    if not check:
        PAGE.write_text(wanted, encoding="utf-8")
    elif wanted != page:
        print(f"docs/install.md: another matrix; run python docs/update_matrix.py\n{made}")
        return 1
    return 0


def pythons() -> list[str]:
    """Versions of Python that the classifiers name."""
    return [m[1] for m in map(_PYTHON.match, PROJECT["classifiers"]) if m]


def missing(platform: str, python: str) -> dict[str, str]:
    """Reason of each extra that cannot be resolved, "" for Poise without extras."""
    # Not the tools of development.
    extras = [extra for extra in PROJECT["optional-dependencies"] if extra not in ("docs", "dev")]
    if not resolve(platform, python, extras):
        return {}
    reasons = {
        extra: resolve(platform, python, [extra] if extra else []) for extra in ["", *extras]
    }
    return {extra: reason for extra, reason in reasons.items() if reason}


def resolve(platform: str, python: str, extras: list[str]) -> str:
    """Resolve Poise with extras; the reason in one line where that fails, else "".

    Raises:
        RuntimeError: if uv failed for another reason, such as an index out of reach.
    """
    target = ["--python-platform", platform, "--python-version", python, "--only-binary", ":all:"]
    wanted = ["pyproject.toml", "-c", "requirements.lock", *(f"--extra={e}" for e in extras)]
    command = [sys.executable, "-m", "uv", "--no-python-downloads", "pip", "compile", "--quiet"]
    command += [*target, *wanted]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode and "No solution found" not in done.stderr:
        raise RuntimeError(f"uv failed: {done.stderr.strip()}")
    return reason(done.stderr) if done.returncode else ""


def reason(message: str) -> str:
    """Reason of a failed resolution: the packages without wheels where uv names them."""
    message = " ".join(message.split())
    found = sorted({*_NO_WHEEL.findall(message)})
    return f"no wheel of {', '.join(found)}" if found else message


def table(found: dict[tuple[str, str], dict[str, str]]) -> str:
    """Markdown table with a row for each platform and a column for each Python."""
    columns = list(dict.fromkeys(python for _, python in found))
    lines = [f"| | {' | '.join(columns)} |", f"| --- |{' --- |' * len(columns)}"]
    for platform in dict.fromkeys(platform for platform, _ in found):
        cells = [_cell(found[platform, python]) for python in columns]
        lines.append(f"| {platform} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cell(reasons: dict[str, str]) -> str:
    if "" in reasons:
        return f"none: {reasons['']}"
    parts: list[str] = []
    for why in dict.fromkeys(reasons.values()):
        extras = [f"`{extra}`" for extra, reason in reasons.items() if reason == why]
        parts.append(f"not {', '.join(extras)}: {why}")
    return "; ".join(parts) or "all extras"


if __name__ == "__main__":
    sys.exit(main())
