"""`Study`: what a study found, complete or as far as it came."""

from dataclasses import dataclass

from studies.finding import Finding, Section


@dataclass(frozen=True, kw_only=True)
class Unfinished:
    """A part of a study that has no result.

    Attributes:
        name: id of the part.
        title: its heading.
        reason: why, in one line.
        details: the traceback where an error was the reason.
    """

    name: str
    title: str
    reason: str
    details: str = ""

    def finding(self) -> Finding:
        """The part's place in the list of findings: one that does not hold."""
        return Finding(
            name=f"part {self.name!r} of the study",
            paper=None,
            ours=None,
            unit="",
            ok=False,
            note=f"{self.title}: {self.reason}",
        )


@dataclass(frozen=True, kw_only=True)
class Study:
    """What a study found.

    Attributes:
        name: as the command line has it.
        title: heading of its page.
        introduction: paragraphs of plain text, as in sections.
        source: the paper, as one cites it.
        quick: whether it ran in its shorter version.
        seed: of everything random in it.
        sections: the parts that are done, in order.
        unfinished: the parts that failed or were not computed.
    """

    name: str
    title: str
    introduction: tuple[str, ...]
    source: str
    quick: bool
    seed: int
    sections: tuple[Section, ...] = ()
    unfinished: tuple[Unfinished, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings in order; behind them one that does not hold for each unfinished part."""
        done = tuple(finding for section in self.sections for finding in section.findings)
        return done + tuple(part.finding() for part in self.unfinished)

    @property
    def ok(self) -> bool:
        """Whether every part was computed and every finding holds."""
        return all(finding.ok for finding in self.findings)
