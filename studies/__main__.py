"""`python -m studies`: a paper's experiments, its numbers beside ours."""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, UseAppendAction, arg

from poise.cli import Bar, run_command
from studies.finding import with_unit
from studies.page import verdict, write_study
from studies.plan import Study, StudyOptions, load_study


@dataclass(frozen=True, kw_only=True)
class StudyVerb:
    """Run a paper's experiments and write study.html, study.json and the figures.

    What is computed is written part by part, and trials of many seeds one by one: a run that was
    interrupted goes on when it is begun again. Exit status: 0 all findings hold, 1 one failed or a
    part has no result, 2 bad input.

    example: python -m studies bias-acceleration --out runs/bias
    """

    # Which study: bias-acceleration, step-teleoperation, reduced-dynamics, torque-teleoperation,
    # locomotion, quiet, ablation or g1-link
    name: Annotated[Positional[str], arg(metavar="NAME")]
    quick: bool = False  # a shorter version of the same, to try it out
    # Compute this part alone; may be given several times
    part: UseAppendAction[tuple[str, ...]] = ()
    seeds: int | None = None  # seeds a case, in parts that go through several
    seed: int = 0
    # Of `ablation`: rows of runs, taken from there and appended; rows.jsonl beside the page if not
    rows: Path | None = None
    processes: int | None = None  # of `ablation`: how many make runs; one a core if not given
    out: Annotated[str | None, arg(metavar="DIR")] = None  # folder; runs/study-NAME if not given
    json: bool = False  # print the figures as JSON

    def act(self) -> int:
        """Run the study and write everything."""
        plan = load_study(self.name)
        plan = plan.only(self.part) if self.part else plan
        folder = Path(self.out or f"runs/study-{plan.name}")
        shared = {f.name: getattr(self, f.name) for f in fields(StudyOptions) if f.name != "folder"}
        options = StudyOptions(folder=folder, **shared)
        folder.mkdir(parents=True, exist_ok=True)
        study = plan.run(
            options,
            show=lambda title: Bar(title, ""),
            save=lambda so_far: write_study(so_far, folder),
        )
        if self.json:
            print("\n".join(json.dumps(finding.to_json()) for finding in study.findings))
        else:
            _print(study)
            print(f"page: {folder / 'study.html'}")
        for part in study.unfinished:
            # One line each; the page has the traceback.
            print(f"{part.title}:", *part.reason.split(), file=sys.stderr)
        return 0 if study.ok else 1


def _print(study: Study) -> None:
    print(f"{study.plan.name}: {verdict(study)}")
    for section in study.sections:
        print(section.title)
        for finding in section.findings:
            mark = "ok  " if finding.ok else "FAIL"
            ours = with_unit(finding.ours, finding.unit)
            paper = f" (paper: {with_unit(finding.paper, finding.unit)})"
            print(f"  {mark}  {finding.name}: {ours}{'' if finding.paper is None else paper}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one study."""
    words = sys.argv[1:] if arguments is None else arguments
    return run_command("python -m studies", StudyVerb, words)


if __name__ == "__main__":
    sys.exit(main())
