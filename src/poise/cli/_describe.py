"""`poise describe`: a description proposed for a URDF or MJCF, tried and shown."""

import argparse
import json
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Any

from poise.cli._options import add_output_options, output_folder
from poise.errors import ConfigurationError, RobotError
from poise.robots import describe, description_of, load_robot


def add_parser(verbs: Any) -> None:
    """Add the verb to the command line."""
    parser = verbs.add_parser(
        "describe",
        help="propose a description for a URDF or MJCF",
        description="Proposes a description for a URDF or MJCF file: feet and soles, hands, torso, "
        "pelvis, home posture, limits and rotor inertias that the file lacks, each with its "
        "reason. Then the robot stands, squats and reaches in simulation; one with a fixed base "
        "holds still and reaches. Writes STEM.poise.yaml and describe.html. Exit status: 0 all of "
        "it went well, 1 something did not, 2 bad input.",
        epilog="example: poise describe robot.urdf --save",
    )
    flags = {
        "--save": "write the description beside the model, where load_robot finds it",
        "--force": "let --save write over another description",
        "--no-trial": "leave the simulation out",
    }
    parser.add_argument("file", help="a URDF, MJCF or xacro file")
    for flag, words in flags.items():
        parser.add_argument(flag, action="store_true", help=words)
    add_output_options(parser, "runs/describe-NAME")
    parser.set_defaults(act=act, simulates=True)


def act(options: argparse.Namespace) -> int:
    """Propose, write the description, then try it out and draw the page."""
    path = Path(options.file)
    saved = description_of(path)
    proposal = describe(path)
    other = saved.is_file() and saved.read_text(encoding="utf-8") != proposal.text
    if options.save and other and not options.force:
        what = "there is a description already, and it is another one"
        remedy = "--force to write over it, or no --save to compare"
        raise ConfigurationError(what, got=str(saved), wanted=remedy)
    with output_folder(options.out, f"runs/describe-{proposal.name}") as folder:
        description = saved if options.save else folder / saved.name
        # First: it is what to mend where the robot cannot be loaded, and is there after Ctrl-C.
        description.write_text(proposal.text, encoding="utf-8")
        remarks, refused, robot = list(proposal.remarks), None, None
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                robot = load_robot(path, proposal.facts)
            except RobotError as error:
                refused = str(error)
        remarks += [str(warning.message) for warning in caught]
        trial, page = list[dict[str, Any]](), None
        if robot is not None:
            from poise.apps.onboarding import try_out, write_page

            tried, page = (
                None if options.no_trial else try_out(robot),
                str(folder / "describe.html"),
            )
            write_page(robot, proposal, tried, Path(page))
            trial = [] if tried is None else [asdict(a) for a in tried.attempts]
    summary = {
        "facts": proposal.facts,
        "reasons": proposal.reasons,
        "remarks": remarks,
        "refused": refused,
        "trial": trial,
        "description": str(description),
        "page": page,
    }
    if options.json:
        print(json.dumps(summary))
    else:
        size = "" if robot is None else f": {robot.nj} joints, {robot.mass:.1f} kg"
        print(f"{proposal.name}{size}\n  {proposal.summary}")
        _print(summary)
    return 0 if refused is None and all(attempt["ok"] for attempt in trial) else 1


def _print(summary: dict[str, Any]) -> None:
    for remark in summary["remarks"]:
        print(f"  note: {remark}")
    if summary["refused"]:
        print(f"  FAIL  load: {summary['refused']}")
    for tried in summary["trial"]:
        torque = f"at most {100 * tried['figures']['torque_ratio_max']:.0f} % of a torque limit"
        said = "; ".join(tried["words"]) or f"{torque} ({tried['weakest']})"
        print(f"  {'ok  ' if tried['ok'] else 'FAIL'}  {tried['name']}: {said}")
    mend = ", to be mended by hand" if summary["refused"] else ""
    print(f"description: {summary['description']}{mend}")
    if summary["page"]:
        print(f"page: {summary['page']}")
