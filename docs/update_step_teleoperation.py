"""Run the quick study of step teleoperation, and put its tables into study_step_teleoperation.md.

    python docs/update_step_teleoperation.py

Takes some minutes. Written are the findings that do not hold and the table of the rules.
"""

import re
from pathlib import Path

from studies.finding import Cell, Finding, Section, Table, number_text
from studies.plan import StudyOptions
from studies.step_teleoperation import PLAN

PAGE = Path(__file__).with_name("study_step_teleoperation.md")

FINDINGS, RULES = "step-teleoperation findings", "rules"
"""Names of the marks around a table."""

PARTS = ("cart-table", "scenario-1", "scenario-2", "scenario-3", "scenario-4", "g1", "rules")


def main() -> None:
    """Compute the parts, then replace the text between the marks."""
    parts = {part.name: part for part in PLAN.parts}
    sections: dict[str, Section] = {}
    for name in PARTS:
        print(parts[name].title, flush=True)
        sections[name] = parts[name].compute(StudyOptions(quick=True), _told)
    found = [finding for section in sections.values() for finding in section.findings]
    page = PAGE.read_text(encoding="utf-8")
    for mark, made in (
        (FINDINGS, findings_table(found)),
        (RULES, table(sections["rules"].tables[0])),
    ):
        page = between_marks(page, mark, made)
    PAGE.write_text(page, encoding="utf-8")


def _told(done: float, total: float) -> None:
    print(f"\r  {done:.0f} of {total:.0f}", end="" if done < total else "\n", flush=True)


def between_marks(page: str, mark: str, made: str) -> str:
    """Replace the text between `<!-- begin: MARK -->` and `<!-- end: MARK -->`."""
    begin, end = f"<!-- begin: {mark} -->\n", f"\n<!-- end: {mark} -->"
    place = re.compile(f"({re.escape(begin)}).*({re.escape(end)})", re.DOTALL)
    if not place.search(page):
        raise SystemExit(f"{PAGE.name} has no marks of {mark!r}")
    return place.sub(lambda m: f"{m[1]}{made}{m[2]}", page)


def findings_table(findings: list[Finding]) -> str:
    """Number of findings that hold, and a row for each of the others."""
    rows = [(f.name, f.paper, f.ours, f.unit or "–") for f in findings if not f.ok]
    held = f"{len(findings) - len(rows)} of {len(findings)} findings hold."
    return f"{held} These do not:\n\n{markdown(['finding', 'paper', 'ours', 'unit'], rows)}"


def table(made: Table) -> str:
    """Return a table of the study."""
    return markdown(made.columns, list(made.rows))


def markdown(header: list[str], rows: list[tuple[Cell, ...]]) -> str:
    """Return a Markdown table."""
    lines = ["| " + " | ".join(header) + " |", "| --- " * len(header) + "|"]
    for row in rows:
        cells = [cell if isinstance(cell, str) else number_text(cell) for cell in row]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
