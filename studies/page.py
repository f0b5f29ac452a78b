"""`write_study`: the findings as JSON, the figures as files, and one page with everything."""

import json
import os
import re
from pathlib import Path

from markupsafe import Markup, escape

from poise.apps.pages import render_page
from studies.finding import Table, number_text
from studies.plan import Study

_CODE = re.compile(r"`([^`]+)`")

JSON, PAGE = "study.json", "study.html"
"""Names of the files in the folder."""


def write_study(study: Study, folder: Path) -> Path:
    """Write all results of a study; the page needs no network, and no other file but the videos.

    The same study gives the same bytes. A file that is there already is replaced in one step, so
    that an interruption leaves the former one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    findings = [finding.to_json() for finding in study.findings]
    _replace(folder / JSON, json.dumps(findings, indent=2, ensure_ascii=False) + "\n")
    for section in study.sections:
        for figure in section.figures:
            _replace(folder / f"{figure.name}.svg", figure.to_file())
    _replace(folder / PAGE, page_html(study))
    return folder / PAGE


def _replace(path: Path, content: str) -> None:
    beside = path.with_name(path.name + ".part")
    beside.write_text(content, encoding="utf-8")
    os.replace(beside, path)


def page_html(study: Study) -> str:
    """Return the whole page, which refers to nothing outside itself."""
    words = verdict(study)
    mark = "✓" if study.ok else "✗"
    return render_page(
        Path(__file__).with_name("study.html.j2"),
        study=study,
        verdict=(f"{mark} {words[:1].upper()}{words[1:]}", study.ok),
        facts=(
            ("study", study.plan.name),
            ("version", "quick, shortened for tests" if study.options.quick else "full"),
            ("seed", study.options.seed),
        ),
        held={s.name: sum(finding.ok for finding in s.findings) for s in study.sections},
        failed=[f for section in study.sections for f in section.findings if not f.ok],
        inline=_inline,
        number=number_text,
        cells=_cells,
        columns=_columns,
    )


def verdict(study: Study) -> str:
    """End of a study in a few words."""
    failed = sum(not finding.ok for section in study.sections for finding in section.findings)
    missing = len(study.unfinished)
    if not failed and not missing:
        return f"all {len(study.findings)} findings hold"
    words = [f"{failed} of {len(study.findings) - missing} findings failed"] if failed else []
    if missing:
        words.append(f"{missing} {'part has' if missing == 1 else 'parts have'} no result")
    return ", ".join(words)


def _columns(table: Table) -> list[tuple[str, bool]]:
    """Labels of a table, each with whether there are only numbers below it."""
    return [
        (name, all(not isinstance(row[i], str) for row in table.rows))
        for i, name in enumerate(table.columns)
    ]


def _cells(table: Table) -> list[list[str]]:
    return [[_inline(c) if isinstance(c, str) else number_text(c) for c in r] for r in table.rows]


def _inline(text: str) -> Markup:
    """Text with words between backticks as code."""
    # "n = 30" shall not be broken over two lines.
    marked = _CODE.sub(r"<code>\1</code>", str(escape(text)))
    return Markup(marked.replace(" = ", "\u00a0=\u00a0"))
