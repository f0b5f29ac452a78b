"""The page of a study: verdict, overview, and a section a part with findings, figures, tables.

`write_study`: the findings as JSON, the figures as files, and one page with everything.
"""

import json
import os
import re
from html import escape
from pathlib import Path

from poise.apps.report import html_document
from studies.finding import Cell, Figure, Film, Finding, Section, Table, number_text
from studies.plan import Study, Unfinished

_CODE = re.compile(r"`([^`]+)`")


def page_html(study: Study) -> str:
    """The whole page as text.

    Args:
        study: complete, or as far as it came.

    Returns:
        An HTML document that refers to nothing outside itself.
    """
    body = [
        _header(study),
        _nav(study),
        '<main class="wide">',
        _unfinished(study.unfinished),
        _overview(study),
        *(_section(section) for section in study.sections),
        "</main>",
        '<footer class="wide">Made by Poise. The numbers under “paper” are those of '
        f"{escape(study.plan.source)} Where it has none they are what is asked for.</footer>",
    ]
    return html_document(study.plan.title, body)


def verdict(study: Study) -> str:
    """How a study ended, in a few words."""
    failed = sum(not finding.ok for section in study.sections for finding in section.findings)
    missing = len(study.unfinished)
    if not failed and not missing:
        return f"all {len(study.findings)} findings hold"
    words = [f"{failed} of {len(study.findings) - missing} findings failed"] if failed else []
    if missing:
        words.append(f"{missing} {'part has' if missing == 1 else 'parts have'} no result")
    return ", ".join(words)


def _header(study: Study) -> str:
    facts = (
        ("study", study.plan.name),
        ("version", "quick, shortened for tests" if study.options.quick else "full"),
        ("seed", str(study.options.seed)),
    )
    listed = "".join(f"<div><dt>{k}</dt><dd>{escape(v)}</dd></div>" for k, v in facts)
    words = verdict(study)
    mark = "✓" if study.ok else "✗"
    return (
        '<header><div class="wide"><div class="title">'
        f"<h1>{escape(study.plan.title)}</h1>"
        f'<div class="verdict {"good" if study.ok else "bad"}">'
        f"{mark} {escape(words[:1].upper() + words[1:])}</div></div>"
        f'<dl class="facts">{listed}</dl>'
        f'<div class="description">{_paragraphs(study.plan.introduction)}'
        f"<p>After {escape(study.plan.source)}</p></div></div></header>"
    )


def _nav(study: Study) -> str:
    links = [("overview", "Overview"), *((s.name, s.title) for s in study.sections)]
    items = "".join(f'<a href="#{escape(name)}">{escape(text)}</a>' for name, text in links)
    return f'<nav><div class="wide">{items}</div></nav>'


def _unfinished(parts: tuple[Unfinished, ...]) -> str:
    if not parts:
        return ""
    items = "".join(
        f"<li><strong>{escape(part.title)}</strong>: {escape(part.reason)}"
        + (
            f"<details><summary>traceback</summary><pre>{escape(part.details)}</pre></details>"
            if part.details
            else ""
        )
        + "</li>"
        for part in parts
    )
    return f'<section class="notes"><h2>Parts without a result</h2><ul>{items}</ul></section>'


def _overview(study: Study) -> str:
    """A line a part, and every finding that does not hold."""
    rows = [
        (
            held == len(section.findings),
            f'<td><a href="#{escape(section.name)}">{escape(section.title)}</a></td>'
            f"{_number(len(section.findings))}{_number(held)}"
            f"{_mark(held == len(section.findings))}",
        )
        for section in study.sections
        for held in (sum(finding.ok for finding in section.findings),)
    ]
    head = '<th>part</th><th class="number">findings</th><th class="number">that hold</th>'
    failed = tuple(f for section in study.sections for f in section.findings if not f.ok)
    return (
        '<section id="overview"><h2>Overview</h2><p class="how">A finding holds when what the '
        "paper claims (a value, a ratio, an order, a bound) is met by our number; it is never "
        "measured against an earlier run of ours.</p>"
        f"<table>{_judged(head + '<th>verdict</th>', rows)}</table>"
        + (f"<h3>Findings that failed</h3>{_findings(failed)}" if failed else "")
        + "</section>"
    )


def _section(section: Section) -> str:
    findings = f"<h3>Paper and ours</h3>{_findings(section.findings)}" if section.findings else ""
    return (
        f'<section id="{escape(section.name)}"><h2>{escape(section.title)}</h2>'
        f'<div class="description">{_paragraphs(section.prose)}</div>'
        + "".join(_figure(figure) for figure in section.figures)
        + "".join(_film(film) for film in section.films)
        + findings
        + "".join(_table(table) for table in section.tables)
        + "</section>"
    )


def _findings(findings: tuple[Finding, ...]) -> str:
    head = (
        '<th>finding</th><th class="number">paper</th><th class="number">ours</th>'
        "<th>unit</th><th>verdict</th><th>what is claimed, and why they differ</th>"
    )
    rows = [
        (
            f.ok,
            f"<td>{_inline(f.name)}</td>{_number(f.paper)}{_number(f.ours)}"
            f'<td class="unit">{escape(f.unit) or "–"}</td>{_mark(f.ok)}<td>{_inline(f.note)}</td>',
        )
        for f in findings
    ]
    return f'<div class="scroll"><table class="findings">{_judged(head, rows)}</table></div>'


def _judged(head: str, rows: list[tuple[bool, str]]) -> str:
    """Head and body of a table whose rows hold or fail."""
    body = "".join(f'<tr class="{"held" if ok else "failed"}">{row}</tr>' for ok, row in rows)
    return f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>"


def _number(value: int | float | None) -> str:
    return f'<td class="number">{number_text(value)}</td>'


def _mark(ok: bool) -> str:
    kind, words = ("good", "✓ holds") if ok else ("bad", "✗ failed")
    return f'<td class="mark {kind}">{words}</td>'


def _film(film: Film) -> str:
    name = escape(film.file_name)
    return (
        f"<figure><h3>{escape(film.title)}</h3>"
        f'<video controls preload="metadata" src="{name}"></video></figure>'
    )


def _figure(figure: Figure) -> str:
    return (
        f'<figure id="{figure.name}"><h3>{escape(figure.title)}</h3>'
        f'<p class="how">{_inline(figure.caption)}</p>'
        f'<div class="scroll"><div class="plot still">{figure.svg}</div></div></figure>'
    )


def _table(table: Table) -> str:
    numeric = [
        all(not isinstance(row[i], str) for row in table.rows) for i in range(len(table.columns))
    ]
    kinds = [' class="number"' if is_number else "" for is_number in numeric]
    head = "".join(f"<th{k}>{escape(h)}</th>" for k, h in zip(kinds, table.columns, strict=True))
    rows = "".join(
        "<tr>"
        + "".join(f"<td{k}>{_cell(c)}</td>" for k, c in zip(kinds, row, strict=True))
        + "</tr>"
        for row in table.rows
    )
    caption = f'<p class="how">{_inline(table.caption)}</p>' if table.caption else ""
    return (
        f'<h3>{escape(table.title)}</h3>{caption}<div class="scroll"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _cell(cell: Cell) -> str:
    return _inline(cell) if isinstance(cell, str) else number_text(cell)


def _paragraphs(texts: tuple[str, ...]) -> str:
    return "".join(f"<p>{_inline(text)}</p>" for text in texts)


def _inline(text: str) -> str:
    # "n = 30" shall not be broken over two lines.
    return _CODE.sub(r"<code>\1</code>", escape(text)).replace(" = ", "\u00a0=\u00a0")


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
