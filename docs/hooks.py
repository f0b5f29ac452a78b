"""Reference pages that are made at build time, and links that leave `docs`.

mkdocs calls the functions that begin with `on_`; `mkdocs.yml` names this file.
"""

import ast
import re
from pathlib import Path, PurePosixPath
from posixpath import normpath
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"
_OUTSIDE = re.compile(r"(?<=\]\()(?:\.\./)+[^)\s#]+")


def public_names() -> dict[str, list[str]]:
    """Return the names in the `__all__` of each module that has some, without importing it."""
    found = dict[str, list[str]]()
    for file in sorted((SOURCE / "poise").rglob("*.py")):
        parts = file.relative_to(SOURCE).with_suffix("").parts
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            target = node.targets[0] if isinstance(node, ast.Assign) else None
            if isinstance(target, ast.Name) and target.id == "__all__" and "._" not in module:
                found[module] = ast.literal_eval(node.value)
    return found


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a reference page for each package, and the list of all names."""
    names = public_names()
    names.pop("poise")
    for package, members in names.items():
        text = f"::: {package}\n    options:\n      heading_level: 1\n"
        text += "      show_root_full_path: true\n      members: [" + ", ".join(members) + "]\n"
        head = f"---\ntitle: {package}\n---\n\n"
        files.append(File.generated(config, f"reference/{package}.md", content=head + text))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, **_: Any) -> str:
    """List all names, and let links to files outside `docs` lead to the repository."""
    if page.file.src_uri == "reference/index.md":
        for package, members in public_names().items():
            if package != "poise":
                links = ", ".join(f"[`{name}`][{package}.{name}]" for name in members)
                markdown += f"\n[`{package}`]({package}.md): {links}\n"
    folder = PurePosixPath("docs") / PurePosixPath(page.file.src_uri).parent

    def address(link: re.Match[str]) -> str:
        path = normpath((folder / link[0]).as_posix())
        if path.startswith("docs/"):
            return link[0]
        kind = "tree" if (ROOT / path).is_dir() else "blob"
        return f"{config.repo_url}/{kind}/main/{path}"

    return _OUTSIDE.sub(address, markdown)
