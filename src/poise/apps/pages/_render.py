"""`render_page`: a template filled in. `replace_file`: a file written whole or not at all."""

import os
from functools import cache
from pathlib import Path
from typing import Any

from poise.apps.pages._style import number
from poise.errors import import_extra

_TEMPLATES = Path(__file__).with_name("templates")


def render_page(template: str | Path, **values: object) -> str:
    """Fill in a template; text is escaped, and a name without a value is an error.

    Args:
        template: name of a template of the kit, or the file of another one, which may extend
            `base.html.j2` and import `parts.html.j2`.
        values: by the names in the template.

    Returns:
        The page, which needs no network.

    Raises:
        MissingExtraError: jinja2 is not installed.
    """
    if isinstance(template, str):
        return _environment((_TEMPLATES,)).get_template(template).render(values)
    return _environment((template.parent, _TEMPLATES)).get_template(template.name).render(values)


@cache
def _environment(folders: tuple[Path, ...]) -> Any:
    jinja2 = import_extra("jinja2", "sim", "a page")
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folders),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = number
    return environment


def replace_file(path: Path, content: str | bytes) -> Path:
    """Write a file in one step, so that an interruption leaves the former one.

    Args:
        path: the file; its folder is made if it does not exist.
        content: text becomes UTF-8.

    Returns:
        The path.
    """
    written = content.encode() if isinstance(content, str) else content
    path.parent.mkdir(parents=True, exist_ok=True)
    # Readers of datasets pass over names that begin with a dot.
    draft = path.with_name(f".{path.name}.tmp")
    try:
        with draft.open("wb") as file:
            file.write(written)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise
    return path
