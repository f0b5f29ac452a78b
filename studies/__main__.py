"""`python -m studies`: a paper's experiments, its numbers beside ours."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from poise.cli import Bar, run_command
from studies.finding import with_unit
from studies.page import verdict, write_study
from studies.plan import STUDIES, Study, StudyOptions, load_study


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one study."""
    parser = argparse.ArgumentParser(
        prog="python -m studies",
        description="Runs a paper's experiments and writes study.html, study.json and the figures. "
        "What is computed is written part by part, and trials of many seeds one by one: a run "
        "that was interrupted goes on when it is begun again. Exit status: 0 all findings hold, "
        "1 one failed or a part has no result, 2 bad input.",
        epilog="example: python -m studies bias-acceleration --out runs/bias",
    )
    parser.add_argument("name", metavar="NAME", help="which study: " + ", ".join(STUDIES))
    parser.add_argument(
        "--quick", action="store_true", help="a shorter version of the same, to try it out"
    )
    parser.add_argument(
        "--part",
        metavar="PART",
        action="append",
        help="compute this part alone; may be given several times (default: all parts)",
    )
    parser.add_argument(
        "--seeds",
        metavar="N",
        type=_seed,
        help="seeds a case, in parts that go through several (default: the part's own number)",
    )
    parser.add_argument(
        "--seed", metavar="N", type=_seed, default=0, help="seed (default: %(default)s)"
    )
    parser.add_argument(
        "--rows",
        metavar="FILE",
        type=Path,
        help="of `ablation`: rows of runs, which are taken from there and appended "
        "(default: rows.jsonl in the folder written into)",
    )
    parser.add_argument(
        "--processes",
        metavar="N",
        type=_count,
        help="of `ablation`: how many make runs (default: one a core)",
    )
    parser.add_argument(
        "--out", metavar="DIR", help="folder to write into (default: runs/study-NAME)"
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.set_defaults(act=_act)
    return run_command(parser, arguments)


def _seed(text: str) -> int:
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"got {text!r}, wanted 0, 1, 2, ...")
    return int(text)


def _count(text: str) -> int:
    if _seed(text) == 0:
        raise argparse.ArgumentTypeError(f"got {text!r}, wanted 1, 2, ...")
    return int(text)


def _act(options: argparse.Namespace) -> int:
    """Runs the study and writes everything."""
    plan = load_study(options.name)
    if options.part:
        plan = plan.only(options.part)
    folder = Path(options.out or f"runs/study-{plan.name}")
    asked = StudyOptions(
        quick=options.quick,
        seed=options.seed,
        seeds=options.seeds,
        folder=folder,
        rows=options.rows,
        processes=options.processes,
    )
    folder.mkdir(parents=True, exist_ok=True)
    study = plan.run(
        asked,
        show=lambda title: Bar(title, ""),
        save=lambda so_far: write_study(so_far, folder),
    )
    if options.json:
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


if __name__ == "__main__":
    sys.exit(main())
