"""`write_study`: the findings as JSON, the figures as files, and one page with everything."""

import json
import os
from pathlib import Path

from studies.page import page_html
from studies.study import Study

JSON, PAGE = "study.json", "study.html"
"""Names of the files in the folder."""


def write_study(study: Study, folder: Path) -> Path:
    """Writes what there is of a study; the page needs no network, and no other file but the videos.

    The same study gives the same bytes. A file that is there already is replaced in one step, so
    that an interruption leaves the former one.

    Args:
        study: complete, or as far as it came.
        folder: where `study.json`, `study.html`, a file `NAME.svg` for each figure and `NAME.mp4`
            for each video go; made if it does not exist.

    Returns:
        Path of the page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    findings = [finding.to_json() for finding in study.findings]
    _replace(folder / JSON, json.dumps(findings, indent=2, ensure_ascii=False) + "\n")
    for section in study.sections:
        for figure in section.figures:
            _replace(folder / f"{figure.name}.svg", figure.to_file())
        for film in section.films:
            _replace(folder / film.file_name, film.data)
    _replace(folder / PAGE, page_html(study))
    return folder / PAGE


def _replace(path: Path, content: str | bytes) -> None:
    beside = path.with_name(path.name + ".part")
    beside.write_bytes(content.encode() if isinstance(content, str) else content)
    os.replace(beside, path)
